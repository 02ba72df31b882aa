#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "protocol/map_change_report.h"
#include "protocol/report.h"
#include "test/zone/postgresql_server.h"
#include "test/zone/store_probe.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;
constexpr std::int64_t kOneSecond = 1'000'000'000;
constexpr std::int64_t kOneHour = 3600 * kOneSecond;
constexpr std::int64_t kOneDay = 24 * kOneHour;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// What schemas 2 to 4 have in place of `places`: the newest place of each vehicle.
constexpr char kLastReportsTable[] =
    "CREATE TABLE last_reports (vehicle_id TEXT PRIMARY KEY, stamp_ns BIGINT NOT NULL, "
    "latitude DOUBLE PRECISION NOT NULL, longitude DOUBLE PRECISION NOT NULL, "
    "sigma_m DOUBLE PRECISION NOT NULL);";

/// Whether the tests of this process keep their stores in PostgreSQL: LIVEMAP_TEST_STORE, which
/// ctest sets to "postgresql" for a second run of the same tests.
inline bool IsOnPostgresql() {
  const char* store = std::getenv("LIVEMAP_TEST_STORE");
  return store != nullptr && std::string(store) == "postgresql";
}

/// The server of this process.
inline test::PostgresqlServer& TestServer() {
  static test::PostgresqlServer server;
  return server;
}

/// A directory, and a database where that is not a file in it, of its own for each test, removed
/// afterwards.
class ZoneTest : public testing::Test {
 protected:
  ZoneTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "livemap_zone_XXXXXX").string();
    directory_ = mkdtemp(pattern.data());
    if (IsOnPostgresql() && test::PostgresqlServer::IsInstalled()) {
      store_url_ = TestServer().MakeDatabase();
    }
  }
  ~ZoneTest() override {
    std::filesystem::remove_all(directory_);
    if (!store_url_.empty()) TestServer().TakeBack(store_url_);
  }
  void SetUp() override {
    if (IsOnPostgresql() && store_url_.empty()) {
      GTEST_SKIP() << "skipped, no PostgreSQL server installed";
    }
  }
  /// A store without a row.
  void EmptyStore() {
    std::filesystem::remove_all(directory_ + "/zone");
    if (store_url_.empty()) return;
    TestServer().TakeBack(store_url_);
    store_url_ = TestServer().MakeDatabase();
  }

  ZoneService::Config Config() const {
    ZoneService::Config config;
    config.directory = directory_ + "/zone";
    config.store_url = store_url_;
    // Reports of one vehicle lie all over the Earth.
    config.speed.max_speed_mps = 1e9;
    config.catalogue = OneVehicleSuffices();
    return config;
  }
  /// Drivers are told at once: most tests are not about confirmation.
  static protocol::HazardCatalogue OneVehicleSuffices() {
    return protocol::HazardCatalogue::Parse("defaults: {confirmations: 1}\nclasses: {}\n", "test");
  }
  /// Of SQLite.
  std::string DatabasePath() const { return directory_ + "/zone/zone.sqlite3"; }
  /// As ZoneStore takes it.
  std::string Database() const { return store_url_.empty() ? DatabasePath() : store_url_; }
  StoreProbe Probe() const { return StoreProbe(Database()); }
  /// A clock that stands still.
  static ZoneService::Clock Clock() {
    return [] { return kNowNs; };
  }

  std::string directory_;
  std::string store_url_;  ///< Empty: SQLite.
};

/// For tests of SQLite's files, and of stores that were written before there was PostgreSQL.
#define SKIP_ON_POSTGRESQL() \
  if (IsOnPostgresql()) GTEST_SKIP() << "not of PostgreSQL"

/// An acceptable report of a pothole, without a picture, with a uuid of its own.
inline protocol::Report MakeReport(const geo::GeoPoint& position = {40.44, -79.94}) {
  static std::mt19937_64 generator(1);
  protocol::Report report;
  report.uuid = Uuid::Random(generator);
  report.vehicle_id = "car-1";
  report.drive_id = "drive-1";
  report.stamp_ns = kNowNs - 1'000'000'000;
  report.class_name = "pothole";
  report.confidence = 0.5F;
  report.box = {10, 20, 110, 90};
  report.position = position;
  report.covariance_m2 = Eigen::Vector2d(1.0, 4.0).asDiagonal();
  report.image_width = 640;
  report.image_height = 480;
  return report;
}

/// An acceptable report of a barrier that has come, with a uuid of its own; its stamps are unset.
inline protocol::MapChangeReport MakeBarrier() {
  protocol::MapChangeReport report;
  report.uuid = MakeReport().uuid;
  report.vehicle_id = "car-1";
  report.drive_id = "drive-1";
  report.class_name = "barrier";
  report.confidence = 0.5F;
  report.seen = 5;
  report.position = {40.44, -79.94};
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  return report;
}

/// The header of a JPEG of this size, followed by `filler` bytes that nothing needs to decode.
inline std::vector<std::uint8_t> MakeJpeg(std::uint16_t width, std::uint16_t height,
                                          std::size_t filler = 0, std::uint8_t value = 0) {
  const auto high = [](std::uint16_t x) { return static_cast<std::uint8_t>(x >> 8); };
  const auto low = [](std::uint16_t x) { return static_cast<std::uint8_t>(x & 0xff); };
  std::vector<std::uint8_t> bytes{
      0xff, 0xd8, 0xff,         0xe0,        0,           4,          0, 0, 0xff, 0xc0, 0,
      11,   8,    high(height), low(height), high(width), low(width), 1, 1, 0x11, 0};
  bytes.resize(bytes.size() + filler, value);
  return bytes;
}

inline bool SameHazard(const Hazard& a, const Hazard& b) {
  return a.uuid == b.uuid && a.class_name == b.class_name && a.confidence == b.confidence &&
         a.position.latitude_deg == b.position.latitude_deg &&
         a.position.longitude_deg == b.position.longitude_deg &&
         a.covariance_m2 == b.covariance_m2 && a.sightings == b.sightings &&
         a.first_seen_ns == b.first_seen_ns && a.last_seen_ns == b.last_seen_ns &&
         a.updated_ns == b.updated_ns && a.sequence == b.sequence &&
         a.image_sha256 == b.image_sha256 && a.image_format == b.image_format &&
         a.state == b.state && a.presence == b.presence && a.vehicles == b.vehicles &&
         a.announced_sequence == b.announced_sequence;
}

/// A zone's test with a server of PostgreSQL of its own, which it may kill; skipped where none is
/// installed.
class PostgresqlZoneTest : public ZoneTest {
 protected:
  void SetUp() override {
    if (!test::PostgresqlServer::IsInstalled()) {
      GTEST_SKIP() << "skipped, no PostgreSQL server installed";
    }
    server_ = std::make_unique<test::PostgresqlServer>();
    url_ = server_->MakeDatabase();
  }

  std::unique_ptr<test::PostgresqlServer> server_;
  std::string url_;  ///< Of an empty database of that server.
};

}  // namespace livemap::zone
