#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/sqlite.h"
#include "hazard/catalogue.h"
#include "hazard/report.h"
#include "zone/hazard.h"
#include "zone/report_validation.h"

namespace livemap {

/// Where a vehicle was last. Never handed to other vehicles.
struct VehicleState {
  std::string vehicle_id;
  std::string drive_id;
  GeoPoint position;
  double course_rad = 0;  ///< Clockwise from true north; NaN when standing.
  double speed_mps = 0;
  std::int64_t stamp_ns = 0;  ///< Of the fix, vehicle clock (UTC).
  std::int64_t heard_ns = 0;  ///< Zone clock (UTC), set by UpdateVehicle.
};

/// One message of the zone's stream: exactly one of the two is set.
struct ZoneEvent {
  std::optional<HazardEvent> hazard;
  std::optional<VehicleState> vehicle;
};

/// What became of the reports and vehicle positions since start.
struct ZoneStatistics {
  std::uint64_t added = 0;     ///< Reports that became a new hazard.
  std::uint64_t merged = 0;    ///< Reports counted as a sighting of a known hazard.
  std::uint64_t repeated = 0;  ///< Reports whose uuid was committed before.
  std::uint64_t refused = 0;
  std::uint64_t vehicle_positions = 0;
  std::uint64_t vehicle_positions_refused = 0;
  std::size_t active_hazards = 0;
  std::uint64_t image_bytes = 0;  ///< On disk.
};

/// The zone's state behind one thread-safe door: registry, store, pictures, vehicles, event stream.
///
/// Promises: a COMMITTED receipt is returned only after the report, its hazard and its event are in
/// the database with synchronous=FULL; a report's uuid counts once, also across restarts; a reader
/// never sees what is not committed; events reach subscribers after their commit, in the order of
/// their sequence.
class ZoneService {
 public:
  struct Config {
    std::string directory;              ///< Holds zone.sqlite3 and images/; made when missing.
    double image_cap_bytes = 2e9;       ///< Pictures on disk; the oldest go beyond it.
    double vehicle_retention_s = 600;   ///< A vehicle not heard of for this long is forgotten.
    std::size_t max_vehicles = 10000;   ///< The longest silent one goes beyond it.
    std::size_t max_hazards = 5000000;  ///< New hazards beyond it are refused.
    ReportLimits limits;
    HazardCatalogue catalogue;
  };
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.
  using Subscriber = std::function<void(const ZoneEvent&)>;

  /// Opens or makes the store and loads it. `uuid_seed` seeds the ids of new hazards: a test gives
  /// a number, a node gives entropy. Throws Error for a bad setting, StoreError for a store that
  /// cannot be used: not writable, corrupt, or of a newer schema.
  ZoneService(Config config, Clock now_ns, std::uint64_t uuid_seed);
  ~ZoneService();
  ZoneService(const ZoneService&) = delete;
  ZoneService& operator=(const ZoneService&) = delete;

  /// Validates, registers or merges, commits; idempotent by uuid. Throws StoreError when the store
  /// fails: then nothing of the report counts, and the vehicle sends it again.
  Receipt Handle(const Report& report);
  /// The same for many in one transaction, in order; one receipt per report. All or nothing when
  /// the store fails.
  std::vector<Receipt> HandleBatch(const std::vector<Report>& reports);

  /// Hazards whose last event is newer than `since_sequence`, in the order of that sequence, at
  /// most `limit`. Active ones; removed ones too when `since_sequence` > 0, so that a view catches
  /// up after a gap.
  std::vector<Hazard> Query(const std::optional<GeoBox>& box, std::uint64_t since_sequence,
                            std::size_t limit) const;
  /// Active hazards within `radius_m` of `centre`, nearest first, at most `limit`.
  std::vector<Hazard> QueryNear(const GeoPoint& centre, double radius_m, std::size_t limit) const;
  /// Also a removed one.
  std::optional<Hazard> Find(const Uuid& uuid) const;
  /// Takes an active hazard off the map and commits the event with its reason (at most 200 bytes
  /// are kept). False when there is no active hazard of that uuid.
  bool Remove(const Uuid& uuid, const std::string& reason);

  /// File of a stored picture; only 64 lower-case hex digits name one.
  std::optional<std::string> ImagePath(const std::string& sha256) const;

  /// Remembers where a vehicle is and tells subscribers. False, and counted, when the position or
  /// the ids are not acceptable.
  bool UpdateVehicle(const VehicleState& vehicle);
  /// Vehicles heard of within the retention time, by id.
  std::vector<VehicleState> Vehicles() const;

  /// `subscriber` is called from whichever thread commits, one call at a time. It may read from
  /// this service but must neither write to it nor (un)subscribe.
  int Subscribe(Subscriber subscriber);
  /// When this returns the subscriber is not running and will not be called again.
  void Unsubscribe(int id);

  /// Of the newest event; 0 when nothing ever happened.
  std::uint64_t Sequence() const;
  ZoneStatistics Statistics() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap
