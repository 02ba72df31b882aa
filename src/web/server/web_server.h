#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "protocol/hazard_catalogue.h"
#include "web/api/neighbour_api.h"
#include "web/http/web_config.h"
#include "web/server/api.h"
#include "web/server/tls_certificate.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// The zone's web server: the live map's page, its API and its live stream
/// (docs/reference/http-api.md).
/// It speaks HTTPS where its options name a certificate; else, in front of a public network, stands
/// a proxy that does.
class WebServer {
 public:
  using Options = WebConfig;

  /// Listens and serves from its own threads when it returns. Keeps references to `zone`,
  /// `catalogue`, `orders` (null: the zone has no work orders) and `neighbours` (null: it does not
  /// follow other zones). Throws Error when an option is not accepted or the port cannot be opened.
  WebServer(const Options& options, zone::ZoneService& zone,
            const protocol::HazardCatalogue& catalogue, orders::OrderDesk* orders = nullptr,
            const NeighbourReader* neighbours = nullptr);
  /// Closes every connection and joins the threads.
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// The port it listens on, also where the options asked for any.
  int port() const;
  /// Open connections, HTTP and live streams together.
  std::size_t connections() const;
  /// What became of connections and pictures since the start.
  struct Counters {
    std::uint64_t connections_ended = 0;    ///< For others that needed their place.
    std::uint64_t connections_refused = 0;  ///< There was no place.
    std::uint64_t held_bytes = 0;           ///< Of the answers that are being written now.
    std::uint64_t failed_handshakes = 0;    ///< Connections that began TLS in vain.
    Api::PictureCounters pictures;
  };
  Counters counters() const;
  /// None where plain HTTP is spoken.
  std::optional<CertificateState> certificate() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap::web
