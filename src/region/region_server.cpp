#include "region/region_server.h"

#include "region/region_site.h"
#include "web/api/event_hub.h"
#include "web/api/vehicle_trails.h"
#include "web/server/connection.h"
#include "web/server/http_server.h"

namespace livemap::region {

namespace {

/// Whoever waits for a zone waits as long as the region does, and a moment.
web::WebConfig WithPatience(web::WebConfig options, const Region& region) {
  constexpr double kMomentS = 2;
  options.picture_timeout_s = region.config().timeout_s + kMomentS;
  return options;
}

}  // namespace

class RegionServer::Implementation {
 public:
  Implementation(const web::WebConfig& options, Region& region,
                 const protocol::HazardCatalogue& catalogue)
      : hub_(region.map(), catalogue, trails_),
        site_(options, region, catalogue),
        live_{region.map(), catalogue, hub_},
        server_(WithPatience(options, region), site_, &live_) {}
  /// The region's threads must not call sessions that go away with the server.
  ~Implementation() {
    hub_.Stop();
    site_.Stop();
  }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  int port() const { return server_.port(); }

 private:
  web::VehicleTrails trails_;  // Stays empty.
  web::EventHub hub_;
  RegionSite site_;
  const web::LiveSource live_;
  web::HttpServer server_;  // Last: its sessions use all above it.
};

RegionServer::RegionServer(const web::WebConfig& options, Region& region,
                           const protocol::HazardCatalogue& catalogue) {
  web::Validate(options);
  implementation_ = std::make_unique<Implementation>(options, region, catalogue);
}

RegionServer::~RegionServer() = default;

int RegionServer::port() const { return implementation_->port(); }

}  // namespace livemap::region
