#include "region/neighbours.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>

#include "common/error.h"
#include "region/zone_list.h"

namespace livemap::region {
namespace {

constexpr double kMaxMarginM = 20'000;

Neighbours::Config CheckedNeighbours(Neighbours::Config config) {
  // Written so that NaN is refused, too.
  if (config.margin_m >= 0 && config.margin_m <= kMaxMarginM) return config;
  throw Error("neighbour_margin_m is " + std::to_string(config.margin_m) +
              ", accepted is a number from 0 to " + std::to_string(static_cast<int>(kMaxMarginM)));
}

bool HasCornerNear(const directory::ZoneArea& area, const directory::ZoneArea& other,
                   double margin_m) {
  for (const auto& ring : area.rings()) {
    for (const geo::GeoPoint& corner : ring) {
      if (other.IsNear(corner, margin_m)) return true;
    }
  }
  return false;
}

/// Whether a place of one may lie within `margin_m` of the other. Rather one zone too many: it has
/// nothing there.
bool MayBeNear(const directory::ZoneArea& a, const directory::ZoneArea& b, double margin_m) {
  return a.MayOverlap(b) || HasCornerNear(a, b, margin_m) || HasCornerNear(b, a, margin_m);
}

}  // namespace

Neighbours::Neighbours(Config config, const zone::ZoneService& zone,
                       const protocol::HazardCatalogue& catalogue, Region::Clock now_ns,
                       Region::Log log)
    : config_(CheckedNeighbours(std::move(config))),
      zone_(zone),
      catalogue_(catalogue),
      now_ns_(std::move(now_ns)),
      log_(std::move(log)),
      file_(directory::TrustedAuthority::Read(config_.authority), config_.directory, now_ns_) {
  Renew();
  if (!directory_) {
    log_("there is no valid zone directory at '" + config_.directory +
         "' yet: nobody is followed until there is");
  }
}

std::vector<RegionZone> Neighbours::ZonesAround(const directory::ZoneDirectory& directory) const {
  const auto own = directory.FindId(config_.zone);
  if (!own) {
    log_("the zone directory does not name zone '" + config_.zone + "': nobody is followed");
    return {};
  }
  const directory::ZoneArea& area = directory.zones()[*own].area;
  std::vector<RegionZone> zones;
  for (const directory::ZoneEntry& entry : directory.zones()) {
    if (entry.id == config_.zone || !MayBeNear(area, entry.area, config_.margin_m)) continue;
    if (entry.map_url.empty()) {
      log_("zone '" + entry.id + "' is not followed: the zone directory has no 'map' of it");
      continue;
    }
    zones.push_back(ZoneOf(entry));
    zones.back().only = Surroundings{area, config_.margin_m};
  }
  return zones;
}

void Neighbours::Renew() {
  if (file_.ReadIfChanged() && !file_.damage().empty()) log_(file_.damage());
  auto directory = file_.directory();
  if (directory == directory_) return;
  directory_ = std::move(directory);
  {
    // Before the next one: both would write one store.
    const MutexLock lock(mutex_);
    region_.reset();
  }
  if (!directory_) return log_("the zone directory has expired: nobody is followed");
  Region::Config config;
  config.zones = ZonesAround(*directory_);
  if (config.zones.empty()) return;
  config.directory = config_.store;
  config.ca_file = config_.ca_file;
  config.ask_every_s = config_.ask_every_s;
  auto region = std::make_shared<Region>(std::move(config), catalogue_, now_ns_, log_);
  const MutexLock lock(mutex_);
  region_ = std::move(region);
}

std::shared_ptr<Region> Neighbours::region() const {
  const MutexLock lock(mutex_);
  return region_;
}

bool Neighbours::IsOwn(const zone::Hazard& hazard) const {
  // Others may lie nearer that are of another class.
  constexpr std::size_t kNearest = 50;
  const auto near =
      zone_.QueryNear(hazard.position, catalogue_.DuplicateRadiusM(hazard.class_name), kNearest);
  return std::any_of(near.begin(), near.end(), [this, &hazard](const zone::Hazard& own) {
    return catalogue_.HeadingOf(own.class_name) == hazard.class_name;
  });
}

std::vector<web::NeighbourHazard> Neighbours::Hazards() const {
  const std::shared_ptr<Region> region = this->region();
  if (!region) return {};
  std::map<std::string, const RegionZone*> zones;
  for (std::size_t i = 0; i < region->zones(); ++i) zones[region->zone(i).id] = &region->zone(i);
  const RegionMap& map = region->map();
  std::vector<web::NeighbourHazard> hazards;
  zone::Walk<zone::HazardState> walk;
  walk.states = zone::StatesOnMap();
  walk.until = map.Sequence();
  for (bool is_last = false; !is_last;) {
    const auto page = map.ReadHazards(walk, kMaxHazards);
    walk.after = page.sequence;
    is_last = page.is_last;
    for (const zone::Hazard& hazard : page.items) {
      const auto origin = map.OriginOf(hazard.uuid);
      if (!origin || IsOwn(hazard)) continue;
      const RegionZone& zone = *zones.at(origin->zone);
      hazards.push_back({hazard, map.WordsOf(hazard), zone.id,
                         zone.name.empty() ? zone.id : zone.name, zone.url});
      hazards.back().hazard.uuid = origin->hazard;
    }
  }
  const std::size_t over = hazards.size() - std::min(hazards.size(), kMaxHazards);
  hazards.erase(hazards.begin(), hazards.begin() + static_cast<std::ptrdiff_t>(over));
  return hazards;
}

std::vector<std::string> Neighbours::zones() const {
  const std::shared_ptr<Region> region = this->region();
  std::vector<std::string> ids;
  for (std::size_t i = 0; region && i < region->zones(); ++i) ids.push_back(region->zone(i).id);
  return ids;
}

}  // namespace livemap::region
