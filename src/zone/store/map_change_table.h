#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "zone/store/store_connection.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// The tables `map_changes`, `map_change_reports` and `map_change_events`: map changes as they are
/// now, what vehicles said of them, and their history.
class MapChangeTable {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit MapChangeTable(StoreConnection& connection);
  MapChangeTable(const MapChangeTable&) = delete;
  MapChangeTable& operator=(const MapChangeTable&) = delete;

  /// See the functions of ZoneStore that have "MapChange" in their names besides.
  StoreDamage Load(const std::function<void(ZoneStore::MapChangeRow)>& take);
  std::uint64_t LastId();
  std::optional<ZoneStore::KnownMapChangeReport> FindReport(const Uuid& report_uuid);
  std::vector<StoredMapChangeEvent> LoadEvents(std::uint64_t sequence, std::size_t limit);
  void Write(const ZoneStore::MapChangeRow& change);
  void Drop(std::uint64_t id);
  void WriteReport(const protocol::MapChangeReport& report, const Uuid& change,
                   std::int64_t received_ns);
  void WriteEvent(const MapChangeEvent& event, std::uint64_t id);

 private:
  /// SOCI binds to places, not to values.
  struct Row {
    std::string uuid, change_uuid, class_name, vehicle_id, drive_id, reason, witnesses;
    double confidence = 0, latitude = 0, longitude = 0;
    double covariance_ee = 0, covariance_en = 0, covariance_nn = 0;
    long long id = 0, reports = 0, drives = 0, first_seen_ns = 0, last_seen_ns = 0, denied_ns = 0;
    long long updated_ns = 0, sequence = 0, previous_sequence = 0;
    long long stamp_ns = 0, earlier_stamp_ns = 0, received_ns = 0, seen = 0, missed = 0;
    int vanished = 0, state = 0, vehicles = 0, from_state = 0;
    soci::indicator has_from = soci::i_ok;
  };

  /// Throws Error for a row of impossible values.
  static ZoneStore::MapChangeRow ToMapChange(const Row& row);
  void PutPlace(const geo::GeoPoint& position, const Eigen::Matrix2d& covariance_m2);

  StoreConnection& connection_;
  Row row_;
  soci::statement find_report_;
  soci::statement find_event_;
  WriteStatement write_;
  WriteStatement write_report_;
  WriteStatement write_event_;
  WriteStatement drop_;
  WriteStatement drop_events_;
};

}  // namespace livemap::zone
