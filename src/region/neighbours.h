#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "directory/directory_file.h"
#include "protocol/duplicate_filter.h"
#include "protocol/hazard_catalogue.h"
#include "region/region.h"
#include "web/api/neighbour_api.h"
#include "zone/service/zone_service.h"

namespace livemap::region {

/// Follows the zones around one zone, so that its map shows what lies right behind its borders, and
/// a hazard on a border once. Which zones those are stands in the authority's signed directory.
/// Each zone shows its own hazard and leaves out the other's, by the rule of vehicles and regions
/// (protocol::CrossZoneDuplicates): the same class within the class's duplicate radius.
///
/// Typical usage:
///   Neighbours neighbours(config, zone, catalogue, SystemNs, log);
///   WebServer server(options, zone, catalogue, orders, &neighbours);
///   neighbours.Renew();  // Now and then.
class Neighbours : public web::NeighbourReader {
 public:
  /// Of more hazards than this the oldest are left out.
  static constexpr std::size_t kMaxHazards = 2000;

  struct Config {
    std::string zone;        ///< Its id in the directory.
    std::string directory;   ///< File of the signed directory; it may come later.
    std::string authority;   ///< PEM file of the authority's certificate.
    std::string store;       ///< Folder of the last states; it is made where it is not.
    std::string ca_file;     ///< Certificates that are trusted for https; empty: the system's.
    double margin_m = 500;   ///< What lies so near the own area is followed, 0 to 20 000.
    double ask_every_s = 2;  ///< 0.1 to 3600.
  };

  /// Keeps references to `zone` and `catalogue`. Follows nobody while the directory cannot be read,
  /// has expired or does not name the zone. `log` is called by any thread. Throws Error naming what
  /// is not accepted; that the last states cannot be kept now is told to `log`.
  Neighbours(Config config, const zone::ZoneService& zone,
             const protocol::HazardCatalogue& catalogue, Region::Clock now_ns, Region::Log log);

  /// Reads the directory's file if it has changed, and then follows the zones that it names now.
  /// Called by one thread at a time. Throws Error when the last states cannot be kept, and tries
  /// again at the next call.
  void Renew();

  /// As they were a second ago at most.
  std::vector<web::NeighbourHazard> Hazards() const override;
  /// Ids of the zones that are followed.
  std::vector<std::string> zones() const;

 private:
  std::vector<RegionZone> ZonesAround(const directory::ZoneDirectory& directory) const;
  std::vector<web::NeighbourHazard> Read() const REQUIRES_SHARED(mutex_);
  /// What drivers know and this zone holds where one of these `hazards` may be the same.
  protocol::DuplicateFilter OwnAround(const std::deque<zone::Hazard>& hazards) const;

  const Config config_;
  const zone::ZoneService& zone_;
  const protocol::HazardCatalogue& catalogue_;
  const Region::Clock now_ns_;
  const Region::Log log_;
  directory::DirectoryFile file_;
  /// Whose zones are followed; null: there was none that is valid.
  std::shared_ptr<const directory::ZoneDirectory> directory_;

  mutable SharedMutex mutex_;
  std::unique_ptr<Region> region_ GUARDED_BY(mutex_);  ///< Null: nobody is followed.

  /// Makes the list; whoever asks meanwhile waits and has the same.
  mutable Mutex list_mutex_ ACQUIRED_BEFORE(mutex_);
  mutable std::vector<web::NeighbourHazard> list_ GUARDED_BY(list_mutex_);
  mutable std::optional<std::int64_t> list_ns_ GUARDED_BY(list_mutex_);  ///< Steady.
};

}  // namespace livemap::region
