#include "directory/zone_lookup.h"

#include <optional>
#include <system_error>
#include <utility>

namespace livemap::directory {

ZoneLookup::ZoneLookup(Config config, TrustedAuthority authority, DirectoryKeeper::Clock now_ns)
    : config_(std::move(config)), authority_(std::move(authority)), now_ns_(std::move(now_ns)) {}

void ZoneLookup::ReadAgainIfChanged() {
  std::error_code missing;
  const auto time = std::filesystem::last_write_time(config_.file, missing);
  // A file that is gone says nothing against what it said.
  if (missing || (keeper_ && time == read_time_)) return;
  read_time_ = time;
  auto next = std::make_unique<DirectoryKeeper>(authority_, config_.file, now_ns_);
  // A file that is half written, or older, says nothing against what it said either.
  const auto before = keeper_ ? keeper_->directory() : nullptr;
  const auto after = next->directory();
  if (before && (!after || after->version() < before->version())) return;
  keeper_ = std::move(next);
}

std::string ZoneLookup::IdAt(const geo::GeoPoint& point) {
  ReadAgainIfChanged();
  const auto directory = keeper_ ? keeper_->directory() : nullptr;
  if (!directory) return "";
  const auto found = directory->Find(point, config_.max_gap_m);
  return found ? directory->zones()[found->zone].id : "";
}

}  // namespace livemap::directory
