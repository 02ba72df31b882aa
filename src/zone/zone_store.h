#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "hazard/report.h"
#include "zone/hazard.h"

namespace livemap {

/// The zone's database: hazards as they are, every accepted report, every event. SQLite in WAL mode
/// with synchronous=FULL, through SOCI. Not thread-safe: one writer owns it.
///
/// Every function throws StoreError with the database's own words when it fails.
class ZoneStore {
 public:
  /// Opens or makes the database file and brings its schema up to date. Refuses files that are
  /// damaged, no database at all, or of a newer schema than this program knows.
  explicit ZoneStore(const std::string& path);
  ~ZoneStore();
  ZoneStore(const ZoneStore&) = delete;
  ZoneStore& operator=(const ZoneStore&) = delete;

  /// Every hazard, in ascending order of sequence.
  void LoadHazards(const std::function<void(Hazard)>& take);
  /// Of the newest event; 0 without events.
  std::uint64_t LastSequence();
  struct KnownReport {
    Uuid hazard;  ///< What it became or was merged into.
    std::string vehicle_id;
  };
  /// A committed report.
  std::optional<KnownReport> FindReport(const Uuid& report_uuid);

  /// Writes happen between Begin and Commit; Commit returns when they are on disk.
  void Begin();
  void Commit();
  /// Never throws: after a full disk the database may have rolled back by itself.
  void Rollback() noexcept;

  /// Adds the hazard, or replaces the row of the same uuid.
  void WriteHazard(const Hazard& hazard);
  void WriteReport(const Report& report, const Uuid& hazard_uuid, const std::string& image_sha256,
                   std::int64_t received_ns);
  void WriteEvent(const HazardEvent& event, const std::string& reason);

  /// The schema that this program writes.
  static int SchemaVersion();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap
