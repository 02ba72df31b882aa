#include "web/http/origin.h"

#include <algorithm>

namespace livemap::web {

bool IsAllowedOrigin(const std::string& origin, const std::string& host,
                     const std::vector<std::string>& allowed, bool only_https) {
  if (origin.empty()) return true;
  if (!host.empty() && origin == "https://" + host) return true;
  if (!only_https && !host.empty() && origin == "http://" + host) return true;
  return std::find(allowed.begin(), allowed.end(), origin) != allowed.end();
}

}  // namespace livemap::web
