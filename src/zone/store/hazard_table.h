#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "zone/store/store_connection.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// The table `hazards`: each hazard as it is now, with its presence record.
class HazardTable {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit HazardTable(StoreConnection& connection);
  HazardTable(const HazardTable&) = delete;
  HazardTable& operator=(const HazardTable&) = delete;

  /// See ZoneStore::LoadHazards, LoadCourses, LoadTrails, LastHazardId, WriteHazard, WriteCourse
  /// and WriteTrails.
  StoreDamage Load(const std::function<void(ZoneStore::HazardRow)>& take);
  StoreDamage LoadCourses(const std::function<void(std::uint64_t, double)>& take);
  StoreDamage LoadTrails(
      const std::function<void(std::uint64_t, std::vector<protocol::Trail>)>& take);
  std::uint64_t LastId();
  void Write(const ZoneStore::HazardRow& hazard);
  void WriteClass(std::uint64_t hazard_id, const std::string& class_name);
  void WriteCourse(std::uint64_t hazard_id, double course_rad);
  void WriteTrails(std::uint64_t hazard_id, const std::vector<protocol::Trail>& trails);

 private:
  /// SOCI binds to places, not to values.
  struct Row {
    std::string uuid, class_name, image_sha256, image_format, life, trails;
    double confidence = 0, latitude = 0, longitude = 0, presence = 0;
    double covariance_ee = 0, covariance_en = 0, covariance_nn = 0, course_rad = 0;
    long long id = 0, sightings = 0, first_seen_ns = 0, last_seen_ns = 0, updated_ns = 0;
    long long sequence = 0, announced_sequence = 0;
    int state = 0, vehicles = 0;
  };

  /// Throws Error for a row of impossible values.
  static ZoneStore::HazardRow ToHazard(const Row& row);
  std::map<long long, std::vector<VehicleEvidence>> VoicesOfReports();

  StoreConnection& connection_;
  Row row_;
  WriteStatement write_;
  WriteStatement write_course_;
  WriteStatement write_trails_;
};

}  // namespace livemap::zone
