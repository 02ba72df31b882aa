#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::web {

/// What somebody sees who has not logged in, where the zone has accounts.
enum class PublicSees {
  kNothing,
  kTold,  ///< Hazards that drivers are told of.
  kAll    ///< All hazards and map changes. Vehicles are for those who have logged in, always.
};

/// Settings of the zone's web server, with their defaults.
struct WebConfig {
  std::string address = "127.0.0.1";  ///< Where to listen; "0.0.0.0" serves the whole network.
  int port = 8080;                    ///< 0 takes any free port.
  /// PEM files of the server's certificate and its private key (TlsCertificate). Both empty: plain
  /// HTTP is spoken.
  std::string certificate_file;
  std::string key_file;
  double certificate_check_s = 2;  ///< Between two looks at these files.
  /// Browsers are told to ask this host by HTTPS alone for so long (HSTS, RFC 6797); 0: never told.
  double hsts_s = 365 * 86400.0;
  int redirect_port = 0;                               ///< Plain HTTP that leads to HTTPS; 0: none.
  std::string web_root;                                ///< Folder of the page (index.html).
  std::string leaflet_root = "/usr/share/javascript";  ///< Holds Debian's leaflet/.
  std::string tile_url;          ///< E.g. "https://tiles.example/{z}/{x}/{y}.png"; empty: offline.
  std::string tile_attribution;  ///< Plain text; most tile providers require it.
  std::string tile_file;         ///< Raster tiles in one file (MBTiles), in place of tile_url.
  std::string title = "LiveMap";
  /// Address of this server as others reach it, "https://map.example" or with a path; links in
  /// feeds begin with it. Empty: what the request says of its host, by http.
  std::string public_url;
  std::string feed_publisher;               ///< Who publishes the feeds; empty: the title.
  std::string feed_country = "zz";          ///< Of the publisher, "us"; "zz": not said.
  geo::GeoPoint centre{40.4433, -79.9436};  ///< Where an empty map looks.
  /// Other origins than the server's own whose pages may open the live stream, "https://host:port".
  std::vector<std::string> allowed_origins;
  /// Officials and their tokens (web/access/official_authenticator.h); empty: nobody may decide.
  std::string token_file;
  /// People who may log in (accounts/account_store.h); empty: nobody. While the file has no
  /// account, everybody sees everything.
  std::string accounts_file;
  double session_s = 12 * 3600;                ///< A log-in lasts so long.
  PublicSees public_sees = PublicSees::kAll;   ///< Where there are accounts.
  int picture_side_px = 1280;                  ///< Longest side of a served picture.
  std::size_t picture_cache_bytes = 64 << 20;  ///< Served pictures kept in memory.
  int threads = 2;
  /// Who comes when all are taken takes the place of one that waits, or is answered 503
  /// (web/server/connection_table.h). `max_connections` are shared by all, the reserve included.
  std::size_t max_connections = 256;
  std::size_t max_connections_per_client = 64;  ///< Of an IPv4 address or an IPv6 /64 network.
  std::size_t reserved_connections = 32;        ///< For officials and /healthz; at most a quarter.
  /// Addresses of proxies, which have no share: all their clients have one address.
  std::vector<std::string> proxies;
  double request_timeout_s = 15;  ///< For a request with its body, also the idle time between two.
  double answer_timeout_s = 20;   ///< For writing each 32 KiB of an answer.
  double picture_timeout_s = 10;  ///< Who waits so long for a picture is answered 503.
  std::size_t max_held_bytes = 64 << 20;  ///< Of all answers that are being written.
  double ping_timeout_s = 20;  ///< A stream that answers no ping for this long is closed.
  double heartbeat_s = 5;      ///< A stream says something at least this often.
  /// Messages that wait for one live-stream client; one that falls further behind is closed with a
  /// reason and catches up when it reconnects.
  std::size_t max_queued_messages = 2048;
  std::size_t max_queued_bytes = 4 << 20;
  std::size_t socket_send_buffer_bytes = 128 << 10;  ///< SO_SNDBUF; 0 leaves it to the system.
};

/// Throws Error naming the first option that cannot be served, its value and what is accepted.
void Validate(const WebConfig& options);

/// The source expression of a Content-Security-Policy that admits the tiles' host, e.g.
/// "https://*.tiles.example" for "https://{s}.tiles.example/{z}/{x}/{y}.png"; empty for no tiles or
/// tiles of this server. Throws Error for anything that is no http(s) address or absolute path.
std::string TileSource(const std::string& tile_url);

}  // namespace livemap::web
