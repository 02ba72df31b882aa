#include "web/access/confirmed_sessions.h"

#include <iterator>

#include "common/sha256.h"
#include "common/time.h"

namespace livemap::web {

void ConfirmedSessions::Confirm(const std::string& token, std::int64_t now_ns) {
  for (auto entry = confirmed_.begin(); entry != confirmed_.end();) {
    entry = Seconds(now_ns - entry->second) < lasts_s_ ? std::next(entry) : confirmed_.erase(entry);
  }
  confirmed_[Sha256Hex(token)] = now_ns;
}

bool ConfirmedSessions::IsConfirmed(const std::string& token, std::int64_t now_ns) const {
  const auto found = confirmed_.find(Sha256Hex(token));
  return found != confirmed_.end() && Seconds(now_ns - found->second) < lasts_s_;
}

}  // namespace livemap::web
