#include "region/neighbours.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "common/time.h"
#include "geo/geo_box.h"
#include "region/zone_list.h"

namespace livemap::region {
namespace {

constexpr double kMaxMarginM = 20'000;
constexpr std::size_t kHazardsPerRead = 1000;
/// However many ask, the list is made so often.
constexpr double kListAgeS = 1;

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

/// The smallest box with all places that lie within `radius_m` of one of these hazards, of which
/// there is at least one; all longitudes where it would cross the antimeridian.
geo::GeoBox BoxAround(const std::deque<zone::Hazard>& hazards, double radius_m) {
  // A little less than the ellipsoid has anywhere, so that the box is rather too large.
  constexpr double kLeastMetresPerDegree = 110'500;
  geo::GeoBox box{hazards.front().position, hazards.front().position};
  auto& [south_west, north_east] = box;
  for (const zone::Hazard& hazard : hazards) {
    const auto& [latitude_deg, longitude_deg] = hazard.position;
    south_west.latitude_deg = std::min(south_west.latitude_deg, latitude_deg);
    south_west.longitude_deg = std::min(south_west.longitude_deg, longitude_deg);
    north_east.latitude_deg = std::max(north_east.latitude_deg, latitude_deg);
    north_east.longitude_deg = std::max(north_east.longitude_deg, longitude_deg);
  }
  const double margin_deg = radius_m / kLeastMetresPerDegree;
  south_west.latitude_deg -= margin_deg;
  north_east.latitude_deg += margin_deg;
  const double poleward_deg = std::max(-south_west.latitude_deg, north_east.latitude_deg);
  const double narrowing = std::cos(std::min(poleward_deg, 90.0) * geo::kRadiansPerDegree);
  south_west.longitude_deg -= margin_deg / narrowing;
  north_east.longitude_deg += margin_deg / narrowing;
  if (!(south_west.longitude_deg >= -180 && north_east.longitude_deg <= 180)) {
    south_west.longitude_deg = -180;
    north_east.longitude_deg = 180;
  }
  return box;
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
  try {
    Renew();
  } catch (const Error& error) {
    log_(error.what());
  }
  if (!file_.directory()) {
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
  // Until the new one is followed: what fails is tried again.
  directory_ = nullptr;
  {
    std::unique_ptr<Region> former;
    const WriterLock lock(mutex_);
    former.swap(region_);
    // It ends before the next one begins, because both would write one store; nobody reads it now.
  }
  if (!directory) return log_("the zone directory has expired: nobody is followed");
  Region::Config config;
  config.zones = ZonesAround(*directory);
  config.directory = config_.store;
  config.ca_file = config_.ca_file;
  config.ask_every_s = config_.ask_every_s;
  std::unique_ptr<Region> region;
  if (!config.zones.empty()) {
    region = std::make_unique<Region>(std::move(config), catalogue_, now_ns_, log_);
  }
  directory_ = std::move(directory);
  const WriterLock lock(mutex_);
  region_ = std::move(region);
}

protocol::DuplicateFilter Neighbours::OwnAround(const std::deque<zone::Hazard>& hazards) const {
  protocol::DuplicateFilter own(catalogue_);
  if (hazards.empty()) return own;
  zone::Walk<zone::HazardState> walk;
  walk.box = BoxAround(hazards, catalogue_.MaxDuplicateRadiusM());
  walk.states = zone::StatesOnMap();
  walk.until = zone_.Sequence();
  for (bool is_last = false; !is_last;) {
    const auto page = zone_.ReadHazards(walk, kHazardsPerRead);
    walk.after = page.sequence;
    is_last = page.is_last;
    for (const zone::Hazard& hazard : page.items) {
      if (!zone::IsTold(hazard.state)) continue;
      own.Put(hazard.uuid, catalogue_.HeadingOf(hazard.class_name), hazard.position);
    }
  }
  return own;
}

std::vector<web::NeighbourHazard> Neighbours::Read() const {
  std::vector<web::NeighbourHazard> list;
  if (!region_) return list;
  std::map<std::string, const RegionZone*> zones;
  for (std::size_t i = 0; i < region_->zones(); ++i) {
    zones[region_->zone(i).id] = &region_->zone(i);
  }
  const RegionMap& map = region_->map();
  std::deque<zone::Hazard> newest;
  zone::Walk<zone::HazardState> walk;
  walk.states = zone::StatesOnMap();
  walk.until = map.Sequence();
  for (bool is_last = false; !is_last;) {
    auto page = map.ReadHazards(walk, kHazardsPerRead);
    walk.after = page.sequence;
    is_last = page.is_last;
    for (zone::Hazard& hazard : page.items) newest.push_back(std::move(hazard));
    while (newest.size() > kMaxHazards) newest.pop_front();
  }
  const protocol::DuplicateFilter own = OwnAround(newest);
  for (const zone::Hazard& hazard : newest) {
    const auto origin = map.OriginOf(hazard.uuid);
    if (!origin || own.Find(hazard.class_name, hazard.position)) continue;
    const RegionZone& zone = *zones.at(origin->zone);
    list.push_back(
        {hazard, map.WordsOf(hazard), zone.id, zone.name.empty() ? zone.id : zone.name, zone.url});
    list.back().hazard.uuid = origin->hazard;
  }
  return list;
}

std::vector<web::NeighbourHazard> Neighbours::Hazards() const {
  const MutexLock list_lock(list_mutex_);
  const std::int64_t now_ns = SteadyNs();
  if (!list_ns_ || now_ns - *list_ns_ >= Nanoseconds(kListAgeS)) {
    const ReaderLock lock(mutex_);
    list_ = Read();
    list_ns_ = now_ns;
  }
  return list_;
}

std::vector<std::string> Neighbours::zones() const {
  const ReaderLock lock(mutex_);
  std::vector<std::string> ids;
  for (std::size_t i = 0; region_ && i < region_->zones(); ++i) ids.push_back(region_->zone(i).id);
  return ids;
}

}  // namespace livemap::region
