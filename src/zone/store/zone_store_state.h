#pragma once

#include <soci/soci.h>

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/sqlite.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// What stands behind ZoneStore; only its own sources include this.
class ZoneStore::Implementation {
 public:
  explicit Implementation(const std::string& path);

  void Prepare();
  void PrepareReads();
  void PrepareWrites();
  void PrepareMapChangeReads();
  void PrepareMapChangeWrites();

  /// The values of all statements: SOCI binds to places, not to values.
  struct Row {
    std::string uuid, class_name, vehicle_id, drive_id, image_sha256, image_format, reason, life,
        vouchers;
    double confidence = 0, latitude = 0, longitude = 0, presence = 0, sigma_m = 0;
    double covariance_ee = 0, covariance_en = 0, covariance_nn = 0, ended = 0, stood_s = 0,
           suspicion = 0;
    long long id = 0, sightings = 0, first_seen_ns = 0, last_seen_ns = 0, updated_ns = 0;
    long long sequence = 0, announced_sequence = 0, previous_sequence = 0;
    long long stamp_ns = 0, received_ns = 0, vehicle_key = 0;
    int state = 0, vehicles = 0, action = 0, from_state = 0, announced = 0, answer = 0;
    soci::indicator has_from = soci::i_ok;
  };
  /// The same for map changes.
  struct ChangeRow {
    std::string uuid, change_uuid, class_name, vehicle_id, drive_id, reason, witnesses;
    double confidence = 0, latitude = 0, longitude = 0;
    double covariance_ee = 0, covariance_en = 0, covariance_nn = 0;
    long long id = 0, reports = 0, drives = 0, first_seen_ns = 0, last_seen_ns = 0, denied_ns = 0;
    long long updated_ns = 0, sequence = 0, previous_sequence = 0;
    long long stamp_ns = 0, earlier_stamp_ns = 0, received_ns = 0, seen = 0, missed = 0;
    int vanished = 0, state = 0, vehicles = 0, from_state = 0;
    soci::indicator has_from = soci::i_ok;
  };
  /// Throw Error for a row of impossible values.
  static MapChangeRow ToMapChange(const ChangeRow& row);
  static HazardRow ToHazard(const Row& row);
  std::map<long long, std::vector<VehicleEvidence>> VoicesOfReports();
  /// Calls `take_row` for every row of a prepared query; what it throws as Error is told. The
  /// query finds those rows of `table` only whose values are of the right type and size.
  StoreDamage LoadRows(const std::string& table, soci::statement& query,
                       const std::function<void()>& take_row);

  /// Declared before the statements, which must go first.
  std::string path_;
  soci::session session_;
  Row row_;
  ChangeRow change_row_;
  std::optional<soci::statement> find_report_;
  std::optional<soci::statement> find_last_report_;
  std::optional<soci::statement> find_event_;
  std::optional<soci::statement> write_hazard_;
  std::optional<soci::statement> write_report_;
  std::optional<soci::statement> write_event_;
  std::optional<soci::statement> write_answer_;
  std::optional<soci::statement> write_life_;
  std::optional<soci::statement> write_trust_;
  std::optional<soci::statement> write_last_report_;
  std::optional<soci::statement> find_map_change_report_;
  std::optional<soci::statement> find_map_change_event_;
  std::optional<soci::statement> write_map_change_;
  std::optional<soci::statement> write_map_change_report_;
  std::optional<soci::statement> write_map_change_event_;
  std::optional<soci::statement> drop_map_change_;
  std::optional<soci::statement> drop_map_change_events_;
};

/// Runs `body` and turns the library's exceptions into the project's.
template <typename Body>
auto ExplainStore(const std::string& doing, const Body& body) -> decltype(body()) {
  try {
    return body();
  } catch (const soci::soci_error& error) {
    throw StoreError("store: " + doing + " failed: " + error.get_error_message());
  }
}

}  // namespace livemap::zone
