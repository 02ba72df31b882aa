#include "web/http/server_address.h"

#include <cstddef>
#include <string_view>

namespace livemap::web {

namespace {

/// A Host is a stranger's text.
bool IsHost(const std::string& host) {
  constexpr std::size_t kMaxHostBytes = 255;
  constexpr const char* kHostCharacters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.-_:[]";
  return !host.empty() && host.size() <= kMaxHostBytes &&
         host.find_first_not_of(kHostCharacters) == std::string::npos;
}

std::string PublicAddress(const WebConfig& options) {
  const std::size_t last = options.public_url.find_last_not_of('/');
  return options.public_url.substr(0, last + 1);
}

}  // namespace

std::string ServerAddress(const WebConfig& options, const HttpRequest& question) {
  if (!options.public_url.empty()) return PublicAddress(options);
  const std::string scheme = options.certificate_file.empty() ? "http://" : "https://";
  return scheme + (IsHost(question.host) ? question.host : "localhost");
}

std::string HttpsAddress(const WebConfig& options, const std::string& host, int https_port) {
  constexpr std::string_view kHttps = "https://";
  constexpr int kUsualPort = 443;
  if (options.public_url.compare(0, kHttps.size(), kHttps) == 0) return PublicAddress(options);
  if (!IsHost(host)) return "";
  // An IPv6 address stands in brackets, and what follows is the port.
  const std::size_t bracket = host.rfind(']');
  const std::size_t colon = host.find(':', bracket == std::string::npos ? 0 : bracket);
  const std::string name = host.substr(0, colon);
  if (name.empty()) return "";
  const std::string port = https_port == kUsualPort ? "" : ":" + std::to_string(https_port);
  return std::string(kHttps) + name + port;
}

}  // namespace livemap::web
