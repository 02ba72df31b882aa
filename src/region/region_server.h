#pragma once

#include <memory>

#include "protocol/hazard_catalogue.h"
#include "region/region.h"
#include "web/http/web_config.h"

namespace livemap::region {

/// The web server of a region: the live map's page, the hazards of all zones, the open feeds, the
/// live stream, and how the zones are (docs/reference/http-api.md). Whoever reaches it sees what
/// drivers are told of. Where the options name accounts, officials who log in decide by way of the
/// zones; else nobody can change anything.
class RegionServer {
 public:
  /// Listens and serves from its own threads when it returns. Keeps references. Of the options
  /// those about tokens, who sees what, and pictures count for nothing. Throws Error when an option
  /// is not accepted or the port cannot be opened.
  RegionServer(const web::WebConfig& options, Region& region,
               const protocol::HazardCatalogue& catalogue);
  /// Closes every connection and joins the threads.
  ~RegionServer();
  RegionServer(const RegionServer&) = delete;
  RegionServer& operator=(const RegionServer&) = delete;

  /// The port it listens on, also where the options asked for any.
  int port() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap::region
