#include "web/http/server_address.h"

#include <cstddef>

namespace livemap::web {

std::string ServerAddress(const WebConfig& options, const HttpRequest& question) {
  if (!options.public_url.empty()) {
    const std::size_t last = options.public_url.find_last_not_of('/');
    return options.public_url.substr(0, last + 1);
  }
  constexpr std::size_t kMaxHostBytes = 255;
  constexpr const char* kHostCharacters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.-_:[]";
  const bool is_host = !question.host.empty() && question.host.size() <= kMaxHostBytes &&
                       question.host.find_first_not_of(kHostCharacters) == std::string::npos;
  return "http://" + (is_host ? question.host : "localhost");
}

}  // namespace livemap::web
