#include "zone/hazard_registry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"

namespace livemap {

HazardRegistry::HazardRegistry(HazardCatalogue catalogue, std::uint64_t hash_seed, FusionRule rule)
    : catalogue_(std::move(catalogue)), hash_seed_(hash_seed), rule_(rule) {}

SpatialGrid& HazardRegistry::GridOf(const std::string& class_name) {
  const auto found = classes_.find(class_name);
  if (found != classes_.end()) return found->second.grid;
  const double radius_m = catalogue_.DuplicateRadiusM(class_name);
  ClassIndex index{radius_m, SpatialGrid::ForRadius(radius_m, hash_seed_)};
  return classes_.emplace(class_name, std::move(index)).first->second.grid;
}

HazardRegistry::Slot HazardRegistry::Append(Hazard hazard) {
  const auto slot = static_cast<Slot>(hazards_.size());
  slots_.emplace(hazard.uuid, slot);
  hazards_.push_back(std::move(hazard));
  PutOnGrid(slot);
  return slot;
}

/// Counts the hazard in its state, and makes it one that reports may match.
void HazardRegistry::PutOnGrid(Slot slot) {
  const Hazard& hazard = hazards_[slot];
  ++counts_[static_cast<std::size_t>(hazard.state)];
  if (hazard.state == HazardState::kGone) return;
  GridOf(hazard.class_name).Insert(hazard.position, slot);
}

void HazardRegistry::TakeFromGrid(Slot slot) {
  const Hazard& hazard = hazards_[slot];
  --counts_[static_cast<std::size_t>(hazard.state)];
  if (hazard.state == HazardState::kGone) return;
  GridOf(hazard.class_name).Erase(hazard.position, slot);
}

std::size_t HazardRegistry::on_map_count() const {
  return hazards_.size() - counts_[static_cast<std::size_t>(HazardState::kGone)] -
         counts_[static_cast<std::size_t>(HazardState::kRejected)];
}

void HazardRegistry::Restore(Hazard hazard) {
  if (slots_.count(hazard.uuid) != 0) {
    throw Error("hazard '" + hazard.uuid.ToString() + "' stands twice in the store");
  }
  if (!changes_.empty() && hazard.sequence <= changes_.back().sequence) {
    throw Error("hazard '" + hazard.uuid.ToString() + "' has sequence " +
                std::to_string(hazard.sequence) + ", which is not above its predecessor's");
  }
  const std::uint64_t sequence = hazard.sequence;
  changes_.push_back({sequence, Append(std::move(hazard))});
}

std::optional<HazardRegistry::Slot> HazardRegistry::FindMatch(const std::string& class_name,
                                                              const GeoPoint& position) const {
  const auto found = classes_.find(class_name);
  if (found == classes_.end()) return std::nullopt;
  const auto nearest = found->second.grid.Nearest(position, found->second.radius_m);
  return nearest ? std::optional<Slot>(static_cast<Slot>(nearest->id)) : std::nullopt;
}

HazardRegistry::Slot HazardRegistry::Add(const Report& report, const PictureName& picture,
                                         const Uuid& uuid, std::uint64_t sequence,
                                         std::int64_t now_ns, HazardState state) {
  Hazard hazard;
  hazard.state = state;
  hazard.uuid = uuid;
  hazard.class_name = report.class_name;
  hazard.confidence = std::min(report.confidence, rule_.max_confidence);
  hazard.position = report.position;
  hazard.covariance_m2 = WithLeastSigma(report.covariance_m2, rule_.min_report_sigma_m);
  hazard.first_seen_ns = report.stamp_ns;
  hazard.last_seen_ns = report.stamp_ns;
  hazard.updated_ns = now_ns;
  hazard.sequence = sequence;
  hazard.image_sha256 = picture.sha256;
  hazard.image_format = picture.format;
  const Slot slot = Append(std::move(hazard));
  if (in_transaction_) undo_.push_back({slot, std::nullopt});
  NoteChange(slot);
  return slot;
}

void HazardRegistry::Merge(Slot slot, const Report& report, const PictureName& picture,
                           std::uint64_t sequence, std::int64_t now_ns) {
  RememberForUndo(slot);
  Hazard& hazard = hazards_[slot];
  const bool newest = report.stamp_ns >= hazard.last_seen_ns;
  TakeFromGrid(slot);
  Fuse(hazard, report, rule_);
  PutOnGrid(slot);
  if (!picture.sha256.empty() && (newest || hazard.image_sha256.empty())) {
    hazard.image_sha256 = picture.sha256;
    hazard.image_format = picture.format;
  }
  hazard.updated_ns = now_ns;
  hazard.sequence = sequence;
  NoteChange(slot);
}

void HazardRegistry::SetState(Slot slot, HazardState state, std::uint64_t sequence,
                              std::int64_t now_ns) {
  RememberForUndo(slot);
  Hazard& hazard = hazards_[slot];
  TakeFromGrid(slot);
  hazard.state = state;
  PutOnGrid(slot);
  hazard.updated_ns = now_ns;
  hazard.sequence = sequence;
  NoteChange(slot);
}

void HazardRegistry::MarkAnnounced(Slot slot) {
  RememberForUndo(slot);
  hazards_[slot].announced_sequence = hazards_[slot].sequence;
}

std::optional<HazardRegistry::Slot> HazardRegistry::Find(const Uuid& uuid) const {
  const auto found = slots_.find(uuid);
  return found == slots_.end() ? std::nullopt : std::optional<Slot>(found->second);
}

std::vector<Hazard> HazardRegistry::Query(const std::optional<GeoBox>& box,
                                          std::uint64_t since_sequence, std::size_t limit) const {
  std::vector<Hazard> result;
  auto change = std::upper_bound(
      changes_.begin(), changes_.end(), since_sequence,
      [](std::uint64_t sequence, const Change& c) { return sequence < c.sequence; });
  for (; change != changes_.end() && result.size() < limit; ++change) {
    const Hazard& hazard = hazards_[change->slot];
    if (hazard.sequence != change->sequence) continue;
    if (!IsOnMap(hazard.state) && since_sequence == 0) continue;
    if (box && !box->Contains(hazard.position)) continue;
    result.push_back(hazard);
  }
  return result;
}

std::vector<Hazard> HazardRegistry::QueryNear(const GeoPoint& centre, double radius_m,
                                              std::size_t limit) const {
  // Cheap lower bounds first of the ellipsoid's distance: most hazards of a zone are not near.
  const double max_latitude_difference = radius_m / 110574.0;
  const double poleward_deg =
      std::min(90.0, std::abs(centre.latitude_deg) + max_latitude_difference);
  const double least_m_per_degree = 111319.0 * std::cos(poleward_deg * kRadiansPerDegree);
  std::vector<std::pair<double, Slot>> found;
  for (Slot slot = 0; slot < hazards_.size(); ++slot) {
    const Hazard& hazard = hazards_[slot];
    if (!IsTold(hazard.state)) continue;
    if (std::abs(hazard.position.latitude_deg - centre.latitude_deg) > max_latitude_difference) {
      continue;
    }
    double east_deg = std::abs(hazard.position.longitude_deg - centre.longitude_deg);
    east_deg = std::min(east_deg, 360.0 - east_deg);
    if (east_deg * least_m_per_degree > radius_m) continue;
    const double distance_m = GeodesicDistanceM(centre, hazard.position);
    if (distance_m <= radius_m) found.emplace_back(distance_m, slot);
  }
  const std::size_t count = std::min(limit, found.size());
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count), found.end());
  std::vector<Hazard> result;
  result.reserve(count);
  for (std::size_t i = 0; i < count; ++i) result.push_back(hazards_[found[i].second]);
  return result;
}

std::vector<Hazard> HazardRegistry::ChangedAround(const GeoPoint& centre, double radius_m,
                                                  std::uint64_t since_sequence,
                                                  std::size_t limit) const {
  std::vector<Hazard> result;
  auto change = std::upper_bound(
      changes_.begin(), changes_.end(), since_sequence,
      [](std::uint64_t sequence, const Change& c) { return sequence < c.sequence; });
  for (; change != changes_.end(); ++change) {
    const Hazard& hazard = hazards_[change->slot];
    if (hazard.sequence != change->sequence || hazard.announced_sequence <= since_sequence)
      continue;
    if (since_sequence == 0 && !IsTold(hazard.state)) continue;
    if (GeodesicDistanceM(centre, hazard.position) <= radius_m) result.push_back(hazard);
  }
  std::sort(result.begin(), result.end(), [](const Hazard& a, const Hazard& b) {
    return a.announced_sequence < b.announced_sequence;
  });
  if (result.size() > limit) result.resize(limit);
  return result;
}

void HazardRegistry::RememberForUndo(Slot slot) {
  if (in_transaction_) undo_.push_back({slot, hazards_[slot]});
}

void HazardRegistry::NoteChange(Slot slot) {
  changes_.push_back({hazards_[slot].sequence, slot});
  if (!in_transaction_) CompactChanges();
}

void HazardRegistry::CompactChanges() {
  if (changes_.size() < 2 * hazards_.size() + 1024) return;
  const auto is_stale = [this](const Change& change) {
    return hazards_[change.slot].sequence != change.sequence;
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

void HazardRegistry::TakeBack(Undo& undo) {
  TakeFromGrid(undo.slot);
  Hazard& hazard = hazards_[undo.slot];
  if (!undo.before) {
    slots_.erase(hazard.uuid);
    hazards_.pop_back();
    return;
  }
  hazard = std::move(*undo.before);
  PutOnGrid(undo.slot);
}

}  // namespace livemap
