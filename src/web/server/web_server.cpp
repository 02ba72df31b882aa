#include "web/server/web_server.h"

#include "web/api/event_hub.h"
#include "web/api/vehicle_trails.h"
#include "web/server/api.h"
#include "web/server/connection.h"
#include "web/server/http_server.h"

namespace livemap::web {

namespace {

std::optional<std::int64_t> CertificateEnd(const std::optional<CertificateState>& certificate) {
  return certificate ? std::optional(certificate->ends_ns) : std::nullopt;
}

}  // namespace

class WebServer::Implementation {
 public:
  Implementation(const Options& options, zone::ZoneService& zone,
                 const protocol::HazardCatalogue& catalogue, orders::OrderDesk* orders,
                 const NeighbourReader* neighbours)
      : hub_(zone, catalogue, trails_),
        api_(options, zone, catalogue, trails_, orders, neighbours),
        live_{zone, catalogue, hub_},
        server_(options, api_, &live_) {
    api_.TellServer([this] {
      const HttpServer::Counters counted = server_.counters();
      return ServerMetrics{server_.connections(),
                           counted.connections_ended,
                           counted.connections_refused,
                           counted.held_bytes,
                           counted.failed_handshakes,
                           CertificateEnd(server_.certificate()),
                           {}};
    });
  }

  ~Implementation() {
    api_.TellServer({});
    hub_.Stop();  // The zone's threads must not call sessions that go away with the server.
    api_.Stop();  // Neither must what makes pictures.
  }

  const HttpServer& server() const { return server_; }
  const Api& api() const { return api_; }

 private:
  VehicleTrails trails_;
  EventHub hub_;
  Api api_;
  const LiveSource live_;
  HttpServer server_;  // Last: its sessions use all above it.
};

WebServer::WebServer(const Options& options, zone::ZoneService& zone,
                     const protocol::HazardCatalogue& catalogue, orders::OrderDesk* orders,
                     const NeighbourReader* neighbours) {
  Validate(options);
  implementation_ = std::make_unique<Implementation>(options, zone, catalogue, orders, neighbours);
}

WebServer::~WebServer() = default;

int WebServer::port() const { return implementation_->server().port(); }

WebServer::Counters WebServer::counters() const {
  const HttpServer::Counters of_server = implementation_->server().counters();
  return {of_server.connections_ended, of_server.connections_refused, of_server.held_bytes,
          of_server.failed_handshakes, implementation_->api().picture_counters()};
}

std::optional<CertificateState> WebServer::certificate() const {
  return implementation_->server().certificate();
}

std::size_t WebServer::connections() const { return implementation_->server().connections(); }

}  // namespace livemap::web
