#include "zone/service/trail_collector.h"

#include <algorithm>
#include <utility>

#include "zone/registry/vehicle_track.h"

namespace livemap::zone {
namespace {

/// A vehicle drives some 300 m in it, as far as a trail reaches.
constexpr std::int64_t kPassingNs = 25'000'000'000;
/// At the same time; of more the trail stays as it began.
constexpr std::size_t kMaxPassing = 20000;
constexpr std::size_t kMaxAtOnce = 1000;

}  // namespace

void TrailCollector::Note(Slot slot, const std::string& vehicle_id, std::int64_t seen_ns,
                          ZoneTransaction& transaction) {
  if (!config_.hazard_trails) return;
  if (state_.hazards.Trails(slot).size() >= protocol::kMaxTrails) return;
  const Hazard hazard = state_.hazards.Get(slot);
  Pass pass{slot, hazard.uuid, vehicle_id, seen_ns, transaction.now_ns() + kPassingNs, {}};
  pass.begun = TrailPast(vehicles_.Track(vehicle_id), seen_ns, hazard.position);
  if (!pass.begun.empty()) {
    std::vector<protocol::Trail> trails = hazard.trails;
    trails.push_back(pass.begun);
    transaction.KeepTrails(slot, std::move(trails));
  }
  if (passing_.size() < kMaxPassing) passing_.push_back(std::move(pass));
}

std::vector<TrailCollector::Pass> TrailCollector::TakeDue(std::int64_t now_ns) {
  std::vector<Pass> due;
  while (!passing_.empty() && passing_.front().due_ns <= now_ns && due.size() < kMaxAtOnce) {
    due.push_back(std::move(passing_.front()));
    passing_.pop_front();
  }
  return due;
}

void TrailCollector::Complete(const std::vector<Pass>& passes, ZoneTransaction& transaction) {
  const HazardRegistry& hazards = state_.hazards;
  for (const Pass& pass : passes) {
    // Its transaction may have failed.
    if (pass.slot >= hazards.size() || hazards.Record(pass.slot).uuid != pass.hazard) continue;
    protocol::Trail trail = TrailPast(vehicles_.Track(pass.vehicle_id), pass.seen_ns,
                                      hazards.Record(pass.slot).estimate.position);
    if (!trail.empty() && !protocol::AreSame(trail, pass.begun))
      Keep(pass, std::move(trail), transaction);
  }
}

/// In place of what was kept of it before, if that is there still.
void TrailCollector::Keep(const Pass& pass, protocol::Trail trail, ZoneTransaction& transaction) {
  std::vector<protocol::Trail> trails = state_.hazards.Trails(pass.slot);
  const auto begun = std::find_if(trails.begin(), trails.end(), [&](const protocol::Trail& known) {
    return protocol::AreSame(known, pass.begun);
  });
  if (begun != trails.end()) {
    *begun = std::move(trail);
  } else if (trails.size() < protocol::kMaxTrails) {
    trails.push_back(std::move(trail));
  } else {
    return;
  }
  transaction.KeepTrails(pass.slot, std::move(trails));
}

}  // namespace livemap::zone
