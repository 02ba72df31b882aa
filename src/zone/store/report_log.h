#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "zone/store/store_connection.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// The tables `reports` and `answers`: all that vehicles said of hazards.
class ReportLog {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit ReportLog(StoreConnection& connection);
  ReportLog(const ReportLog&) = delete;
  ReportLog& operator=(const ReportLog&) = delete;

  /// See the functions of ZoneStore with these names.
  std::vector<std::optional<ZoneStore::KnownReport>> FindReports(const std::vector<Uuid>& reports);
  void WriteReport(const protocol::Report& report, std::uint64_t hazard_id,
                   const std::string& image_sha256, std::int64_t received_ns);
  void WriteAnswer(const protocol::PollAnswer& answer, std::uint64_t hazard_id,
                   std::int64_t received_ns);

 private:
  /// SOCI binds to places, not to values.
  struct Row {
    std::string asked, uuid, hazard_uuid, vehicle_id, drive_id, image_sha256, reason;
    double confidence = 0, latitude = 0, longitude = 0;
    double covariance_ee = 0, covariance_en = 0, covariance_nn = 0;
    double box_left = 0, box_top = 0, box_right = 0, box_bottom = 0;
    long long number = 0, hazard_id = 0, stamp_ns = 0, received_ns = 0;
    int answer = 0;
  };

  void WriteBox(const protocol::Report& report);

  StoreConnection& connection_;
  Row row_;
  soci::statement find_reports_;
  WriteStatement write_report_;
  WriteStatement write_box_;
  WriteStatement write_answer_;
};

}  // namespace livemap::zone
