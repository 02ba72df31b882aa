#include "directory/zone_lookup.h"

#include <optional>
#include <utility>

namespace livemap::directory {

ZoneLookup::ZoneLookup(Config config, TrustedAuthority authority, DirectoryKeeper::Clock now_ns)
    : config_(std::move(config)), file_(std::move(authority), config_.file, std::move(now_ns)) {}

std::string ZoneLookup::IdAt(const geo::GeoPoint& point) {
  file_.ReadIfChanged();
  const auto directory = file_.directory();
  if (!directory) return "";
  const auto found = directory->Find(point, config_.max_gap_m);
  return found ? directory->zones()[found->zone].id : "";
}

bool ZoneLookup::IsGone(const std::string& id) {
  file_.ReadIfChanged();
  const auto directory = file_.directory();
  return directory && !directory->FindId(id);
}

bool ZoneLookup::IsBeyond(const std::string& id, const geo::GeoPoint& point) {
  file_.ReadIfChanged();
  const auto directory = file_.directory();
  const auto own = directory ? directory->FindId(id) : std::nullopt;
  if (!own) return false;
  const ZoneArea& area = directory->zones()[*own].area;
  if (area.IsNear(point, config_.max_beyond_m) && area.DepthM(point) >= -config_.max_beyond_m) {
    return false;
  }
  return directory->Find(point, 0).has_value();
}

}  // namespace livemap::directory
