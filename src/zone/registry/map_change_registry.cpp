#include "zone/registry/map_change_registry.h"

#include <Eigen/LU>
#include <algorithm>
#include <set>
#include <utility>

#include "common/error.h"
#include "common/time.h"
#include "zone/admission/map_change_validation.h"
#include "zone/belief/map_change_witnesses.h"
#include "zone/model/presence_record.h"

namespace livemap::zone {
namespace {

HazardEstimate MapChangeEstimateOf(const MapChangeFeature& feature) {
  return {feature.confidence,    feature.reports,       feature.position,
          feature.covariance_m2, feature.first_seen_ns, feature.last_seen_ns};
}

WitnessUpdate NoteMapChange(MapChangeFeature& feature, const protocol::MapChangeReport& report,
                            bool against) {
  return RecordWitness(feature.witnesses, VehicleKey(report.vehicle_id),
                       VehicleKey(report.drive_id), against);
}

void ForgetMapChangeDenials(MapChangeFeature& feature) {
  auto& witnesses = feature.witnesses;
  witnesses.erase(std::remove_if(witnesses.begin(), witnesses.end(),
                                 [](const MapChangeWitness& one) { return one.against; }),
                  witnesses.end());
  feature.denied_ns = 0;
}

const char* MapChangeReasonFor(WitnessUpdate news) {
  switch (news) {
    case WitnessUpdate::kNewVehicle:
      return "told by another vehicle";
    case WitnessUpdate::kNewDrive:
      return "told by another drive of a vehicle";
    case WitnessUpdate::kSameDrive:
      return "told again by the same drive";
    case WitnessUpdate::kTooMany:
      return "told by one more vehicle than are counted";
  }
  return "told again";
}

}  // namespace

MapChangeRegistry::MapChangeRegistry(const Rule& rule, std::uint64_t hash_seed)
    : rule_(rule), grid_(geo::SpatialGrid::ForRadius(rule.join_m, hash_seed)) {
  if (!(rule_.join_sigmas > 0) || rule_.confirmations < 1 || rule_.denying_vehicles < 1 ||
      rule_.max_features < 1) {
    throw Error(
        "map changes: sigmas, confirmations, denials and the number of features must be "
        "above 0");
  }
}

void MapChangeRegistry::Restore(Id id, const MapChangeFeature& feature) {
  if (features_.count(id) != 0 || ids_.count(feature.uuid) != 0 ||
      by_sequence_.count(feature.sequence) != 0) {
    throw Error("map change '" + feature.uuid.ToString() + "' stands twice in the store");
  }
  Put(id, feature);
  SkipIdsTo(id);
}

void MapChangeRegistry::SkipIdsTo(Id id) { last_id_ = std::max(last_id_, id); }

/// The feature that the report is most likely about, among those that `accepts` takes.
template <typename Accepts>
std::optional<MapChangeRegistry::Id> MapChangeRegistry::Nearest(
    const protocol::MapChangeReport& report, const Accepts& accepts) const {
  std::optional<std::pair<double, Id>> best;
  for (const geo::SpatialGrid::Neighbour& near : grid_.Within(report.position, rule_.join_m)) {
    const Id id = static_cast<Id>(near.id);
    const MapChangeFeature& feature = features_.at(id);
    if (feature.class_name != report.class_name || !accepts(feature)) continue;
    const Eigen::Vector2d offset_m = geo::LocalFrame(feature.position).ToEnu(report.position);
    const Eigen::Matrix2d both_m2 =
        feature.covariance_m2 +
        WithLeastSigma(report.covariance_m2, rule_.fusion.min_report_sigma_m);
    const double sigmas2 = offset_m.dot(both_m2.inverse() * offset_m);
    if (sigmas2 > rule_.join_sigmas * rule_.join_sigmas) continue;
    const std::pair<double, Id> found(sigmas2, id);
    if (!best || found < *best) best = found;
  }
  return best ? std::optional<Id>(best->second) : std::nullopt;
}

/// Whether what became of a closed feature already answers the report.
bool MapChangeRegistry::IsAnswered(const MapChangeFeature& feature,
                                   const protocol::MapChangeReport& report,
                                   std::int64_t now_ns) const {
  if (IsOpen(feature.state)) return false;
  if (Seconds(now_ns - feature.updated_ns) > rule_.closed_memory_s) return false;
  const bool same = feature.vanished == report.vanished;
  if (feature.state == MapChangeState::kDismissed) return same;
  return !same || report.stamp_ns <= feature.denied_ns;
}

std::optional<MapChangeRegistry::Effect> MapChangeRegistry::Tell(
    const protocol::MapChangeReport& report, bool counts, const Stamp& stamp) {
  const auto open =
      Nearest(report, [](const MapChangeFeature& feature) { return IsOpen(feature.state); });
  if (open) {
    const MapChangeFeature& feature = features_.at(*open);
    const bool against = feature.vanished != report.vanished;
    if (!counts || (against && report.stamp_ns <= feature.last_seen_ns)) {
      return Effect{Outcome::kKnown, *open, {}};
    }
    return against ? Deny(*open, report, stamp) : Support(*open, report, stamp);
  }
  const auto answered = Nearest(report, [&](const MapChangeFeature& feature) {
    return IsAnswered(feature, report, stamp.now_ns);
  });
  if (answered) return Effect{Outcome::kKnown, *answered, {}};
  return Add(report, counts, stamp);
}

MapChangeRegistry::Effect MapChangeRegistry::Support(Id id, const protocol::MapChangeReport& report,
                                                     const Stamp& stamp) {
  MapChangeFeature feature = features_.at(id);
  const WitnessUpdate news = NoteMapChange(feature, report, false);
  if (news == WitnessUpdate::kNewVehicle || news == WitnessUpdate::kNewDrive) ++feature.drives;
  // A vehicle names its drives itself: with each it could pull the feature a little further.
  if (news == WitnessUpdate::kNewVehicle) {
    FuseInto(feature, report);
  } else {
    ++feature.reports;
    feature.last_seen_ns = std::max(feature.last_seen_ns, report.stamp_ns);
  }
  std::string reason = MapChangeReasonFor(news);
  if (feature.denied_ns != 0 && report.stamp_ns > feature.denied_ns) {
    ForgetMapChangeDenials(feature);
    reason += ", later than the opposite";
  }
  const std::uint32_t vehicles = feature.Vehicles();
  if (feature.state == MapChangeState::kProposed && vehicles >= rule_.confirmations) {
    feature.state = MapChangeState::kConfirmed;
    reason = "told by " + std::to_string(vehicles) + " vehicles";
  }
  return {Outcome::kMerged, id, Settle(id, std::move(feature), std::move(reason), stamp)};
}

MapChangeRegistry::Effect MapChangeRegistry::Deny(Id id, const protocol::MapChangeReport& report,
                                                  const Stamp& stamp) {
  MapChangeFeature feature = features_.at(id);
  NoteMapChange(feature, report, true);
  feature.denied_ns = std::max(feature.denied_ns, report.stamp_ns);
  const std::uint32_t needed =
      feature.state == MapChangeState::kProposed ? 1 : rule_.denying_vehicles;
  const std::uint32_t against = feature.Vehicles(true);
  std::string reason = against == 1 ? "a vehicle tells the opposite"
                                    : std::to_string(against) + " vehicles tell the opposite";
  if (against >= needed) {
    feature.state = MapChangeState::kUndone;
  } else {
    reason += ", " + std::to_string(needed) + " undo it";
  }
  return {Outcome::kDenied, id, Settle(id, std::move(feature), std::move(reason), stamp)};
}

std::optional<MapChangeRegistry::Effect> MapChangeRegistry::Add(
    const protocol::MapChangeReport& report, bool counts, const Stamp& stamp) {
  if (!MakeRoom()) return std::nullopt;
  MapChangeFeature feature;
  feature.uuid = stamp.fresh;
  feature.class_name = report.class_name;
  feature.vanished = report.vanished;
  feature.confidence = std::min(report.confidence, rule_.fusion.max_confidence);
  feature.position = report.position;
  feature.covariance_m2 = WithLeastSigma(report.covariance_m2, rule_.fusion.min_report_sigma_m);
  feature.first_seen_ns = feature.last_seen_ns = report.stamp_ns;
  feature.drives = counts ? 1 : 0;
  if (counts) NoteMapChange(feature, report, false);
  if (counts && rule_.confirmations <= 1) feature.state = MapChangeState::kConfirmed;
  const Id id = ++last_id_;
  std::string reason = counts ? "told by a vehicle" : "told by a vehicle that does not count";
  MapChangeEvent event = Settle(id, std::move(feature), std::move(reason), stamp);
  event.from.reset();
  return Effect{Outcome::kAdded, id, std::move(event)};
}

/// As a further sighting of a hazard is.
void MapChangeRegistry::FuseInto(MapChangeFeature& feature,
                                 const protocol::MapChangeReport& report) const {
  HazardEstimate estimate = MapChangeEstimateOf(feature);
  Fuse(estimate, ReportFieldsOf(report), rule_.fusion);
  feature.confidence = estimate.confidence;
  feature.reports = estimate.sightings;
  feature.position = estimate.position;
  feature.covariance_m2 = estimate.covariance_m2;
  feature.first_seen_ns = estimate.first_seen_ns;
  feature.last_seen_ns = estimate.last_seen_ns;
}

/// Keeps the feature as it is after an event.
MapChangeEvent MapChangeRegistry::Settle(Id id, MapChangeFeature feature, std::string reason,
                                         const Stamp& stamp) {
  MapChangeEvent event;
  const auto before = features_.find(id);
  if (before != features_.end()) event.from = before->second.state;
  event.previous_sequence = feature.sequence;
  event.reason = std::move(reason);
  feature.sequence = stamp.sequence;
  feature.updated_ns = stamp.now_ns;
  event.feature = feature;
  Put(id, std::move(feature));
  return event;
}

std::optional<MapChangeEvent> MapChangeRegistry::Decide(const Uuid& uuid, MapChangeState to,
                                                        std::string reason, const Stamp& stamp) {
  const auto id = IdOf(uuid);
  if (!id) return std::nullopt;
  MapChangeFeature feature = features_.at(*id);
  const bool confirms = to == MapChangeState::kConfirmed;
  const bool may_follow =
      IsOpen(feature.state) || (confirms && feature.state == MapChangeState::kDismissed);
  if (!may_follow || (!confirms && to != MapChangeState::kDismissed)) return std::nullopt;
  feature.state = to;
  // What was told against it before counts no more: somebody has looked.
  if (confirms) ForgetMapChangeDenials(feature);
  return Settle(*id, std::move(feature), std::move(reason), stamp);
}

std::optional<MapChangeEvent> MapChangeRegistry::TakeDecisionBack(const Uuid& uuid,
                                                                  const MapChangeFeature& before,
                                                                  std::string reason,
                                                                  const Stamp& stamp) {
  const auto id = IdOf(uuid);
  if (!id || features_.at(*id).state == MapChangeState::kUndone) return std::nullopt;
  MapChangeFeature feature = features_.at(*id);
  feature.state = before.state;
  feature.denied_ns = std::max(feature.denied_ns, before.denied_ns);
  for (const MapChangeWitness& witness : before.witnesses) {
    const bool is_known = std::any_of(
        feature.witnesses.begin(), feature.witnesses.end(), [&](const MapChangeWitness& one) {
          return one.vehicle == witness.vehicle && one.against == witness.against;
        });
    if (!is_known && feature.Vehicles(witness.against) < kMaxWitnesses) {
      feature.witnesses.push_back(witness);
    }
  }
  if (feature.state == MapChangeState::kProposed && feature.Vehicles() >= rule_.confirmations) {
    feature.state = MapChangeState::kConfirmed;
  }
  return Settle(*id, std::move(feature), std::move(reason), stamp);
}

const MapChangeFeature* MapChangeRegistry::Find(const Uuid& uuid) const {
  const auto id = IdOf(uuid);
  return id ? &features_.at(*id) : nullptr;
}

std::optional<MapChangeRegistry::Id> MapChangeRegistry::IdOf(const Uuid& uuid) const {
  const auto found = ids_.find(uuid);
  return found == ids_.end() ? std::nullopt : std::optional<Id>(found->second);
}

std::vector<MapChangeFeature> MapChangeRegistry::Query(const std::optional<geo::GeoBox>& box,
                                                       std::uint64_t since_sequence,
                                                       std::size_t limit,
                                                       const MapChangeStates& states) const {
  Walk<MapChangeState> walk{box, states, since_sequence, UINT64_MAX};
  if (states.empty() && since_sequence == 0) walk.states = OpenStates();
  return ReadItems(std::move(walk), limit,
                   [this](const auto& part, std::size_t most) { return ReadPage(part, most); });
}

Page<MapChangeFeature> MapChangeRegistry::ReadPage(const Walk<MapChangeState>& walk,
                                                   std::size_t limit) const {
  Page<MapChangeFeature> page;
  page.sequence = walk.after;
  std::size_t looked_at = 0;
  for (auto entry = by_sequence_.upper_bound(walk.after); entry != by_sequence_.end(); ++entry) {
    if (entry->first > walk.until) break;
    if (page.items.size() == limit || looked_at++ == kMaxLookedAtPerPage) return page;
    page.sequence = entry->first;
    const MapChangeFeature& feature = features_.at(entry->second);
    if (!walk.states.empty() && walk.states.count(feature.state) == 0) continue;
    if (walk.box && !walk.box->Contains(feature.position)) continue;
    page.items.push_back(feature);
  }
  page.is_last = true;
  return page;
}

/// Makes room for one more feature, where there is none; false when only open ones are left.
bool MapChangeRegistry::MakeRoom() {
  while (features_.size() >= rule_.max_features) {
    if (closed_by_sequence_.empty()) return false;
    Drop(closed_by_sequence_.begin()->second);
  }
  return true;
}

void MapChangeRegistry::Index(Id id, const MapChangeFeature& feature) {
  ids_.emplace(feature.uuid, id);
  by_sequence_.emplace(feature.sequence, id);
  if (!IsOpen(feature.state)) closed_by_sequence_.emplace(feature.sequence, id);
  grid_.Insert(feature.position, id);
  ++counts_[static_cast<std::size_t>(feature.state)];
}

void MapChangeRegistry::Unindex(Id id, const MapChangeFeature& feature) {
  ids_.erase(feature.uuid);
  by_sequence_.erase(feature.sequence);
  closed_by_sequence_.erase(feature.sequence);
  grid_.Erase(feature.position, id);
  --counts_[static_cast<std::size_t>(feature.state)];
}

std::size_t MapChangeRegistry::RenameWitness(const Pseudonyms& names, Id& next, Id max_looks) {
  std::size_t renamed = 0;
  for (Id looks = 0; looks < max_looks && next <= last_id_; ++looks, ++next) {
    const auto known = features_.find(next);
    if (known == features_.end()) continue;
    MapChangeFeature feature = known->second;
    const std::string about = feature.uuid.ToString();
    bool is_found = false;
    for (MapChangeWitness& witness : feature.witnesses) {
      if (witness.vehicle != names.key()) continue;
      is_found = true;
      witness.vehicle = names.KeyFor(about);
      // A drive's name may say whose it was.
      for (std::size_t i = 0; i < witness.newest.size() && witness.newest[i] != 0; ++i) {
        witness.newest[i] = names.KeyFor(about + " drive " + std::to_string(i));
      }
    }
    if (!is_found) continue;
    Put(next, std::move(feature));
    ++renamed;
  }
  return renamed;
}

void MapChangeRegistry::Put(Id id, MapChangeFeature feature) {
  const auto known = features_.find(id);
  if (known == features_.end()) {
    if (in_transaction_) undo_.push_back({id, std::nullopt});
    Index(id, features_.emplace(id, std::move(feature)).first->second);
    return;
  }
  if (in_transaction_) undo_.push_back({id, known->second});
  Unindex(id, known->second);
  known->second = std::move(feature);
  Index(id, known->second);
}

void MapChangeRegistry::Drop(Id id) {
  const auto known = features_.find(id);
  if (in_transaction_) undo_.push_back({id, known->second});
  Unindex(id, known->second);
  features_.erase(known);
}

void MapChangeRegistry::Begin() {
  in_transaction_ = true;
  last_id_at_begin_ = last_id_;
  undo_.clear();
}

void MapChangeRegistry::Commit() {
  in_transaction_ = false;
  undo_.clear();
}

void MapChangeRegistry::Rollback() {
  in_transaction_ = false;
  last_id_ = last_id_at_begin_;
  // Newest first: a feature that changed twice ends as it was at first.
  for (auto undo = undo_.rbegin(); undo != undo_.rend(); ++undo) {
    if (undo->before) {
      Put(undo->id, std::move(*undo->before));
    } else {
      Drop(undo->id);
    }
  }
  undo_.clear();
}

MapChangeRegistry::Touched MapChangeRegistry::TouchedSinceBegin() const {
  std::set<Id> ids;
  for (const Undo& undo : undo_) ids.insert(undo.id);
  Touched touched;
  for (const Id id : ids) {
    const bool is_known = features_.count(id) != 0;
    // One that came and went since is in no store.
    if (is_known) {
      touched.written.push_back(id);
    } else if (id <= last_id_at_begin_) {
      touched.dropped.push_back(id);
    }
  }
  return touched;
}

}  // namespace livemap::zone
