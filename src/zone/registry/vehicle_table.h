#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "zone/model/vehicle_state.h"
#include "zone/registry/vehicle_track.h"

namespace livemap::zone {

/// Where the vehicles were last: bounded in time and number. Thread-safe.
class VehicleTable {
 public:
  VehicleTable(double retention_s, std::size_t max_vehicles);

  /// Readers are told of one vehicle's positions no more often than this.
  static constexpr std::int64_t kTellNs = 250'000'000;

  /// `vehicle.heard_ns` is now. Whether readers are to be told of it now; else TakeUntold gives it,
  /// or a newer one, as soon as it is time.
  bool Update(const VehicleState& vehicle);
  /// Vehicles of whose newest position readers were not told, and are told now.
  std::vector<VehicleState> TakeUntold(std::int64_t now_ns);
  /// Those heard of within the retention time, by id.
  std::vector<VehicleState> List(std::int64_t now_ns) const;
  /// The first `limit` of those whose id comes after `id`.
  std::vector<VehicleState> ListAfter(const std::string& id, std::size_t limit,
                                      std::int64_t now_ns) const;
  /// How old the outboxes are of the vehicles that say so and were heard within `within_s`, s, in
  /// rising order.
  std::vector<double> OutboxAges(std::int64_t now_ns, double within_s) const;
  void Forget(const std::string& vehicle_id);
  /// Where the vehicle was during the last two minutes, by when the zone heard it, oldest first, at
  /// most the newest 240 places.
  std::vector<TrackPoint> Track(const std::string& vehicle_id) const;

 private:
  void MakeRoom(std::int64_t now_ns) REQUIRES(mutex_);

  const std::int64_t retention_ns_;
  const std::size_t max_vehicles_;
  mutable Mutex mutex_;
  struct Vehicle {
    VehicleState state;
    std::deque<TrackPoint> track;
    std::int64_t told_ns = INT64_MIN;  ///< When readers were told, zone clock.
    bool is_untold = false;            ///< Of `state`.

    /// Whether it is time to tell readers; then they are told.
    bool Tell(std::int64_t now_ns);
  };
  std::map<std::string, Vehicle> vehicles_ GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
