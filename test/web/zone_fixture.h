#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <random>
#include <string>

#include "protocol/hazard_catalogue.h"
#include "streets/street_map.h"
#include "web/server/web_server.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// A folder of its own that goes away with the object.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "livemap_web_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw Error("mkdtemp failed for '" + pattern + "'");
    path_ = pattern;
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// A token file that only its owner may read, with one official and one region, which may speak for
/// others.
class TokenFile {
 public:
  TokenFile();
  std::string path() const { return folder_.path() + "/tokens"; }
  static std::string official() { return "miller"; }
  static std::string token() { return "correct-horse-battery-staple"; }
  static std::string region() { return "metro"; }
  static std::string region_token() { return "staple-battery-horse-correct"; }

 private:
  TemporaryFolder folder_;
};

/// A picture of one white pixel.
std::vector<std::uint8_t> OnePixelPng();

/// A real zone with a real store in a temporary folder.
class ZoneFixture {
 public:
  static constexpr std::int64_t kStartNs = 1'767'225'600'000'000'000;  // 2026-01-01T00:00:00Z

  /// `streets`: those that the zone knows; null: none. `directory`: where its store is and stays;
  /// empty: in a folder that goes away with it. `store_url`: as ZoneConfig's.
  explicit ZoneFixture(std::shared_ptr<const streets::StreetMap> streets = nullptr,
                       const std::string& directory = "", const std::string& store_url = "");

  /// A report that the zone accepts, without a picture.
  protocol::Report MakeReport(const std::string& class_name, const geo::GeoPoint& position);
  /// A word of an object that appeared, which the zone accepts.
  protocol::MapChangeReport MakeMapChange(const std::string& class_name,
                                          const geo::GeoPoint& position);
  /// Adds `count` hazards of `class_name` about 20 m apart, going north from `start`.
  void AddRow(const std::string& class_name, const geo::GeoPoint& start, std::size_t count);

  /// File of the zone's database.
  std::string database() const { return directory_ + "/zone.sqlite3"; }

  protocol::HazardCatalogue catalogue;
  std::atomic<std::int64_t> now_ns{kStartNs};
  std::unique_ptr<zone::ZoneService> zone;

 private:
  TemporaryFolder folder_;
  std::string directory_;
  std::mt19937_64 generator_;
};

/// Options that serve the source tree's page on any free port of the loopback.
WebConfig TestOptions();

}  // namespace livemap::web
