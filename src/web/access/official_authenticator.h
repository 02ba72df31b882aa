#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/queues/token_bucket.h"

namespace livemap::web {

/// An official as the token file names him: only the token's hash is kept.
struct Official {
  std::string name;
  std::string token_sha256;        ///< 64 hex digits.
  bool speaks_for_others = false;  ///< A region's: its own officials decide by it.
};

/// The word behind a token that may speak for others.
constexpr const char* kSpeaksForOthers = "speaks-for-others";

/// Reads a token file: a line "NAME TOKEN" or "NAME TOKEN speaks-for-others" for each official,
/// empty lines and lines that start with '#' aside. A name is printable text of at most 64 bytes
/// without blanks; a token is 16 to 256 of the characters that RFC 6750 allows (letters, digits,
/// -._~+/=). Throws Error naming the line and what is accepted, and for names or tokens that come
/// twice; never shows a token.
std::vector<Official> ParseTokenFile(const std::string& text, const std::string& name);

/// Reads the file at `path`. Throws Error as ParseTokenFile, and when the file cannot be read, is
/// no regular file, or may be read or written by everybody.
std::vector<Official> ReadTokenFile(const std::string& path);

/// Lets officials in by the bearer token of their request. Wrong tokens are counted against the
/// client that sends them: after a few, no short token of it is looked at for a while. A long one
/// always is, so that nobody behind an official's address can keep the official out: however fast
/// it guesses, a random token of kUnguessableBytes is not found, as one that a person made up might
/// be. Thread-safe.
class OfficialAuthenticator {
 public:
  enum class Verdict {
    kAllowed,
    kClosed,       ///< There are no officials.
    kNoToken,      ///< None was sent.
    kWrongToken,   ///< Counted against the client.
    kTooManyWrong  ///< Wrong, or too short to be looked at now.
  };
  struct Answer {
    Verdict verdict = Verdict::kClosed;
    std::string official;            ///< Name, where allowed.
    bool speaks_for_others = false;  ///< As the token file says, where allowed.
  };

  /// A client may be wrong so often at once, and again each time so long has passed.
  static constexpr int kMaxWrong = 10;
  static constexpr double kSecondsPerWrong = 30;
  /// A token of so many bytes is looked at whatever its client has sent: 32 hexadecimal digits are
  /// 128 bits, for which a billion guesses a second need 10^22 years.
  static constexpr std::size_t kUnguessableBytes = 32;

  explicit OfficialAuthenticator(std::vector<Official> officials);

  bool is_open() const { return !officials_.empty(); }
  /// `authorization` is the header's value, `now_s` a clock that never goes back. Takes the same
  /// time for every token.
  Answer Check(const std::string& authorization, const std::string& client, double now_s);
  /// Whether Check would allow it; counts nothing.
  bool IsRight(const std::string& authorization, const std::string& client, double now_s) const;

 private:
  const Official* OwnerOf(const std::string& token) const;
  /// Whose token it is; null where it is wrong or not looked at.
  const Official* Recognize(const std::string& token, bool may_try) const;
  bool MayTry(const std::string& client, std::int64_t now_ns) const;
  void CountMistake(const std::string& client, std::int64_t now_ns);

  const std::vector<Official> officials_;
  mutable Mutex mutex_;
  /// For each client that was wrong, how often it may be wrong still.
  KeyedTokenBuckets<1> attempts_ GUARDED_BY(mutex_);
};

}  // namespace livemap::web
