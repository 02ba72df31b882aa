#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace livemap::web {

/// Whose owners have shown their password lately, of all sessions. Who finds a computer that
/// somebody has left cannot change accounts with it (OWASP ASVS 4.0, V3.7.1). It is not kept over a
/// restart. Not thread-safe.
class ConfirmedSessions {
 public:
  /// A password counts for so long, s.
  explicit ConfirmedSessions(double lasts_s) : lasts_s_(lasts_s) {}

  /// The owner of the session with this token has just shown the password; steady ns.
  void Confirm(const std::string& token, std::int64_t now_ns);
  /// Whether that was lately.
  bool IsConfirmed(const std::string& token, std::int64_t now_ns) const;

 private:
  const double lasts_s_;
  /// When, by the tokens' SHA-256. Each entry took a password's hash, and old ones go: so there are
  /// never many.
  std::map<std::string, std::int64_t> confirmed_;
};

}  // namespace livemap::web
