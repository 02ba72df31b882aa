#pragma once

#include <string>

#include "common/clock.h"
#include "directory/directory_file.h"
#include "directory/directory_keeper.h"
#include "directory/signed_document.h"
#include "directory/zone_directory.h"
#include "geo/wgs84.h"

namespace livemap::directory {

/// Says in which zone a place lies, by the zone directory that another part of the vehicle keeps in
/// a file (DirectoryFile). Not thread-safe.
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
    /// So far outside of its area a zone may still announce what lies in another zone, m: as deep
    /// as zones may overlap. Placement is far more exact.
    double max_beyond_m = 500;
  };

  ZoneLookup(Config config, TrustedAuthority authority, DirectoryKeeper::Clock now_ns = SystemNs);

  /// The id of the zone that serves `point`. Empty where no zone is near, and while there is no
  /// valid directory.
  std::string IdAt(const geo::GeoPoint& point);
  /// Whether the directory has no zone with this id. False while there is no valid directory.
  bool IsGone(const std::string& id);
  /// Whether `point` lies in the area of another zone and more than max_beyond_m outside of that of
  /// the zone with this id. False while there is no valid directory, and for an id that it does not
  /// have.
  bool IsBeyond(const std::string& id, const geo::GeoPoint& point);

 private:
  const Config config_;
  DirectoryFile file_;
};

}  // namespace livemap::directory
