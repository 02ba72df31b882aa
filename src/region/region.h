#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/clock.h"
#include "common/mutex.h"
#include "protocol/hazard_catalogue.h"
#include "region/region_map.h"
#include "region/region_store.h"
#include "region/zone_follower.h"

namespace livemap::region {

/// Follows the zones of a region from threads of its own, and has their hazards as one map.
///
/// Typical usage:
///   Region region(config, catalogue, SystemNs, [](const std::string& line) { Print(line); });
///   RegionServer server(web_config, region, catalogue);
class Region {
 public:
  struct Config {
    std::vector<RegionZone> zones;  ///< At least one, each id once.
    std::string directory;          ///< Folder of the region's store; it is made where it is not.
    std::string ca_file;            ///< Certificates that are trusted; empty: the system's.
    double ask_every_s = 2;         ///< A zone that is up is asked so often, 0.1 to 3600.
    double longest_pause_s = 30;    ///< One that is down after ever longer pauses, up to this.
    double timeout_s = 10;          ///< For one answer.
    std::size_t threads = 8;        ///< So many zones are asked at the same time, 1 to 64.
  };
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.
  /// Takes one line for the log; any thread.
  using Log = std::function<void(const std::string& line)>;

  /// Puts the last state of all zones on the map, and begins to ask them. Keeps a reference to
  /// `catalogue`. Throws Error naming what is not accepted, StoreError for a store that cannot be
  /// used.
  Region(Config config, const protocol::HazardCatalogue& catalogue, Clock now_ns, Log log);
  /// Cuts off what is being asked, and joins the threads.
  ~Region();
  Region(const Region&) = delete;
  Region& operator=(const Region&) = delete;

  /// What is read.
  RegionMap& map() { return *map_; }
  const RegionMap& map() const { return *map_; }
  std::int64_t NowNs() const { return now_ns_(); }

  const Config& config() const { return config_; }
  std::size_t zones() const { return followed_.size(); }
  const RegionZone& zone(std::size_t index) const { return followed_[index]->follower->zone(); }
  ZoneStatus status(std::size_t index) const { return followed_[index]->follower->status(); }
  /// Whether the store kept the newest answer.
  bool IsStoreWell() const { return store_well_; }
  /// Whether every zone has been asked since the start.
  bool HasAskedAll() const { return unasked_ == 0; }

 private:
  struct Followed {
    std::unique_ptr<orders::NetworkClient> client;
    std::unique_ptr<ZoneFollower> follower;
    double pause_s = 0;  ///< After the newest question, which was in vain; 0: it was not.
    bool was_asked = false;
    bool was_up = false;
    std::uint64_t refused = 0;  ///< Hazards that the log has been told of.
  };
  struct Due {
    std::int64_t at_ns;  ///< Steady.
    std::size_t zone;
  };

  void Work();
  /// Asks the zone and returns how long it may be left alone, s.
  double Ask(Followed& followed);
  void TellNews(Followed& followed);

  const Config config_;
  const Clock now_ns_;
  const Log log_;
  std::unique_ptr<RegionStore> store_;
  std::unique_ptr<RegionMap> map_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> store_well_{true};
  std::atomic<std::size_t> unasked_{0};
  std::vector<std::unique_ptr<Followed>> followed_;
  Mutex mutex_;
  ConditionVariable changed_;
  std::vector<Due> due_ GUARDED_BY(mutex_);  ///< A heap, the next one first.
  std::vector<std::thread> threads_;
};

/// The part of the earth where the areas of these zones are; none where none is known. West is
/// greater than east where it crosses 180 degrees.
std::optional<geo::GeoBox> BoundsOf(const std::vector<RegionZone>& zones);

}  // namespace livemap::region
