#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/sqlite.h"
#include "protocol/map_change_report.h"
#include "protocol/report.h"
#include "vehicle/outbox/resend_schedule.h"
#include "vehicle/outbox/zone_finder.h"

namespace livemap::vehicle {

/// What the vehicle has to tell the zone of objects that came or went: on disk until the zone has
/// answered, sent again until then. Not thread-safe.
class MapChangeOutbox {
 public:
  struct Config {
    std::string path;  ///< SQLite; made when missing.
    /// Id of the configured zone, as for LocalHazardMap. Empty: there is one zone only.
    std::string zone;
    std::size_t most = 1000;  ///< Unanswered reports; beyond it the oldest go, and are counted.
    ResendSchedule::Config resend;
  };

  struct Counters {
    std::uint64_t added = 0;
    std::uint64_t displaced = 0;  ///< By newer ones.
    std::uint64_t sent = 0;       ///< For the first time since the start.
    std::uint64_t resends = 0;
    std::uint64_t committed = 0;
    std::uint64_t refused = 0;
    std::uint64_t unsound = 0;  ///< Rows that the program cannot have written: never sent.
  };

  /// Opens or creates the store. A corrupt file is renamed to `<path>.corrupt-<now_ns>`: what the
  /// next drive sees is told again. `steady_s` as for TakeDue. Throws StoreError.
  MapChangeOutbox(const Config& config, std::mt19937_64 random, std::int64_t now_ns,
                  double steady_s);

  /// The new name of a file that was corrupt, empty when it was not.
  const std::string& set_aside() const { return set_aside_; }

  /// As for HazardReporter.
  void SetZones(ZoneFinder zones) { zones_ = std::move(zones); }

  /// Durable when it returns. Throws StoreError, and Error for a report that no zone would take.
  void Add(const protocol::MapChangeReport& report, double steady_s);
  /// Reports that are to be sent now; steady seconds from any origin. They stay until answered.
  /// Throws StoreError when one whose zone is gone cannot be given to another zone.
  std::vector<protocol::MapChangeReport> TakeDue(double steady_s, std::size_t limit);
  /// The zone's answer ends its report; one of another report, or of another zone than the
  /// report's, is ignored. Throws StoreError.
  void AddReceipt(const protocol::Receipt& receipt);

  std::size_t pending() const { return pending_.size(); }
  const Counters& counters() const { return counters_; }

 private:
  std::string ZoneOf(const std::string& named) const;
  void Load(double steady_s);
  void Redirect(protocol::MapChangeReport& report);
  void Erase(const Uuid& uuid);
  void Displace();

  Config config_;
  ZoneFinder zones_;
  std::unique_ptr<SqliteDatabase> database_;
  std::string set_aside_;
  std::map<Uuid, protocol::MapChangeReport> pending_;
  ResendSchedule schedule_;
  Counters counters_;
};

/// Whether a vehicle can have made this report: a version 4 uuid, ids of at most 64 bytes, finite
/// numbers within their ranges, a covariance that is one. Its zone is for the outbox to know.
bool IsSound(const protocol::MapChangeReport& report);

}  // namespace livemap::vehicle
