#include "zone/registry/hazard_registry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/error.h"

namespace livemap::zone {

HazardRegistry::HazardRegistry(protocol::HazardCatalogue catalogue, std::uint64_t hash_seed,
                               FusionRule rule)
    : catalogue_(std::move(catalogue)), hash_seed_(hash_seed), rule_(rule) {}

/// Names of classes come from strangers: their number is bounded, whatever the catalogue says.
std::string HazardRegistry::HeadingOf(const std::string& class_name) const {
  std::string heading = catalogue_.HeadingOf(class_name);
  const bool has_room = class_places_.count(heading) != 0 || classes_.size() < kMaxClasses;
  return has_room ? heading : protocol::kOtherClass;
}

std::uint32_t HazardRegistry::ClassOf(const std::string& class_name) {
  const auto found = class_places_.find(class_name);
  if (found != class_places_.end()) return found->second;
  const double radius_m = catalogue_.DuplicateRadiusM(class_name);
  const auto place = static_cast<std::uint32_t>(classes_.size());
  classes_.push_back({class_name, radius_m, geo::SpatialGrid::ForRadius(radius_m, hash_seed_)});
  class_places_.emplace(class_name, place);
  return place;
}

HazardRegistry::Slot HazardRegistry::Append(const HazardRecord& record) {
  const auto slot = static_cast<Slot>(records_.size());
  slots_.Insert(record.uuid, slot);
  records_.push_back(record);
  PutOnGrid(slot);
  return slot;
}

/// Counts the hazard in its state, and makes it one that reports may match.
void HazardRegistry::PutOnGrid(Slot slot) {
  const HazardRecord& record = records_[slot];
  ++counts_[static_cast<std::size_t>(record.life.state)];
  CountWitness(record.life, 1);
  if (record.life.state == HazardState::kGone) return;
  classes_[record.hazard_class].grid.Insert(record.estimate.position, slot);
}

void HazardRegistry::TakeFromGrid(Slot slot) {
  const HazardRecord& record = records_[slot];
  --counts_[static_cast<std::size_t>(record.life.state)];
  CountWitness(record.life, -1);
  if (record.life.state == HazardState::kGone) return;
  classes_[record.hazard_class].grid.Erase(record.estimate.position, slot);
}

void HazardRegistry::CountWitness(const PresenceRecord& life, int change) {
  const std::uint64_t witness = OnlyWitness(life);
  if (witness == 0) return;
  const auto known = resting_on_.try_emplace(witness).first;
  known->second = change > 0 ? known->second + 1 : known->second - 1;
  if (known->second == 0) resting_on_.erase(known);
}

std::size_t HazardRegistry::CountRestingOn(std::uint64_t vehicle) const {
  const auto known = resting_on_.find(vehicle);
  return known == resting_on_.end() ? 0 : known->second;
}

std::size_t HazardRegistry::on_map_count() const {
  return records_.size() - counts_[static_cast<std::size_t>(HazardState::kGone)] -
         counts_[static_cast<std::size_t>(HazardState::kRejected)];
}

void HazardRegistry::Restore(const Hazard& hazard, const PresenceRecord& life, std::uint32_t id) {
  if (Find(hazard.uuid)) {
    throw Error("hazard '" + hazard.uuid.ToString() + "' stands twice in the store");
  }
  if (!changes_.empty() && hazard.sequence <= changes_.back().sequence) {
    throw Error("hazard '" + hazard.uuid.ToString() + "' has sequence " +
                std::to_string(hazard.sequence) + ", which is not above its predecessor's");
  }
  HazardRecord record;
  record.uuid = hazard.uuid;
  record.estimate = {hazard.confidence,    hazard.sightings,     hazard.position,
                     hazard.covariance_m2, hazard.first_seen_ns, hazard.last_seen_ns};
  record.sequence = hazard.sequence;
  record.announced_sequence = hazard.announced_sequence;
  record.updated_ns = hazard.updated_ns;
  record.id = id;
  record.hazard_class = ClassOf(hazard.class_name);
  record.presence = hazard.presence;
  record.course_rad = static_cast<float>(hazard.course_rad);
  record.picture = PackedPicture(hazard.image_sha256, hazard.image_format);
  record.life = life;
  last_id_ = std::max(last_id_, id);
  const Slot slot = Append(record);
  SetTrails(slot, hazard.trails);
  changes_.push_back({record.sequence, slot});
}

std::optional<HazardRegistry::Slot> HazardRegistry::FindMatch(const std::string& class_name,
                                                              const geo::GeoPoint& position) const {
  const auto found = class_places_.find(class_name);
  if (found == class_places_.end()) return std::nullopt;
  const Class& known = classes_[found->second];
  const auto nearest = known.grid.Nearest(position, known.radius_m);
  return nearest ? std::optional<Slot>(static_cast<Slot>(nearest->id)) : std::nullopt;
}

std::optional<HazardRegistry::Slot> HazardRegistry::FindMatch(
    const std::string& class_name, const geo::GeoPoint& position,
    const std::function<bool(Slot)>& may_match) const {
  const std::optional<Slot> nearest = FindMatch(class_name, position);
  if (!nearest || may_match(*nearest)) return nearest;
  const Class& known = classes_[class_places_.at(class_name)];
  std::vector<geo::SpatialGrid::Neighbour> near = known.grid.Within(position, known.radius_m);
  std::sort(near.begin(), near.end(), [](const auto& a, const auto& b) {
    return a.distance_m != b.distance_m ? a.distance_m < b.distance_m : a.id < b.id;
  });
  for (const geo::SpatialGrid::Neighbour& other : near) {
    const auto slot = static_cast<Slot>(other.id);
    if (slot != *nearest && may_match(slot)) return slot;
  }
  return std::nullopt;
}

HazardRegistry::Slot HazardRegistry::Add(const protocol::Report& report,
                                         const std::string& class_name, const PictureName& picture,
                                         const Uuid& uuid, std::uint64_t sequence,
                                         std::int64_t now_ns) {
  slots_.Prefetch(uuid);
  HazardRecord record;
  record.uuid = uuid;
  record.estimate = {std::min(report.confidence, rule_.max_confidence),
                     1,
                     report.position,
                     WithLeastSigma(report.covariance_m2, rule_.min_report_sigma_m),
                     report.stamp_ns,
                     report.stamp_ns};
  record.sequence = sequence;
  record.updated_ns = now_ns;
  record.id = ++last_id_;
  record.hazard_class = ClassOf(class_name);
  record.picture = PackedPicture(picture.sha256, picture.format);
  const Slot slot = Append(record);
  if (in_transaction_) undo_.push_back({slot, true, {}});
  NoteChange(slot);
  return slot;
}

void HazardRegistry::Merge(Slot slot, const protocol::Report& report, const PictureName& picture,
                           std::uint64_t sequence, std::int64_t now_ns, SightingSays says) {
  RememberForUndo(slot);
  HazardRecord& record = records_[slot];
  HazardEstimate& estimate = record.estimate;
  const bool newest = report.stamp_ns >= estimate.last_seen_ns;
  if (says == SightingSays::kWhere || says == SightingSays::kSurer) {
    const geo::GeoPoint from = estimate.position;
    if (says == SightingSays::kWhere) {
      Fuse(estimate, report, rule_);
    } else {
      TakePlace(estimate, report, rule_);
    }
    classes_[record.hazard_class].grid.Move(from, estimate.position, slot);
  } else {
    ++estimate.sightings;
  }
  if (says == SightingSays::kWhen) NoteSeen(estimate, report.stamp_ns);
  const bool shows = says != SightingSays::kNothing && !picture.sha256.empty();
  if (shows && (newest || record.picture.empty())) {
    record.picture = PackedPicture(picture.sha256, picture.format);
  }
  record.updated_ns = now_ns;
  record.sequence = sequence;
  NoteChange(slot);
}

void HazardRegistry::SetLife(Slot slot, const PresenceRecord& life, double presence,
                             std::uint64_t sequence, std::int64_t now_ns) {
  RememberForUndo(slot);
  HazardRecord& record = records_[slot];
  const bool on_grid = record.life.state != HazardState::kGone;
  if (on_grid != (life.state != HazardState::kGone)) {
    TakeFromGrid(slot);
    record.life = life;
    PutOnGrid(slot);
  } else {
    --counts_[static_cast<std::size_t>(record.life.state)];
    ++counts_[static_cast<std::size_t>(life.state)];
    if (OnlyWitness(record.life) != OnlyWitness(life)) {
      CountWitness(record.life, -1);
      CountWitness(life, 1);
    }
    record.life = life;
  }
  record.presence = static_cast<float>(presence);
  record.updated_ns = now_ns;
  if (record.sequence == sequence) return;
  record.sequence = sequence;
  NoteChange(slot);
}

bool HazardRegistry::RenameVoice(Slot slot, std::uint64_t vehicle, std::uint64_t pseudonym) {
  PresenceRecord life = records_[slot].life;
  bool is_found = false;
  for (VehicleEvidence& voice : life.voices) {
    if (voice.vehicle != vehicle) continue;
    voice.vehicle = pseudonym;
    is_found = true;
  }
  if (!is_found) return false;
  RememberForUndo(slot);
  CountWitness(records_[slot].life, -1);
  records_[slot].life = life;
  CountWitness(life, 1);
  return true;
}

void HazardRegistry::Edit(Slot slot, const std::string& class_name, const HazardEstimate& estimate,
                          std::uint64_t sequence, std::int64_t now_ns) {
  RememberForUndo(slot);
  TakeFromGrid(slot);
  HazardRecord& record = records_[slot];
  record.hazard_class = ClassOf(class_name);
  record.estimate = estimate;
  record.updated_ns = now_ns;
  PutOnGrid(slot);
  if (record.sequence == sequence) return;
  record.sequence = sequence;
  NoteChange(slot);
}

void HazardRegistry::SetCourse(Slot slot, double course_rad) {
  RememberForUndo(slot);
  records_[slot].course_rad = static_cast<float>(course_rad);
}

void HazardRegistry::SetTrails(Slot slot, std::vector<protocol::Trail> trails) {
  if (trails.empty()) {
    trails_.erase(slot);
  } else {
    trails_[slot] = std::move(trails);
  }
}

const std::vector<protocol::Trail>& HazardRegistry::Trails(Slot slot) const {
  static const std::vector<protocol::Trail> none;
  const auto known = trails_.find(slot);
  return known == trails_.end() ? none : known->second;
}

void HazardRegistry::SetPicture(Slot slot, const PictureName& picture) {
  RememberForUndo(slot);
  records_[slot].picture = PackedPicture(picture.sha256, picture.format);
}

void HazardRegistry::MarkAnnounced(Slot slot) {
  RememberForUndo(slot);
  records_[slot].announced_sequence = records_[slot].sequence;
}

Hazard HazardRegistry::Get(Slot slot) const {
  const HazardRecord& record = records_[slot];
  Hazard hazard;
  hazard.uuid = record.uuid;
  hazard.class_name = ClassName(slot);
  hazard.confidence = record.estimate.confidence;
  hazard.position = record.estimate.position;
  hazard.covariance_m2 = record.estimate.covariance_m2;
  hazard.sightings = record.estimate.sightings;
  hazard.first_seen_ns = record.estimate.first_seen_ns;
  hazard.last_seen_ns = record.estimate.last_seen_ns;
  hazard.updated_ns = record.updated_ns;
  hazard.sequence = record.sequence;
  hazard.image_sha256 = record.picture.Sha256();
  hazard.image_format = record.picture.Format();
  hazard.state = record.life.state;
  hazard.presence = record.presence;
  hazard.vehicles = Supporters(record.life);
  hazard.announced_sequence = record.announced_sequence;
  hazard.course_rad = static_cast<double>(record.course_rad);
  hazard.trails = Trails(slot);
  return hazard;
}

std::optional<HazardRegistry::Slot> HazardRegistry::Find(const Uuid& uuid) const {
  return slots_.Find(uuid, [this](Slot slot) -> const Uuid& { return records_[slot].uuid; });
}

std::vector<HazardRegistry::Change>::const_iterator HazardRegistry::ChangesSince(
    std::uint64_t sequence) const {
  return std::upper_bound(
      changes_.begin(), changes_.end(), sequence,
      [](std::uint64_t since, const Change& change) { return since < change.sequence; });
}

std::vector<Hazard> HazardRegistry::Query(const std::optional<geo::GeoBox>& box,
                                          std::uint64_t since_sequence, std::size_t limit,
                                          const HazardStates& states) const {
  Walk<HazardState> walk{box, states, since_sequence, UINT64_MAX};
  if (states.empty() && since_sequence == 0) walk.states = StatesOnMap();
  return ReadItems(std::move(walk), limit,
                   [this](const auto& part, std::size_t most) { return ReadPage(part, most); });
}

Page<Hazard> HazardRegistry::ReadPage(const Walk<HazardState>& walk, std::size_t limit) const {
  Page<Hazard> page;
  page.sequence = walk.after;
  std::size_t looked_at = 0;
  for (auto change = ChangesSince(walk.after); change != changes_.end(); ++change) {
    if (change->sequence > walk.until) break;
    if (page.items.size() == limit || looked_at++ == kMaxLookedAtPerPage) return page;
    page.sequence = change->sequence;
    const HazardRecord& record = records_[change->slot];
    if (record.sequence != change->sequence) continue;
    if (!walk.states.empty() && walk.states.count(record.life.state) == 0) continue;
    if (walk.box && !walk.box->Contains(record.estimate.position)) continue;
    page.items.push_back(Get(change->slot));
  }
  page.is_last = true;
  return page;
}

std::vector<HazardRegistry::Slot> HazardRegistry::HazardsWithEvidenceFrom(
    std::uint64_t vehicle, Slot& next, std::size_t max_found, std::size_t max_looks) const {
  std::vector<Slot> slots;
  const std::size_t end = std::min(records_.size(), next + max_looks);
  for (; next < end && slots.size() < max_found; ++next) {
    const Slot slot = next;
    const PresenceRecord& life = records_[slot].life;
    if (life.state == HazardState::kGone) continue;
    const bool spoke =
        std::any_of(life.voices.begin(), life.voices.end(),
                    [&](const VehicleEvidence& voice) { return voice.vehicle == vehicle; });
    if (spoke) slots.push_back(slot);
  }
  return slots;
}

void HazardRegistry::AppendToView(Slot& next, std::size_t& on_map, std::size_t step,
                                  std::size_t max_looks, std::vector<ViewHazard>& view) const {
  const std::size_t end = std::min(records_.size(), next + max_looks);
  for (; next < end; ++next) {
    const HazardRecord& record = records_[next];
    if (!IsOnMap(record.life.state) || on_map++ % step != 0) continue;
    ViewHazard hazard;
    hazard.position = record.estimate.position;
    std::transform(record.life.voices.begin(), record.life.voices.end(), hazard.supporters.begin(),
                   [](const VehicleEvidence& voice) {
                     return voice.Counts() && !voice.against ? voice.vehicle : 0;
                   });
    view.push_back(hazard);
  }
}

std::vector<Hazard> HazardRegistry::QueryNear(const geo::GeoPoint& centre, double radius_m,
                                              std::size_t limit) const {
  // Cheap lower bounds first of the ellipsoid's distance: most hazards of a zone are not near.
  const double max_latitude_difference = radius_m / 110574.0;
  const double poleward_deg =
      std::min(90.0, std::abs(centre.latitude_deg) + max_latitude_difference);
  const double min_m_per_degree = 111319.0 * std::cos(poleward_deg * geo::kRadiansPerDegree);
  std::vector<std::pair<double, Slot>> found;
  for (Slot slot = 0; slot < records_.size(); ++slot) {
    if (!IsTold(State(slot))) continue;
    const geo::GeoPoint& position = records_[slot].estimate.position;
    if (std::abs(position.latitude_deg - centre.latitude_deg) > max_latitude_difference) continue;
    double east_deg = std::abs(position.longitude_deg - centre.longitude_deg);
    east_deg = std::min(east_deg, 360.0 - east_deg);
    if (east_deg * min_m_per_degree > radius_m) continue;
    const double distance_m = geo::GeodesicDistanceM(centre, position);
    if (distance_m <= radius_m) found.emplace_back(distance_m, slot);
  }
  const std::size_t count = std::min(limit, found.size());
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count), found.end());
  std::vector<Hazard> result;
  result.reserve(count);
  for (std::size_t i = 0; i < count; ++i) result.push_back(Get(found[i].second));
  return result;
}

std::vector<Hazard> HazardRegistry::ChangedAround(const geo::GeoPoint& centre, double radius_m,
                                                  std::uint64_t since_sequence,
                                                  std::size_t limit) const {
  std::vector<std::pair<std::uint64_t, Slot>> found;
  // An announcement is an event: what was announced since has changed since.
  for (auto change = ChangesSince(since_sequence); change != changes_.end(); ++change) {
    const HazardRecord& record = records_[change->slot];
    if (record.sequence != change->sequence) continue;
    if (record.announced_sequence <= since_sequence) continue;
    if (since_sequence == 0 && !IsTold(record.life.state)) continue;
    if (geo::GeodesicDistanceM(centre, record.estimate.position) > radius_m) continue;
    found.emplace_back(record.announced_sequence, change->slot);
  }
  std::sort(found.begin(), found.end());
  if (found.size() > limit) found.resize(limit);
  std::vector<Hazard> result;
  result.reserve(found.size());
  for (const auto& [sequence, slot] : found) result.push_back(Get(slot));
  return result;
}

void HazardRegistry::RememberForUndo(Slot slot) {
  // As it was at first: what comes on top of that is taken back with it.
  if (!in_transaction_ || (!undo_.empty() && undo_.back().slot == slot)) return;
  undo_.push_back({slot, false, records_[slot]});
}

void HazardRegistry::NoteChange(Slot slot) {
  changes_.push_back({records_[slot].sequence, slot});
  if (!in_transaction_) CompactChanges();
}

void HazardRegistry::CompactChanges() {
  if (changes_.size() < 2 * records_.size() + 1024) return;
  const auto is_stale = [this](const Change& change) {
    return records_[change.slot].sequence != change.sequence;
  };
  changes_.erase(std::remove_if(changes_.begin(), changes_.end(), is_stale), changes_.end());
}

void HazardRegistry::Begin() {
  in_transaction_ = true;
  changes_at_begin_ = changes_.size();
  undo_.clear();
}

void HazardRegistry::Commit() {
  in_transaction_ = false;
  undo_.clear();
  CompactChanges();
}

void HazardRegistry::Rollback() {
  // Newest first, so that new hazards leave from the back.
  for (auto undo = undo_.rbegin(); undo != undo_.rend(); ++undo) TakeBack(*undo);
  changes_.resize(changes_at_begin_);
  undo_.clear();
  in_transaction_ = false;
}

void HazardRegistry::TakeBack(const Undo& undo) {
  TakeFromGrid(undo.slot);
  if (undo.is_new) {
    slots_.Erase(records_[undo.slot].uuid, undo.slot);
    records_.pop_back();
    --last_id_;
    return;
  }
  records_[undo.slot] = undo.before;
  PutOnGrid(undo.slot);
}

}  // namespace livemap::zone
