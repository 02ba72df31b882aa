#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "protocol/map_change_report.h"
#include "protocol/poll.h"
#include "protocol/report.h"
#include "zone/belief/survival_model.h"
#include "zone/belief/vehicle_trust.h"
#include "zone/model/decision.h"
#include "zone/model/hazard.h"
#include "zone/model/map_change.h"
#include "zone/registry/hazard_registry.h"
#include "zone/service/zone_state.h"

namespace livemap::zone {

/// One transaction on the zone's state: either everything that happened in it is on disk and in
/// memory, or nothing is in either. It also collects what follows from it once it is committed:
/// the events for subscribers and the hazards to schedule anew.
///
/// Not thread-safe. Whoever runs it holds the writer's lock, and the data lock exclusively during
/// Run, so that no reader ever sees what is not on disk.
///
/// Typical usage:
///   ZoneTransaction transaction(state, now_ns);
///   transaction.Run([&] { reports.Apply(batch, transaction); });
///   for (const HazardEvent& event : transaction.hazard_events()) Publish(event);
class ZoneTransaction {
 public:
  using Slot = HazardRegistry::Slot;

  /// A hazard before something happens to it.
  struct Before {
    HazardState state = HazardState::kCandidate;
    std::uint64_t sequence = 0;
    PackedPicture picture;
  };
  /// SHA-256 of the picture that a hazard on the map showed before and after; empty without one.
  using PictureChange = std::pair<std::string, std::string>;

  /// `now_ns`: the zone's clock, the time of everything in the transaction.
  ZoneTransaction(ZoneState& state, std::int64_t now_ns);

  /// Begins, runs `body`, writes what it did and commits. When anything throws, registries,
  /// survival model, trust and store are as before. To be called at most once.
  template <typename Body>
  void Run(const Body& body);

  std::int64_t now_ns() const { return now_ns_; }

  // The functions below are for `body`.

  /// Takes the next event's sequence.
  std::uint64_t TakeSequence() { return ++sequence_; }
  /// Sequence of the newest event, this transaction's included.
  std::uint64_t sequence() const { return sequence_; }
  /// The survival model learns a lifetime of the class.
  void Learn(const std::string& class_name, const LifetimeObservation& lesson);
  /// The verdicts count for or against their vehicles.
  void Judge(const std::vector<Verdict>& verdicts);
  /// The survival model forgets a lesson that it learned.
  void Unlearn(const std::string& class_name, const LifetimeObservation& lesson);
  /// The vehicle is as suspect as can be.
  void Distrust(std::uint64_t vehicle);
  /// What is held against the vehicle is this again.
  void RestoreTrust(std::uint64_t vehicle, const TrustRecord& record);
  /// What was added to the vehicle's suspicion at `at_ns` is taken back.
  void TakeBackSuspicion(const SuspicionChange& change, std::int64_t at_ns);

  Before BeforeOf(Slot slot) const;
  /// The event of what happened to `slot` since `before` (none: it is new); its sequence is the
  /// newest one. `tells`: drivers hear of it even when the state stays. `reason` is cut to an
  /// event's length.
  void RecordHazardEvent(Slot slot, const std::optional<Before>& before, std::string reason,
                         bool tells);
  /// A new hazard was reported under this name, whatever the catalogue calls it now: the store
  /// keeps the name, so that one start with a wrong catalogue loses none.
  void NameHazard(Slot slot, const std::string& reported_class);
  /// The hazard's class is another one now: in the store too, which else keeps the first name.
  void RenameHazard(Slot slot) { renamed_.insert(slot); }
  /// The hazard's row is written as it is in the end, without an event.
  void KeepHazard(Slot slot) { touched_.push_back(slot); }
  /// The hazard is passed in this direction: in memory and in the store.
  void KeepCourse(Slot slot, double course_rad);
  /// Vehicles passed the hazard by these trails: the same.
  void KeepTrails(Slot slot, std::vector<protocol::Trail> trails);
  /// The event, whose sequence was `sequence() + 1`.
  void RecordMapChangeEvent(MapChangeEvent event);

  /// What vehicles sent is kept with what became of it. Reports and answers outlive the
  /// transaction.
  void KeepReport(const protocol::Report& report, std::uint32_t hazard_id,
                  const std::string& image_sha256);
  void KeepAnswer(const protocol::PollAnswer& answer, std::uint32_t hazard_id);
  /// The kept answer's picture, which is on disk, and the decision whose request's whole frame it
  /// is; 0: of none.
  void KeepAnswerPicture(const std::string& image_sha256, std::uint64_t decision);
  void KeepMapChangeReport(const protocol::MapChangeReport& report, const Uuid& feature);

  // After Run: what followed.

  const std::vector<HazardEvent>& hazard_events() const { return hazard_events_; }
  const std::vector<MapChangeEvent>& map_change_events() const { return map_change_events_; }
  const std::vector<PictureChange>& pictures() const { return pictures_; }
  /// Every changed hazard once.
  const std::vector<Slot>& touched() const { return touched_; }

 private:
  struct EventPlace {
    std::uint32_t hazard_id = 0;
    std::uint64_t previous_sequence = 0;  ///< Of the hazard's event before; 0 without one.
  };
  struct AcceptedReport {
    const protocol::Report* report = nullptr;
    std::uint32_t hazard_id = 0;
    std::string image_sha256;
  };

  void Begin();
  void Commit();
  void Rollback();
  void Write();
  void WriteMapChanges();

  ZoneState& state_;
  const std::int64_t now_ns_;
  std::uint64_t sequence_;
  std::uint64_t announced_;
  std::vector<HazardEvent> hazard_events_;
  std::vector<EventPlace> places_;  ///< Of each hazard event.
  std::vector<PictureChange> pictures_;
  std::vector<Slot> touched_;                     ///< Repeats until it is written.
  std::map<Slot, std::string> reported_classes_;  ///< Of new hazards.
  std::set<Slot> renamed_;
  std::map<Slot, double> courses_;  ///< Of hazards that had none.
  std::map<Slot, std::vector<protocol::Trail>> trails_before_;
  std::map<std::string, LearnedLifetime> learned_before_;  ///< By class.
  std::map<std::uint64_t, TrustRecord> trust_before_;      ///< By vehicle.
  std::vector<AcceptedReport> reports_;
  const protocol::PollAnswer* answer_ = nullptr;
  std::uint32_t answered_id_ = 0;     ///< Hazard of the answer.
  std::string answer_picture_;        ///< SHA-256; empty: none.
  std::uint64_t frame_decision_ = 0;  ///< Of the answer's picture.
  std::vector<MapChangeEvent> map_change_events_;
  std::vector<std::pair<const protocol::MapChangeReport*, Uuid>>
      map_change_reports_;  ///< And the feature.
};

template <typename Body>
void ZoneTransaction::Run(const Body& body) {
  Begin();
  try {
    body();
    Write();
    state_.store.Commit();
  } catch (...) {
    Rollback();
    throw;
  }
  Commit();
}

}  // namespace livemap::zone
