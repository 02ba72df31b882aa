#include "region/region_map.h"

#include <algorithm>
#include <utility>

#include "common/sha256.h"
#include "zone/registry/map_view.h"

namespace livemap::region {
namespace {

Uuid NewRegionLogId() {
  auto generator = EntropySeededGenerator();
  return Uuid::Random(generator);
}

/// A zone that is read anew tells most hazards as they were.
bool SaysTheSame(const ToldHazard& told, const zone::Hazard& known) {
  const zone::Hazard& hazard = told.hazard;
  return hazard.sequence == known.sequence && hazard.updated_ns == known.updated_ns &&
         hazard.state == known.state && hazard.sightings == known.sightings &&
         hazard.position.latitude_deg == known.position.latitude_deg &&
         hazard.position.longitude_deg == known.position.longitude_deg;
}

bool IsWalkedOver(const zone::Walk<zone::HazardState>& walk, const zone::Hazard& hazard) {
  if (!walk.states.empty() && walk.states.count(hazard.state) == 0) return false;
  return !walk.box || walk.box->Contains(hazard.position);
}

}  // namespace

Uuid RegionHazardId(const std::string& zone, const Uuid& hazard) {
  std::string digits = Sha256Hex(zone + '\n' + hazard.ToString()).substr(0, 32);
  digits[12] = '8';
  constexpr char kVariants[] = "89ab";
  digits[16] = kVariants[static_cast<unsigned char>(digits[16]) % 4U];
  for (const std::size_t at : {20U, 16U, 12U, 8U}) digits.insert(at, 1, '-');
  return *Uuid::Parse(digits);
}

RegionMap::RegionMap(const protocol::HazardCatalogue& catalogue, std::uint64_t sequence,
                     std::optional<geo::GeoBox> view)
    : catalogue_(catalogue),
      bounds_(view),
      log_id_(NewRegionLogId()),
      duplicates_(catalogue),
      sequence_(sequence) {}

void RegionMap::Apply(const std::string& zone, const std::vector<ToldHazard>& hazards) {
  const MutexLock lock(writer_mutex_);
  for (const ToldHazard& told : hazards) {
    if (told.IsThere()) {
      Put(zone, told);
    } else {
      RemoveOne(zone, told.hazard.uuid);
    }
  }
}

std::vector<Uuid> RegionMap::NotAmong(const std::string& zone,
                                      const std::unordered_set<Uuid>& hazards) const {
  const MutexLock lock(writer_mutex_);
  std::vector<Uuid> others;
  const auto there = by_zone_.find(zone);
  if (there == by_zone_.end()) return others;
  for (const Uuid& hazard : there->second) {
    if (hazards.count(hazard) == 0) others.push_back(hazard);
  }
  return others;
}

void RegionMap::Remove(const std::string& zone, const std::vector<Uuid>& hazards) {
  const MutexLock lock(writer_mutex_);
  for (const Uuid& hazard : hazards) RemoveOne(zone, hazard);
}

void RegionMap::Put(const std::string& zone, const ToldHazard& told) {
  Shown shown{told.hazard, told.words, {zone, told.hazard.uuid}};
  zone::Hazard& hazard = shown.hazard;
  hazard.uuid = RegionHazardId(zone, told.hazard.uuid);
  hazard.class_name = catalogue_.HeadingOf(told.hazard.class_name);
  by_zone_[zone].insert(told.hazard.uuid);
  const auto known = told_.find(hazard.uuid);
  if (known != told_.end() && known->second.hazard.class_name == hazard.class_name &&
      SaysTheSame(told, known->second.hazard)) {
    return;
  }
  const PlacedHazard placed{hazard.uuid, hazard.class_name, hazard.position};
  const bool is_candidate = hazard.state == zone::HazardState::kCandidate;
  CountCandidate(zone, placed.id, is_candidate);
  told_[placed.id] = std::move(shown);
  Duplicates::Changes changes;
  if (is_candidate) {
    duplicates_.Remove(placed.id, changes);
    Show(changes);
    ShowCandidate(placed.id);
  } else {
    duplicates_.Put(placed, zone, changes);
    Show(changes);
    HideUnshown(placed.id);
  }
}

/// Of a hazard that another zone's hides. A page may know it as shown from before the region's
/// start, when the other zone's was hidden; and it was shown as long as it was a candidate.
void RegionMap::HideUnshown(const Uuid& id) {
  WithdrawCandidate(id);
  const WriterLock lock(data_mutex_);
  if (shown_.count(id) != 0) return;
  PutShown(told_.at(id));
  RemoveShown(id);
}

void RegionMap::ShowCandidate(const Uuid& id) {
  zone::ZoneEvent event;
  {
    const WriterLock lock(data_mutex_);
    event.hazard = PutShown(told_.at(id));
  }
  stream_.Publish(event);
}

void RegionMap::WithdrawCandidate(const Uuid& id) {
  zone::ZoneEvent event;
  {
    const WriterLock lock(data_mutex_);
    const auto found = shown_.find(id);
    if (found == shown_.end()) return;
    if (found->second.hazard.state != zone::HazardState::kCandidate) return;
    event.hazard = RemoveShown(id);
    ForgetOldest();
  }
  stream_.Publish(event);
}

/// What the hazard was before stands in `told_`.
void RegionMap::CountCandidate(const std::string& zone, const Uuid& id, bool is_candidate) {
  const auto known = told_.find(id);
  const bool was_candidate =
      known != told_.end() && known->second.hazard.state == zone::HazardState::kCandidate;
  if (is_candidate && !was_candidate) ++candidates_[zone];
  if (!is_candidate && was_candidate) --candidates_[zone];
}

void RegionMap::RemoveOne(const std::string& zone, const Uuid& hazard) {
  if (by_zone_[zone].erase(hazard) == 0) return;
  const Uuid id = RegionHazardId(zone, hazard);
  CountCandidate(zone, id, false);
  told_.erase(id);
  Duplicates::Changes changes;
  duplicates_.Remove(id, changes);
  Show(changes);
  WithdrawCandidate(id);
}

void RegionMap::Show(const Duplicates::Changes& changes) {
  std::vector<zone::ZoneEvent> events;
  {
    const WriterLock lock(data_mutex_);
    for (const Uuid& id : changes.gone) {
      if (auto event = RemoveShown(id)) events.emplace_back().hazard = std::move(*event);
    }
    for (const PlacedHazard& placed : changes.put) {
      events.emplace_back().hazard = PutShown(told_.at(placed.id));
    }
    ForgetOldest();
  }
  for (const zone::ZoneEvent& event : events) stream_.Publish(event);
}

zone::HazardEvent RegionMap::PutShown(const Shown& shown) {
  Shown& kept = shown_[shown.hazard.uuid];
  const bool was_known = kept.hazard.sequence != 0;
  const std::uint64_t announced_sequence = kept.hazard.announced_sequence;
  const HazardOrigin before = kept.origin;
  zone::HazardEvent event;
  if (was_known) {
    by_sequence_.erase(kept.hazard.sequence);
    gone_.erase(kept.hazard.sequence);
    --counts_.at(static_cast<std::size_t>(kept.hazard.state));
    event.from = kept.hazard.state;
  }
  kept = shown;
  kept.origin.zone_since = shown.hazard.sequence;
  kept.hazard.sequence = ++sequence_;
  kept.origin.region_since = sequence_;
  if (event.from == kept.hazard.state) {
    kept.origin.zone_since = before.zone_since;
    kept.origin.region_since = before.region_since;
  }
  by_sequence_[sequence_] = kept.hazard.uuid;
  ++counts_.at(static_cast<std::size_t>(kept.hazard.state));
  event.announced = zone::IsTold(kept.hazard.state);
  kept.hazard.announced_sequence = event.announced ? sequence_ : announced_sequence;
  const bool was_there =
      event.from && (event.announced ? zone::IsTold(*event.from) : zone::IsOnMap(*event.from));
  event.action = was_there ? zone::HazardAction::kUpdated : zone::HazardAction::kAdded;
  event.hazard = kept.hazard;
  return event;
}

std::optional<zone::HazardEvent> RegionMap::RemoveShown(const Uuid& id) {
  const auto found = shown_.find(id);
  if (found == shown_.end() || !zone::IsOnMap(found->second.hazard.state)) return std::nullopt;
  zone::Hazard& hazard = found->second.hazard;
  zone::HazardEvent event;
  event.from = hazard.state;
  by_sequence_.erase(hazard.sequence);
  --counts_.at(static_cast<std::size_t>(hazard.state));
  event.announced = zone::IsTold(hazard.state);
  hazard.state = zone::HazardState::kGone;
  hazard.sequence = ++sequence_;
  if (event.announced) hazard.announced_sequence = sequence_;
  by_sequence_[sequence_] = id;
  gone_[sequence_] = id;
  ++counts_.at(static_cast<std::size_t>(hazard.state));
  event.action = zone::HazardAction::kRemoved;
  event.hazard = hazard;
  return event;
}

void RegionMap::ForgetOldest() {
  while (gone_.size() > kMaxGone) {
    const auto oldest = gone_.begin();
    by_sequence_.erase(oldest->first);
    shown_.erase(oldest->second);
    --counts_.at(static_cast<std::size_t>(zone::HazardState::kGone));
    gone_.erase(oldest);
  }
}

std::size_t RegionMap::CountOf(const std::string& zone) const {
  const MutexLock lock(writer_mutex_);
  const auto hazards = by_zone_.find(zone);
  return hazards == by_zone_.end() ? 0 : hazards->second.size();
}

std::size_t RegionMap::ToldCountOf(const std::string& zone) const {
  const MutexLock lock(writer_mutex_);
  const auto hazards = by_zone_.find(zone);
  if (hazards == by_zone_.end()) return 0;
  const auto candidates = candidates_.find(zone);
  return hazards->second.size() - (candidates == candidates_.end() ? 0 : candidates->second);
}

std::size_t RegionMap::hidden() const {
  const MutexLock lock(writer_mutex_);
  return duplicates_.hidden();
}

std::optional<HazardOrigin> RegionMap::OriginOf(const Uuid& id) const {
  const ReaderLock lock(data_mutex_);
  const auto found = shown_.find(id);
  return found == shown_.end() ? std::nullopt : std::optional(found->second.origin);
}

std::uint64_t RegionMap::Sequence() const {
  const ReaderLock lock(data_mutex_);
  return sequence_;
}

zone::Page<zone::Hazard> RegionMap::ReadHazards(const zone::Walk<zone::HazardState>& walk,
                                                std::size_t limit) const {
  const ReaderLock lock(data_mutex_);
  zone::Page<zone::Hazard> page;
  page.sequence = walk.after;
  std::size_t looked_at = 0;
  for (auto next = by_sequence_.upper_bound(walk.after); next != by_sequence_.end(); ++next) {
    if (next->first > walk.until) break;
    if (page.items.size() == limit || looked_at == zone::kMaxLookedAtPerPage) return page;
    ++looked_at;
    page.sequence = next->first;
    const zone::Hazard& hazard = shown_.at(next->second).hazard;
    if (IsWalkedOver(walk, hazard)) page.items.push_back(hazard);
  }
  page.is_last = true;
  page.sequence = std::max(page.sequence, std::min(walk.until, sequence_));
  return page;
}

zone::Page<zone::MapChangeFeature> RegionMap::ReadMapChanges(
    const zone::Walk<zone::MapChangeState>& walk, std::size_t) const {
  zone::Page<zone::MapChangeFeature> page;
  page.sequence = std::max(walk.after, std::min(walk.until, Sequence()));
  page.is_last = true;
  return page;
}

std::array<std::size_t, zone::kHazardStates> RegionMap::HazardCounts() const {
  const ReaderLock lock(data_mutex_);
  return counts_;
}

std::optional<zone::Hazard> RegionMap::Find(const Uuid& uuid) const {
  const ReaderLock lock(data_mutex_);
  const auto found = shown_.find(uuid);
  return found == shown_.end() ? std::nullopt : std::optional(found->second.hazard);
}

std::optional<zone::MapChangeFeature> RegionMap::FindMapChange(const Uuid&) const {
  return std::nullopt;
}

std::vector<zone::StoredEvent> RegionMap::Events(const Uuid&, std::size_t) const { return {}; }

std::vector<zone::VehicleState> RegionMap::VehiclesAfter(const std::string&, std::size_t) const {
  return {};
}

std::optional<geo::GeoBox> RegionMap::View() const {
  if (bounds_) return bounds_;
  return view_.Get([this] {
    std::vector<zone::ViewHazard> hazards;
    {
      const ReaderLock lock(data_mutex_);
      for (const auto& [id, shown] : shown_) {
        if (zone::IsTold(shown.hazard.state)) hazards.push_back({shown.hazard.position, {}});
      }
    }
    return zone::ViewOf(hazards);
  });
}

streets::StreetWords RegionMap::WordsOf(const zone::Hazard& hazard) const {
  const ReaderLock lock(data_mutex_);
  const auto found = shown_.find(hazard.uuid);
  return found == shown_.end() ? streets::StreetWords{} : found->second.words;
}

int RegionMap::Subscribe(Subscriber subscriber) { return stream_.Subscribe(std::move(subscriber)); }

void RegionMap::Unsubscribe(int id) { stream_.Unsubscribe(id); }

}  // namespace livemap::region
