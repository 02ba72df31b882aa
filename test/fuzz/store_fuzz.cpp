// Databases as a failing disk or a stranger leaves them: the zone's store and the vehicle's. The
// first byte chooses: 0 the zone's file as it is, 1 the vehicle's, 2 and 3 a sound file of either
// with a row whose values are any bytes. Each is opened, read and used, or refused by a sentence.
#include <sqlite3.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "hazard/local_hazard_map.h"
#include "zone/zone_service.h"

namespace livemap {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;
constexpr GeoPoint kPlace{40.44, -79.94};

void Require(bool holds) {
  if (!holds) std::abort();
}

/// In memory where the system has such a folder: the files live for microseconds.
fs::path NewFolder() {
  const fs::path base = fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path();
  std::string pattern = (base / "livemap_store_fuzz_XXXXXX").string();
  Require(mkdtemp(pattern.data()) != nullptr);
  return pattern;
}

class Folder {
 public:
  Folder() : path_(NewFolder()) {}
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path zone() const { return path_ / "zone.sqlite3"; }
  fs::path vehicle() const { return path_ / "vehicle.sqlite3"; }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

Report MakeReport() {
  Report report;
  report.uuid.bytes[0] = 1;
  report.vehicle_id = "car-1";
  report.drive_id = "drive-1";
  report.stamp_ns = kNowNs;
  report.class_name = "pothole";
  report.confidence = 0.5F;
  report.box = {1, 1, 2, 2};
  report.position = kPlace;
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  report.image_width = report.image_height = 10;
  return report;
}

void UseZone(const fs::path& folder) {
  ZoneService::Config config;
  config.directory = folder.string();
  ZoneService zone(
      config, [] { return kNowNs; }, 1);
  for (const Hazard& hazard : zone.Query(std::nullopt, 0, 100)) {
    Require(IsValid(hazard.position) && hazard.confidence >= 0 && hazard.confidence <= 1);
    zone.Events(hazard.uuid, 10);
  }
  zone.QueryNear(kPlace, 1000, 100);
  zone.Handle(MakeReport());
  zone.Advance();
}

void UseVehicle(const fs::path& file) {
  LocalHazardMap::Config config;
  config.path = file.string();
  LocalHazardMap map(config, HazardCatalogue(), kNowNs);
  for (const KnownHazard& known : map.Known(100)) Require(IsValid(known.position));
  for (const auto& pending : map.Pending()) map.LoadPending(pending.uuid);
  map.Find("pothole", kPlace);
  map.Add(MakeReport());
}

std::string FileOf(const fs::path& path) { return ReadFile(path.string(), 1 << 24); }

/// A sound database of the zone or of a vehicle, with one row of each kind.
const std::string& SoundFile(bool of_zone) {
  static const std::string kZone = [] {
    const Folder folder;
    UseZone(folder.path());
    return FileOf(folder.zone());
  }();
  static const std::string kVehicle = [] {
    const Folder folder;
    UseVehicle(folder.vehicle());
    return FileOf(folder.vehicle());
  }();
  return of_zone ? kZone : kVehicle;
}

/// Takes values off the input: a kind, then bytes.
class Values {
 public:
  Values(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::uint8_t Byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  void Bind(sqlite3_stmt* statement, int index) {
    const std::uint8_t kind = Byte();
    std::uint8_t bytes[64] = {};
    const std::size_t count = kind % 4 < 2 ? 8 : std::min<std::size_t>(Byte() % 64, size_);
    for (std::size_t i = 0; i < count; ++i) bytes[i] = Byte();
    std::int64_t whole = 0;
    double real = 0;
    std::memcpy(&whole, bytes, 8);
    std::memcpy(&real, bytes, 8);
    const int length = static_cast<int>(count);
    switch (kind % 5) {
      case 0:
        sqlite3_bind_int64(statement, index, whole);
        break;
      case 1:
        sqlite3_bind_double(statement, index, real);
        break;
      case 2:
        sqlite3_bind_text(statement, index, reinterpret_cast<char*>(bytes), length,
                          SQLITE_TRANSIENT);
        break;
      case 3:
        sqlite3_bind_blob(statement, index, bytes, length, SQLITE_TRANSIENT);
        break;
      default:
        break;  // NULL.
    }
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

/// Overwrites one column of every row of one table; constraints may refuse it.
void SpoilRow(sqlite3* database, Values& values) {
  sqlite3_stmt* tables = nullptr;
  sqlite3_prepare_v2(database,
                     "SELECT m.name, p.name FROM sqlite_master m, pragma_table_info(m.name) p "
                     "WHERE m.type = 'table' AND m.name NOT LIKE 'sqlite%' ORDER BY 1, 2",
                     -1, &tables, nullptr);
  std::vector<std::pair<std::string, std::string>> columns;
  while (sqlite3_step(tables) == SQLITE_ROW) {
    const auto text = [tables](int column) {
      return std::string(reinterpret_cast<const char*>(sqlite3_column_text(tables, column)));
    };
    columns.emplace_back(text(0), text(1));
  }
  sqlite3_finalize(tables);
  if (columns.empty()) return;
  const auto& [table, column] = columns[values.Byte() % columns.size()];
  const std::string sql = "UPDATE \"" + table + "\" SET \"" + column + "\" = ?";
  sqlite3_stmt* update = nullptr;
  if (sqlite3_prepare_v2(database, sql.c_str(), -1, &update, nullptr) == SQLITE_OK) {
    values.Bind(update, 1);
    sqlite3_step(update);
  }
  sqlite3_finalize(update);
}

void SpoilRows(const fs::path& file, Values values) {
  sqlite3* database = nullptr;
  if (sqlite3_open(file.c_str(), &database) == SQLITE_OK) {
    sqlite3_exec(database, "PRAGMA ignore_check_constraints=ON", nullptr, nullptr, nullptr);
    for (int i = 0; i < 3; ++i) SpoilRow(database, values);
  }
  sqlite3_close(database);
}

void FuzzOne(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  const bool of_zone = data[0] % 2 == 0;
  const bool rows = data[0] % 4 >= 2;
  const Folder folder;
  const fs::path file = of_zone ? folder.zone() : folder.vehicle();
  const std::string raw(reinterpret_cast<const char*>(data) + 1, size - 1);
  std::ofstream(file, std::ios::binary) << (rows ? SoundFile(of_zone) : raw);
  if (rows) SpoilRows(file, Values(data + 1, size - 1));
  try {
    if (of_zone) {
      UseZone(folder.path());
    } else {
      UseVehicle(file);
    }
  } catch (const Error& error) {
    Require(error.what()[0] != '\0');
  }
}

}  // namespace
}  // namespace livemap

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::FuzzOne(data, size);
  return 0;
}
