#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "common/clock.h"
#include "directory/directory_keeper.h"
#include "directory/signed_document.h"
#include "directory/zone_directory.h"
#include "geo/wgs84.h"

namespace livemap::directory {

/// Says in which zone a place lies, by the zone directory that another part of the vehicle keeps in
/// a file (DirectoryKeeper). The file is read again when it has changed. Not thread-safe.
///
/// Typical usage:
///
///     ZoneLookup zones({folder + "/zones.cms"}, TrustedAuthority::Read("identity/ca.pem"));
///     report.zone = zones.IdAt(report.position);
class ZoneLookup {
 public:
  struct Config {
    std::string file;  ///< Of the signed directory; it need not be there yet.
    /// A place that no zone contains is served by the nearest one within this, m.
    double max_gap_m = ZoneChoice::Config{}.max_gap_m;
  };

  ZoneLookup(Config config, TrustedAuthority authority, DirectoryKeeper::Clock now_ns = SystemNs);

  /// The id of the zone that serves `point`. Empty where no zone is near, and while there is no
  /// valid directory.
  std::string IdAt(const geo::GeoPoint& point);

 private:
  void ReadAgainIfChanged();

  const Config config_;
  const TrustedAuthority authority_;
  const DirectoryKeeper::Clock now_ns_;
  std::filesystem::file_time_type read_time_{};  // Of the file that keeper_ has read.
  std::unique_ptr<DirectoryKeeper> keeper_;
};

}  // namespace livemap::directory
