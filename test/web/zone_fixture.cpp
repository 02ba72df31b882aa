#include "test/web/zone_fixture.h"

#include <sys/stat.h>

#include <fstream>
#include <utility>

#include "geo/wgs84.h"

namespace livemap::web {

TokenFile::TokenFile() {
  std::ofstream(path()) << official() << " " << token() << "\n"
                        << region() << " " << region_token() << " speaks-for-others\n";
  if (chmod(path().c_str(), 0600) != 0) throw Error("chmod failed for '" + path() + "'");
}

std::vector<std::uint8_t> OnePixelPng() {
  return {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
          0x44, 0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00, 0x00,
          0x00, 0x3a, 0x7e, 0x9b, 0x55, 0x00, 0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78,
          0xda, 0x63, 0xf8, 0x0f, 0x00, 0x01, 0x01, 0x01, 0x00, 0x1c, 0xb0, 0x8c, 0x99, 0x00,
          0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
}

ZoneFixture::ZoneFixture(std::shared_ptr<const streets::StreetMap> streets,
                         const std::string& directory, const std::string& store_url)
    : directory_(directory.empty() ? folder_.path() : directory),
      // A store that stays knows the identifiers of an earlier run.
      generator_(directory.empty() ? 7 : std::random_device{}()) {
  catalogue = protocol::HazardCatalogue::Load(LIVEMAP_SOURCE_DIR "/config/hazards.yaml");
  zone::ZoneService::Config config;
  config.speed.max_speed_mps = 1e9;  // Reports of one vehicle lie all over the town.
  config.allowance.reports_per_hour = 1e9;
  config.map_changes_per_hour = 1e9;
  config.max_hazards_by_one_vehicle = 1'000'000;
  config.directory = directory_;
  config.store_url = store_url;
  config.catalogue = catalogue;
  config.streets = std::move(streets);
  zone = std::make_unique<zone::ZoneService>(
      config, [this] { return now_ns.load(); }, 1);
}

protocol::Report ZoneFixture::MakeReport(const std::string& class_name,
                                         const geo::GeoPoint& position) {
  protocol::Report report;
  report.uuid = Uuid::Random(generator_);
  report.vehicle_id = "car-1";
  report.drive_id = "drive-1";
  report.stamp_ns = now_ns;
  report.class_name = class_name;
  report.confidence = 0.87F;
  report.box = {100, 120, 180, 160};
  report.position = position;
  report.covariance_m2 << 4, 0, 0, 1;
  report.image_width = 640;
  report.image_height = 480;
  return report;
}

protocol::MapChangeReport ZoneFixture::MakeMapChange(const std::string& class_name,
                                                     const geo::GeoPoint& position) {
  protocol::MapChangeReport report;
  report.uuid = Uuid::Random(generator_);
  report.vehicle_id = "car-1";
  report.drive_id = "drive-1";
  report.stamp_ns = now_ns;
  report.earlier_stamp_ns = now_ns - 86'400'000'000'000;
  report.class_name = class_name;
  report.confidence = 0.8F;
  report.seen = 6;
  report.missed = 1;
  report.position = position;
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  return report;
}

void ZoneFixture::AddRow(const std::string& class_name, const geo::GeoPoint& start,
                         std::size_t count) {
  std::vector<protocol::Report> reports;
  reports.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double step_deg = 0.00018 * static_cast<double>(i);
    reports.push_back(MakeReport(class_name, {start.latitude_deg + step_deg, start.longitude_deg}));
  }
  zone->HandleBatch(reports);
}

WebConfig TestOptions() {
  WebConfig options;
  options.port = 0;
  options.web_root = LIVEMAP_SOURCE_DIR "/web";
  return options;
}

}  // namespace livemap::web
