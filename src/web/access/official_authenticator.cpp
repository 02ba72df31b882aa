#include "web/access/official_authenticator.h"

#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "common/error.h"
#include "common/sha256.h"
#include "common/text_file.h"
#include "common/time.h"
#include "protocol/text_rules.h"

namespace livemap::web {
namespace {

constexpr std::size_t kMaxTokenFileBytes = 64 << 10;
constexpr std::size_t kMaxOfficials = 200;
constexpr std::size_t kMinTokenBytes = 16;
constexpr std::size_t kMaxTokenBytes = 256;
constexpr std::size_t kMaxNameBytes = 64;
constexpr std::size_t kMaxClients = 4096;

bool IsTokenCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
         std::string_view("-._~+/=").find(c) != std::string_view::npos;
}

bool IsToken(std::string_view text) {
  return text.size() >= kMinTokenBytes && text.size() <= kMaxTokenBytes &&
         std::all_of(text.begin(), text.end(), IsTokenCharacter);
}

/// Looks at every byte whatever it finds.
bool EqualInConstantTime(const std::string& a, const std::string& b) {
  if (a.size() != b.size()) return false;
  unsigned char difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference = static_cast<unsigned char>(difference | (a[i] ^ b[i]));
  }
  return difference == 0;
}

/// Throws Error for anything but "NAME TOKEN" and "NAME TOKEN speaks-for-others".
Official ParseOfficial(std::string_view line, const std::string& where) {
  const std::size_t blank = line.find(' ');
  const std::string name(line.substr(0, blank));
  std::string_view token =
      blank == std::string_view::npos ? std::string_view() : line.substr(blank + 1);
  const std::size_t end = token.find(' ');
  const bool speaks = end != std::string_view::npos && token.substr(end + 1) == kSpeaksForOthers;
  // Anything else behind it stays, and is refused as no token.
  if (speaks) token = token.substr(0, end);
  if (!protocol::IsAcceptableName(name, kMaxNameBytes) || !IsToken(token)) {
    throw Error(where + " is not accepted, accepted is NAME TOKEN: a name of 1 to " +
                std::to_string(kMaxNameBytes) + " bytes, one blank, a token of " +
                std::to_string(kMinTokenBytes) + " to " + std::to_string(kMaxTokenBytes) +
                " letters, digits and -._~+/=, and behind one blank the word " + kSpeaksForOthers +
                " where it may speak for others");
  }
  return {name, Sha256Hex(std::string(token)), speaks};
}

/// The token of "Bearer TOKEN", the scheme in any case; empty for anything else.
std::string BearerToken(const std::string& authorization) {
  constexpr std::string_view kScheme = "bearer ";
  if (authorization.size() <= kScheme.size()) return "";
  for (std::size_t i = 0; i < kScheme.size(); ++i) {
    const auto c = static_cast<unsigned char>(authorization[i]);
    if (static_cast<char>(std::tolower(c)) != kScheme[i]) return "";
  }
  return authorization.substr(kScheme.size());
}

}  // namespace

std::vector<Official> ParseTokenFile(const std::string& text, const std::string& name) {
  std::vector<Official> officials;
  std::string_view rest = text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = rest.find('\n');
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    // Blanks and a carriage return that editors leave at the end of a line.
    line = line.substr(0, line.find_last_not_of(" \t\r") + 1);
    if (line.empty() || line.front() == '#') continue;
    const std::string where = "token file '" + name + "', line " + std::to_string(number) + ",";
    Official official = ParseOfficial(line, where);
    for (const Official& other : officials) {
      if (other.name != official.name && other.token_sha256 != official.token_sha256) continue;
      throw Error(where + " has a name or token that was given before");
    }
    if (officials.size() == kMaxOfficials) {
      throw Error("token file '" + name + "' has more than " + std::to_string(kMaxOfficials) +
                  " officials");
    }
    officials.push_back(std::move(official));
  }
  if (officials.empty()) {
    throw Error("token file '" + name + "' names nobody, accepted are lines NAME TOKEN");
  }
  return officials;
}

std::vector<Official> ReadTokenFile(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    throw Error("token file '" + path + "' cannot be read: " + std::strerror(errno));
  }
  if (!S_ISREG(status.st_mode)) throw Error("token file '" + path + "' is no regular file");
  if ((status.st_mode & (S_IROTH | S_IWOTH)) != 0) {
    throw Error("token file '" + path +
                "' may be read or written by everybody, accepted is mode 0600 or 0640");
  }
  return ParseTokenFile(ReadTextFile(path, kMaxTokenFileBytes), path);
}

OfficialAuthenticator::OfficialAuthenticator(std::vector<Official> officials)
    : officials_(std::move(officials)),
      attempts_({TokenBucket({kMaxWrong, kMaxWrong * kSecondsPerWrong})}, kMaxClients,
                KeyedTokenBuckets<1>::Eviction::kAlways) {}

OfficialAuthenticator::Answer OfficialAuthenticator::Check(const std::string& authorization,
                                                           const std::string& client,
                                                           double now_s) {
  if (officials_.empty()) return {Verdict::kClosed, "", false};
  const std::string token = BearerToken(authorization);
  if (token.empty()) return {Verdict::kNoToken, "", false};
  const std::int64_t now_ns = Nanoseconds(now_s);
  const bool may_try = MayTry(client, now_ns);
  if (const Official* const owner = Recognize(token, may_try)) {
    return {Verdict::kAllowed, owner->name, owner->speaks_for_others};
  }
  if (!may_try) return {Verdict::kTooManyWrong, "", false};
  CountMistake(client, now_ns);
  return {Verdict::kWrongToken, "", false};
}

const Official* OfficialAuthenticator::Recognize(const std::string& token, bool may_try) const {
  return may_try || token.size() >= kUnguessableBytes ? OwnerOf(token) : nullptr;
}

/// Compares hashes, which tell nothing of how much of a token was right, with every official's.
const Official* OfficialAuthenticator::OwnerOf(const std::string& token) const {
  const std::string hash = Sha256Hex(token);
  const Official* found = nullptr;
  for (const Official& official : officials_) {
    if (EqualInConstantTime(hash, official.token_sha256)) found = &official;
  }
  return found;
}

bool OfficialAuthenticator::IsRight(const std::string& authorization, const std::string& client,
                                    double now_s) const {
  const std::string token = BearerToken(authorization);
  return !token.empty() && Recognize(token, MayTry(client, Nanoseconds(now_s))) != nullptr;
}

bool OfficialAuthenticator::MayTry(const std::string& client, std::int64_t now_ns) const {
  const MutexLock lock(mutex_);
  const auto* attempts = attempts_.Find(client);
  return attempts == nullptr || attempts->front().TokensAt(now_ns) >= 1;
}

void OfficialAuthenticator::CountMistake(const std::string& client, std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  // Several wrong tokens may have been looked at together: each counts.
  attempts_.Use(client, now_ns)->front().Spend(1);
}

}  // namespace livemap::web
