// How ZoneService forgets a vehicle.
#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

// What one step takes of the writer's time: reports wait meanwhile.
constexpr std::size_t kMaxErasedHazards = 500;
constexpr std::size_t kMaxErasureLooks = 100'000;
constexpr MapChangeRegistry::Id kMaxErasedMapChanges = 2000;
/// Between two steps: a lock that is taken again at once lets nobody in.
constexpr std::chrono::milliseconds kErasurePause{2};
constexpr int kEmptyLogTries = 50;
constexpr std::chrono::milliseconds kEmptyLogPause{100};

bool HasVoiceOf(const PresenceRecord& life, std::uint64_t vehicle) {
  return std::any_of(life.voices.begin(), life.voices.end(),
                     [&](const VehicleEvidence& voice) { return voice.vehicle == vehicle; });
}

}  // namespace

ErasureCounts ZoneService::Forget(const Pseudonyms& names, const std::string& by) {
  officials_.CheckedReason(by, "");
  const VehicleClaims::Claim claim(claims_, names.vehicle_id());
  vehicles_.Forget(names.vehicle_id());
  ErasureWalk walk;
  ForgetEvidence(names, walk);
  ForgetMapChanges(names, walk);
  while (walk.part != ErasureWalk::Part::kDone) {
    const ErasureWalk::Part part = walk.part;
    ForgetRows(names, walk);
    const bool has_all_reports =
        part == ErasureWalk::Part::kReports && walk.part != ErasureWalk::Part::kReports;
    if (has_all_reports) ForgetAnswerPictures(walk);
    std::this_thread::sleep_for(kErasurePause);
  }
  ForgetForGood(names, walk.counts, by);
  vehicles_.Forget(names.vehicle_id());
  ZoneEvent message;
  message.forgotten = names.vehicle_id();
  stream_.Publish(message);
  return walk.counts;
}

/// The hazards' own records, gone ones' too, in memory and on disk.
void ZoneService::ForgetEvidence(const Pseudonyms& names, ErasureWalk& walk) {
  Slot next = 0;
  for (bool is_last = false; !is_last; std::this_thread::sleep_for(kErasurePause)) {
    const MutexLock writer(writer_mutex_);
    ZoneState& state = StateForWriter();
    std::vector<Slot> slots;
    const std::size_t size = state.hazards.size();
    for (std::size_t looks = 0;
         next < size && looks < kMaxErasureLooks && slots.size() < kMaxErasedHazards; ++looks) {
      if (HasVoiceOf(state.hazards.Record(next).life, names.key())) slots.push_back(next);
      ++next;
    }
    is_last = next >= size;
    if (slots.empty()) continue;
    ZoneTransaction transaction(state, now_ns_());
    {
      const WriterLock lock(data_mutex_);
      Commit(transaction, [&] {
        for (const Slot slot : slots) {
          const std::string about = state.hazards.Record(slot).uuid.ToString();
          state.hazards.RenameVoice(slot, names.key(), names.KeyFor(about));
          transaction.KeepHazard(slot);
        }
      });
    }
    FollowUp(transaction);
    walk.counts.hazards += slots.size();
  }
}

void ZoneService::ForgetMapChanges(const Pseudonyms& names, ErasureWalk& walk) {
  MapChangeRegistry::Id next = 1;
  for (bool is_last = false; !is_last; std::this_thread::sleep_for(kErasurePause)) {
    const MutexLock writer(writer_mutex_);
    ZoneState& state = StateForWriter();
    ZoneTransaction transaction(state, now_ns_());
    {
      const WriterLock lock(data_mutex_);
      Commit(transaction, [&] {
        walk.counts.hazards += state.map_changes.RenameWitness(names, next, kMaxErasedMapChanges);
      });
    }
    is_last = next > state.map_changes.last_id();
  }
}

/// A step in the store, and what memory has of it.
void ZoneService::ForgetRows(const Pseudonyms& names, ErasureWalk& walk) {
  const MutexLock writer(writer_mutex_);
  ZoneState& state = StateForWriter();
  const ErasureWalk::Part part = walk.part;
  state.store.Begin();
  try {
    state.store.EraseStep(names, walk);
    // Before the rows forget which they are.
    for (const std::string& picture : walk.pictures) {
      walk.counts.pictures += images_.Remove(picture) ? 1 : 0;
    }
    state.store.Commit();
  } catch (...) {
    state.store.Rollback();
    throw;
  }
  if (part == ErasureWalk::Part::kTrust) {
    const WriterLock lock(data_mutex_);
    state.trust.Forget(names.key(), names.KeyFor("trust"));
  }
  if (part == ErasureWalk::Part::kPlaces) places_.Forget(names.vehicle_id());
}

/// Answers of before schema 9 do not say which picture they came with. A hazard about which the
/// vehicle was asked, and whose picture is of no report, may show one of them.
void ZoneService::ForgetAnswerPictures(ErasureWalk& walk) {
  if (walk.answered.empty()) return;
  Slot next = 0;
  for (bool is_last = false; !is_last; std::this_thread::sleep_for(kErasurePause)) {
    const MutexLock writer(writer_mutex_);
    const ZoneState& state = StateForWriter();
    const std::size_t size = state.hazards.size();
    for (std::size_t looks = 0; next < size && looks < kMaxErasureLooks; ++looks, ++next) {
      const HazardRecord& record = state.hazards.Record(next);
      if (walk.answered.count(static_cast<long long>(record.id)) == 0) continue;
      const std::string picture = record.picture.Sha256();
      if (picture.empty() || walk.reported_pictures.count(picture) != 0) continue;
      walk.counts.pictures += images_.Remove(picture) ? 1 : 0;
    }
    is_last = next >= size;
  }
}

/// The trail says that something was erased, and the log keeps no row as it was.
void ZoneService::ForgetForGood(const Pseudonyms& names, const ErasureCounts& counts,
                                const std::string& by) {
  if (counts.rows() > 0 || counts.pictures > 0) {
    DecisionRecord record;
    record.kind = DecisionKind::kForgetVehicle;
    record.subject = names.IdFor("decisions");
    record.official = by;
    record.hazards = counts.hazards;
    record.at_ns = now_ns_();
    const MutexLock writer(writer_mutex_);
    ZoneStore& store = StateForWriter().store;
    store.Begin();
    try {
      store.WriteDecision(record);
      store.Commit();
    } catch (...) {
      store.Rollback();
      throw;
    }
  }
  for (int i = 0; i < kEmptyLogTries; ++i) {
    {
      const MutexLock writer(writer_mutex_);
      if (StateForWriter().store.EmptyLog()) return;
    }
    std::this_thread::sleep_for(kEmptyLogPause);
  }
  throw StoreError(
      "store: others read the database all the time, so that its log cannot be emptied");
}

}  // namespace livemap::zone
