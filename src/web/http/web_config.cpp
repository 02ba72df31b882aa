#include "web/http/web_config.h"

#include <boost/asio/ip/address.hpp>
#include <filesystem>
#include <regex>

#include "common/error.h"

namespace livemap::web {
namespace {

void RequireFile(const std::string& option, const std::string& root, const std::string& name) {
  std::error_code failure;
  if (std::filesystem::is_regular_file(std::filesystem::path(root) / name, failure)) return;
  throw Error(option + " is '" + root + "', accepted is a folder that holds " + name);
}

void RequirePositive(const std::string& option, double value) {
  if (value > 0 && value < 1e9) return;
  throw Error(option + " is " + std::to_string(value) + ", accepted is a number above 0");
}

void RequireAddress(const std::string& option, const std::string& address) {
  boost::system::error_code failure;
  boost::asio::ip::make_address(address, failure);
  if (failure) {
    throw Error(option + " holds '" + address + "', accepted are IPv4 and IPv6 addresses");
  }
}

void ValidateTls(const WebConfig& options) {
  if (options.certificate_file.empty() != options.key_file.empty()) {
    throw Error("web_certificate is '" + options.certificate_file + "' and web_key is '" +
                options.key_file + "', accepted are two files or none");
  }
  if (options.redirect_port < 0 || options.redirect_port > 65535) {
    throw Error("web_http_redirect_port is " + std::to_string(options.redirect_port) +
                ", accepted is 0 to 65535");
  }
  if (options.redirect_port == 0) return;
  if (options.certificate_file.empty()) {
    throw Error("web_http_redirect_port is " + std::to_string(options.redirect_port) +
                ", accepted is 0 where web_certificate is empty");
  }
  if (options.redirect_port == options.port) {
    throw Error("web_http_redirect_port is " + std::to_string(options.redirect_port) +
                ", which is web_port, accepted is another port");
  }
}

/// They stand in every feed.
void ValidateFeeds(const WebConfig& options) {
  static const std::regex kUrl("https?://[A-Za-z0-9._~:/%\\[\\]-]+");
  if (!options.public_url.empty() && !std::regex_match(options.public_url, kUrl)) {
    throw Error("public_url is '" + options.public_url +
                "', accepted is http(s)://HOST or http(s)://HOST/PATH");
  }
  static const std::regex kCountry("[a-z]{2}");
  if (!std::regex_match(options.feed_country, kCountry)) {
    throw Error("feed_country is '" + options.feed_country +
                "', accepted are two lower-case letters (ISO 3166-1), zz for none");
  }
}

}  // namespace

std::string TileSource(const std::string& tile_url) {
  if (tile_url.empty()) return "";
  const std::string accepted =
      ", accepted is http(s)://HOST/PATH or /PATH with {z}, {x} and {y} in the path";
  const bool has_place = tile_url.find("{z}") != std::string::npos &&
                         tile_url.find("{x}") != std::string::npos &&
                         tile_url.find("{y}") != std::string::npos;
  if (!has_place) throw Error("tile_url is '" + tile_url + "'" + accepted);
  if (std::regex_match(tile_url, std::regex("/[^/\\s;,'\"][^\\s;,'\"]*"))) return "";
  std::smatch parts;
  // The host goes into a header: nothing but a host name, an optional {s} in front, and a port.
  static const std::regex kAddress(
      "(https?://)(\\{s\\}\\.)?([A-Za-z0-9.-]+(?::[0-9]{1,5})?)/[^\\s'\"]*");
  if (!std::regex_match(tile_url, parts, kAddress)) {
    throw Error("tile_url is '" + tile_url + "'" + accepted);
  }
  return parts[1].str() + (parts[2].matched ? "*." : "") + parts[3].str();
}

void Validate(const WebConfig& options) {
  if (options.port < 0 || options.port > 65535) {
    throw Error("port is " + std::to_string(options.port) + ", accepted is 0 to 65535");
  }
  RequireFile("web_root", options.web_root, "index.html");
  RequireFile("leaflet_root", options.leaflet_root, "leaflet/leaflet.min.js");
  TileSource(options.tile_url);
  if (!options.tile_url.empty() && !options.tile_file.empty()) {
    throw Error("tile_url is '" + options.tile_url + "' and the file of tiles is '" +
                options.tile_file + "', accepted is one of the two");
  }
  ValidateTls(options);
  ValidateFeeds(options);
  if (!geo::IsValid(options.centre)) {
    throw Error("centre is " + std::to_string(options.centre.latitude_deg) + ", " +
                std::to_string(options.centre.longitude_deg) +
                ", accepted is a latitude from -90 to 90 and a longitude from -180 to 180");
  }
  if (options.threads < 1 || options.threads > 64) {
    throw Error("threads is " + std::to_string(options.threads) + ", accepted is 1 to 64");
  }
  if (options.picture_side_px < 16 || options.picture_side_px > 16384) {
    throw Error("picture_side_px is " + std::to_string(options.picture_side_px) +
                ", accepted is 16 to 16384");
  }
  RequirePositive("max_connections", static_cast<double>(options.max_connections));
  RequirePositive("max_connections_per_client",
                  static_cast<double>(options.max_connections_per_client));
  for (const std::string& proxy : options.proxies) RequireAddress("proxies", proxy);
  RequirePositive("max_held_bytes", static_cast<double>(options.max_held_bytes));
  RequirePositive("request_timeout_s", options.request_timeout_s);
  RequirePositive("answer_timeout_s", options.answer_timeout_s);
  RequirePositive("picture_timeout_s", options.picture_timeout_s);
  RequirePositive("certificate_check_s", options.certificate_check_s);
  if (!(options.hsts_s >= 0 && options.hsts_s < 1e9)) {
    throw Error("hsts_s is " + std::to_string(options.hsts_s) + ", accepted is 0 to 1e9");
  }
  RequirePositive("ping_timeout_s", options.ping_timeout_s);
  RequirePositive("heartbeat_s", options.heartbeat_s);
  RequirePositive("max_queued_messages", static_cast<double>(options.max_queued_messages));
  RequirePositive("max_queued_bytes", static_cast<double>(options.max_queued_bytes));
}

}  // namespace livemap::web
