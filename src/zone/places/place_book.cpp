#include "zone/places/place_book.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "protocol/text_rules.h"
#include "zone/admission/longest_silent.h"

namespace livemap::zone {
namespace {

/// Positions that come faster are compared, but count for nothing: whoever sends a thousand in a
/// second outvotes nobody.
constexpr std::int64_t kPositionNs = 500'000'000;
constexpr double kMaxCourseRad = 4 * M_PI;
constexpr double kMaxSigmaM = 1e4;
constexpr double kMaxOutboxAgeS = 10 * 365 * 86400.0;

Refusal Implausible(std::string sentence) { return {RefusalKind::kMalformed, std::move(sentence)}; }

/// The place of this stamp; null without one.
const KnownPlace* PlaceAt(const ReportTrack& track, std::int64_t stamp_ns) {
  const auto place = std::lower_bound(
      track.places.begin(), track.places.end(), stamp_ns,
      [](const KnownPlace& known, std::int64_t stamp) { return known.fix.stamp_ns < stamp; });
  return place != track.places.end() && place->fix.stamp_ns == stamp_ns ? &*place : nullptr;
}

KnownPlace DroppedPlace(std::int64_t stamp_ns) { return {{stamp_ns, {}, 0}, 0, true}; }

/// Whether the numbers and texts are those of a position at all. Written so that NaN is refused.
std::optional<Refusal> WhyNoPosition(const VehicleState& vehicle, const PlaceBook::Config& config) {
  const std::size_t max_bytes = config.limits.max_text_bytes;
  if (!protocol::IsAcceptableName(vehicle.vehicle_id, max_bytes) ||
      (!vehicle.drive_id.empty() && !protocol::IsAcceptableName(vehicle.drive_id, max_bytes))) {
    return Implausible("vehicle_id or drive_id is no acceptable name");
  }
  if (!geo::IsValid(vehicle.position) || IsPlaceOfNoFix(vehicle.position)) {
    return Implausible("position is no latitude and longitude in degrees, or exactly 0, 0");
  }
  if (!std::isnan(vehicle.course_rad) && !(std::abs(vehicle.course_rad) <= kMaxCourseRad)) {
    return Implausible("course " + NumberText(vehicle.course_rad) +
                       " rad is not within +-4 pi, and not NaN for a vehicle that stands");
  }
  if (!(vehicle.speed_mps >= 0 && vehicle.speed_mps <= config.speed.max_speed_mps)) {
    return Refusal{RefusalKind::kSpeed, "speed " + NumberText(vehicle.speed_mps) +
                                            " m/s is not within 0 to " +
                                            NumberText(config.speed.max_speed_mps) + " m/s"};
  }
  if (!(vehicle.sigma_m >= 0 && vehicle.sigma_m <= kMaxSigmaM)) {
    return Implausible("standard deviation " + NumberText(vehicle.sigma_m) +
                       " m is not within 0 to " + NumberText(kMaxSigmaM) + " m");
  }
  if (vehicle.outbox_age_s &&
      !(*vehicle.outbox_age_s >= 0 && *vehicle.outbox_age_s <= kMaxOutboxAgeS)) {
    return Implausible("outbox age " + NumberText(*vehicle.outbox_age_s) +
                       " s is not within 0 to " + NumberText(kMaxOutboxAgeS) + " s");
  }
  return std::nullopt;
}

}  // namespace

StoreDamage PlaceBook::Load() {
  return store_.LoadPlaces([&](const std::string& vehicle_id, const KnownPlace& place) {
    const MutexLock lock(mutex_);
    const bool is_known = entries_.count(vehicle_id) != 0;
    if (!is_known && entries_.size() >= config_.max_vehicles) return;
    Entry& entry = entries_[vehicle_id];
    entry.is_read = true;
    Restore(entry.track, place);
  });
}

ReportTrack PlaceBook::Read(const std::string& vehicle_id) {
  ReportTrack track;
  for (const KnownPlace& place : store_.FindPlaces(vehicle_id, ReportTrack::kMaxPlaces)) {
    Restore(track, place);
  }
  return track;
}

std::optional<Refusal> PlaceBook::Challenge(const std::string& vehicle_id, const ReportedFix& fix) {
  std::optional<ReportTrack> stored;
  while (true) {
    {
      const MutexLock lock(mutex_);
      if (ReportTrack* draft = DraftOf(vehicle_id, stored)) {
        const auto speed_mps = zone::Challenge(*draft, fix, config_.speed);
        if (!speed_mps) return std::nullopt;
        return Refusal{RefusalKind::kSpeed, SpeedText(*speed_mps, config_.speed)};
      }
    }
    // Without the lock: nobody's position waits for the disk.
    stored = Read(vehicle_id);
  }
}

/// The vehicle's draft; null where its past must be read first. `stored` is what was read.
ReportTrack* PlaceBook::DraftOf(const std::string& vehicle_id,
                                const std::optional<ReportTrack>& stored) {
  const auto draft = drafts_.find(vehicle_id);
  if (draft != drafts_.end()) return &draft->second;
  const auto known = entries_.find(vehicle_id);
  if (known != entries_.end() && known->second.is_read) {
    return &drafts_.emplace(vehicle_id, known->second.track).first->second;
  }
  if (!stored) return nullptr;
  ReportTrack track = *stored;
  if (known != entries_.end()) {
    // Positions that came since the vehicle was forgotten: what its past contradicts is refused.
    for (const KnownPlace& place : known->second.track.places) {
      zone::Challenge(track, place.fix, config_.speed, place.is_kept);
    }
    known->second.track = track;
    known->second.is_read = true;
  }
  return &drafts_.emplace(vehicle_id, std::move(track)).first->second;
}

void PlaceBook::ForgetDrafts() {
  const MutexLock lock(mutex_);
  drafts_.clear();
}

void PlaceBook::Save(std::int64_t now_ns) {
  struct Change {
    std::string vehicle_id;
    KnownPlace place;
    bool is_dropped = false;
  };
  std::vector<Change> changes;
  {
    const MutexLock lock(mutex_);
    for (auto& [vehicle_id, track] : drafts_) {
      ForgetBefore(track, OldestNs(now_ns));
      for (auto unsaved = track.unsaved.begin(); unsaved != track.unsaved.end();) {
        const auto [stamp_ns, what] = *unsaved;
        if (what == UnsavedPlace::kCounted) {
          ++unsaved;
          continue;
        }
        const KnownPlace* place = PlaceAt(track, stamp_ns);
        changes.push_back({vehicle_id, place != nullptr ? *place : DroppedPlace(stamp_ns),
                           what == UnsavedPlace::kDropped || place == nullptr});
        // What a position changes from here on is saved with the next batch.
        unsaved = track.unsaved.erase(unsaved);
      }
    }
  }
  // No place is in two changes. PostgreSQL takes rows at once that follow each other.
  for (const Change& change : changes) {
    if (change.is_dropped) store_.DropPlace(change.vehicle_id, change.place.fix.stamp_ns);
  }
  for (const Change& change : changes) {
    if (!change.is_dropped) store_.WritePlace(change.vehicle_id, change.place);
  }
}

void PlaceBook::Keep(std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  for (auto& [vehicle_id, track] : drafts_) {
    Entry& entry = EntryOf(vehicle_id);
    entry.track = std::move(track);
    entry.is_read = true;
    entry.heard_ns = now_ns;
    if (!entry.track.unsaved.empty()) uncounted_.insert(vehicle_id);
  }
  drafts_.clear();
}

void PlaceBook::SaveCounts() {
  constexpr std::size_t kVehiclesAtOnce = 200;
  std::vector<std::pair<std::string, KnownPlace>> counted;
  std::vector<std::string> vehicles;
  {
    const MutexLock lock(mutex_);
    for (const std::string& vehicle_id : uncounted_) {
      if (vehicles.size() == kVehiclesAtOnce) break;
      vehicles.push_back(vehicle_id);
      const auto entry = entries_.find(vehicle_id);
      if (entry == entries_.end()) continue;
      ReportTrack& track = entry->second.track;
      for (auto unsaved = track.unsaved.begin(); unsaved != track.unsaved.end();) {
        const auto [stamp_ns, what] = *unsaved;
        const KnownPlace* place = PlaceAt(track, stamp_ns);
        if (what != UnsavedPlace::kCounted || place == nullptr) {
          ++unsaved;
          continue;
        }
        counted.emplace_back(vehicle_id, *place);
        unsaved = track.unsaved.erase(unsaved);
      }
    }
  }
  if (!counted.empty()) {
    store_.Begin();
    try {
      for (const auto& [vehicle_id, place] : counted) store_.WritePlace(vehicle_id, place);
      store_.Commit();
    } catch (...) {
      store_.Rollback();
      const MutexLock lock(mutex_);
      for (const auto& [vehicle_id, place] : counted) {
        const auto entry = entries_.find(vehicle_id);
        if (entry == entries_.end() || PlaceAt(entry->second.track, place.fix.stamp_ns) == nullptr)
          continue;
        entry->second.track.unsaved.emplace(place.fix.stamp_ns, UnsavedPlace::kCounted);
      }
      throw;
    }
  }
  for (const std::string& vehicle_id : vehicles) uncounted_.erase(vehicle_id);
}

std::int64_t PlaceBook::OldestNs(std::int64_t now_ns) const {
  const double age_ns = config_.limits.max_age_s * 1e9;
  // Where drives are played back no age is too old.
  return age_ns < static_cast<double>(now_ns) ? now_ns - static_cast<std::int64_t>(age_ns)
                                              : INT64_MIN;
}

void PlaceBook::ForgetOld(std::int64_t now_ns) {
  constexpr int kVehiclesAtOnce = 100;
  constexpr std::int64_t kRestNs = 3600'000'000'000;
  const std::int64_t rested_ns = now_ns - walked_ns_;
  if (pruned_up_to_.empty() && rested_ns >= 0 && rested_ns < kRestNs) return;
  const std::int64_t oldest_ns = OldestNs(now_ns);
  std::optional<std::string> last = pruned_up_to_;
  store_.Begin();
  try {
    for (int i = 0; i < kVehiclesAtOnce && last; ++i) {
      last = store_.PrunePlaces(*last, oldest_ns, ReportTrack::kMaxPlaces);
    }
    store_.Commit();
  } catch (...) {
    store_.Rollback();
    throw;
  }
  pruned_up_to_ = last.value_or("");
  if (last) return;
  walked_ns_ = now_ns;
  const MutexLock lock(mutex_);
  for (auto& [vehicle_id, entry] : entries_) ForgetBefore(entry.track, oldest_ns);
}

void PlaceBook::Forget(const std::string& vehicle_id) {
  uncounted_.erase(vehicle_id);
  const MutexLock lock(mutex_);
  entries_.erase(vehicle_id);
}

/// The vehicle's own, or a new one in the place of the longest silent.
PlaceBook::Entry& PlaceBook::EntryOf(const std::string& vehicle_id) {
  const auto known = entries_.find(vehicle_id);
  if (known != entries_.end()) return known->second;
  ForgetLongestSilent(entries_, config_.max_vehicles);
  return entries_[vehicle_id];
}

std::optional<Refusal> PlaceBook::ChallengePosition(const VehicleState& vehicle) {
  if (auto why = WhyNoPosition(vehicle, config_)) return why;
  if (auto why = WhyStampRefused(vehicle.stamp_ns, config_.limits, config_.limits.max_age_s,
                                 vehicle.heard_ns)) {
    return why;
  }
  const ReportedFix fix{vehicle.stamp_ns, vehicle.position, vehicle.sigma_m};
  const MutexLock lock(mutex_);
  Entry& entry = EntryOf(vehicle.vehicle_id);
  const auto draft = drafts_.find(vehicle.vehicle_id);
  ReportTrack& track = draft != drafts_.end() ? draft->second : entry.track;
  const bool counts = entry.challenged_ns == INT64_MIN || vehicle.heard_ns < entry.challenged_ns ||
                      vehicle.heard_ns - entry.challenged_ns >= kPositionNs;
  std::optional<double> speed_mps;
  if (counts) {
    entry.challenged_ns = vehicle.heard_ns;
    entry.heard_ns = std::max(entry.heard_ns, vehicle.heard_ns);
    speed_mps = zone::Challenge(track, fix, config_.speed, false);
    // Should the draft not hold, the position does.
    if (&track != &entry.track) zone::Challenge(entry.track, fix, config_.speed, false);
  } else {
    ReportTrack trial = track;
    trial.agreeing = 0;
    trial.challenger.reset();
    speed_mps = zone::Challenge(trial, fix, config_.speed, false);
  }
  if (!speed_mps) return std::nullopt;
  return Refusal{RefusalKind::kSpeed, SpeedText(*speed_mps, config_.speed)};
}

bool PlaceBook::HasHeardOf(const std::string& vehicle_id) const {
  {
    const MutexLock lock(mutex_);
    const auto entry = entries_.find(vehicle_id);
    if (entry != entries_.end() &&
        (entry->second.heard_ns != 0 || !entry->second.track.places.empty()))
      return true;
  }
  return !store_.FindPlaces(vehicle_id, 1).empty();
}

}  // namespace livemap::zone
