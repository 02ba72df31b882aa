#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "zone/belief/hazard_evidence.h"
#include "zone/belief/survival_model.h"
#include "zone/belief/trust_update.h"
#include "zone/belief/vehicle_trust.h"
#include "zone/model/presence_record.h"

namespace livemap::zone {

/// "`done` by `official`: `reason`", without the colon where there is no reason; at most 200 bytes.
std::string DecisionText(const std::string& done, const std::string& official,
                         const std::string& reason);

/// A step from one state to another.
struct LifecycleTransition {
  std::optional<HazardState> from;  ///< None: the hazard is new.
  HazardState to = HazardState::kCandidate;
  std::string reason;  ///< One sentence of at most 200 bytes without full stop.
};

/// What came of one call.
struct LifecycleUpdate {
  std::optional<LifecycleTransition> transition;
  bool counted = false;           ///< The evidence moved the odds.
  LifetimeObservation lesson;     ///< For SurvivalModel::Learn, when the step is committed.
  std::vector<Verdict> verdicts;  ///< For VehicleTrust::Judge, likewise.
};

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

/// The rules by which one hazard lives: candidate, active, verifying, gone, rejected.
///
/// The presence probability p is a two-state filter in log odds (as of occupancy grids: Moravec and
/// Elfes, 1985): between words of vehicles p shrinks by the class's survival, p(t + dt) = p(t)
/// S(dt), for what has vanished does not come back; a word adds the logarithm of its likelihood
/// ratio. Rates are of honest vehicles; a share h of malicious ones says what it likes, so the
/// ratio of a yes is ((1-h) hit + h) / ((1-h) false + h). Evidence older than the odds counts less:
/// the hazard may have ended since.
///
/// One vehicle is one voice: all that it says together moves the odds by at most ln((1-h)/h) either
/// way, the second message of a kind adds less than the first, and messages lose nothing by their
/// order. A voice for the hazard fades with the class's life, as what it said ages. Drivers are
/// told when `confirmations` distinct vehicles more speak for a hazard than against it, or an
/// official. It is gone when two distinct vehicles speak against it and p is small, or by time
/// alone: one vehicle can neither confirm nor remove, nor hasten the removal. See
/// docs/explanation/hazard-lifecycle.md.
///
/// How far a vehicle is believed comes with its word (Evidence::malicious): h is the vehicle's own
/// where it is above the share, so its voice has a lower bound, and from `suspect_above` on it
/// counts as no vehicle. What becomes of words teaches that in turn, by verdicts, one per word. A
/// hazard that another vehicle sees when the others make it sure bears out every voice for it and
/// contradicts every voice against it: what is gone does not come back. One that is denied away
/// bears out its opponents, and contradicts its supporters as far as it is likely that they saw
/// nothing, rather than something that ended since. An official's word settles all.
class HazardLifecycle {
 public:
  struct Config {
    double prior_presence = 0.2;      ///< Before the first vehicle speaks.
    double active_above = 0.7;        ///< Drivers are told from this presence on,
    double active_alone_above = 0.5;  ///< and of classes that one vehicle confirms from this one.
    double verify_below = 0.7;        ///< An active hazard is verified below this presence (of
                                      ///< classes that one vehicle confirms: active_alone_above)
    double settled_above = 0.85;      ///< ...and active again from this one on.
    double gone_below = 0.1;          ///< Off the map.
    double max_presence = 0.995;      ///< Presence never counts as more certain than this.
    double malicious_share = 0.05;    ///< h: vehicles that may say what they like.
    double suspect_above = 0.5;       ///< A vehicle this likely malicious is not counted as one.
    double max_trust_step = 1;        ///< No one verdict weighs more, log odds; an official's
    double official_weight = 2;       ///< ...weighs this many times as much as a vehicle's.
    std::uint32_t denying_vehicles = 2;  ///< Distinct vehicles against it before it is gone.
    double quarantine_s = 86400;         ///< A rejected hazard takes no support for this long.
    std::uint32_t reopen_vehicles = 2;   ///< Distinct vehicles that reopen it afterwards.
    double rejected_keep_s =
        90 * 86400.0;  ///< Without support for this long it is forgotten (gone).
  };

  HazardLifecycle();
  /// Throws Error naming the first value that is out of range, and what is accepted.
  explicit HazardLifecycle(const Config& config);

  /// A new hazard's first report. The transition has no `from`; its `to` is active at once where
  /// one vehicle confirms the class.
  LifecycleUpdate Begin(const ClassModel& entry, const Evidence& sighting, std::int64_t now_ns,
                        PresenceRecord& life) const;
  /// A further word, in any order of stamps. Does nothing to a hazard that is gone.
  LifecycleUpdate Apply(const ClassModel& entry, const Evidence& evidence, std::int64_t now_ns,
                        PresenceRecord& life) const;
  /// Time passes. Cheap; nothing happens before NextChangeNs.
  LifecycleUpdate Advance(const ClassModel& entry, std::int64_t now_ns, PresenceRecord& life) const;
  /// An official says that it is there (also revokes a rejection), or that it is not and never was;
  /// `reason` may be empty. Nothing happens to a hazard that is gone; Reject leaves one that is off
  /// the map alone, Confirm has a transition from active to active too.
  LifecycleUpdate Confirm(const ClassModel& entry, const std::string& official,
                          const std::string& reason, std::int64_t now_ns,
                          PresenceRecord& life) const;
  LifecycleUpdate Reject(const ClassModel& entry, const std::string& official,
                         const std::string& reason, std::int64_t now_ns,
                         PresenceRecord& life) const;
  /// As Reject, but the official says that it was there and is repaired: nobody is judged, and
  /// nothing is learned of how long its class lasts by itself.
  LifecycleUpdate Close(const ClassModel& entry, const std::string& official,
                        const std::string& reason, std::int64_t now_ns, PresenceRecord& life) const;
  /// Somebody who should know says that it was repaired, which nobody has looked at: a hazard that
  /// drivers are told of is verified, as likely there as not. That no longer counts as an
  /// official's confirmation. Judges nobody. No transition for any other hazard.
  LifecycleUpdate Doubt(const ClassModel& entry, const std::string& why, std::int64_t now_ns,
                        PresenceRecord& life) const;
  /// All that the vehicle said is taken back: the odds are as if it had said nothing, and a hazard
  /// that no other vehicle saw is gone, one that too few others saw a candidate again. What an
  /// official confirmed stays. The transition, with `why` as its reason, may lead to the same
  /// state; none where the vehicle has no voice, or the hazard is gone.
  LifecycleUpdate Withdraw(const ClassModel& entry, std::uint64_t vehicle, const std::string& why,
                           std::int64_t now_ns, PresenceRecord& life) const;

  /// What was done to the hazard is taken back: it is as in `before`, and what vehicles have said
  /// since, which `life` remembers, counts on top, each by what `malicious_of` says of its vehicle.
  /// Words of vehicles that `withdrawn` names stay away, although `before` has them. The transition
  /// is from the present state, with `why` as its reason; it may lead to the same one. Judges
  /// nobody and teaches nothing: that was done when the words came.
  LifecycleUpdate Reinstate(const ClassModel& entry, const PresenceRecord& before,
                            const std::function<double(std::uint64_t)>& malicious_of,
                            const std::set<std::uint64_t>& withdrawn, const std::string& why,
                            std::int64_t now_ns, PresenceRecord& life) const;

  /// Probability that the hazard is there at `now_ns`, from `life.at_ns` on.
  double Presence(const ClassModel& entry, const PresenceRecord& life, std::int64_t now_ns) const;
  /// When Advance will do something if nobody speaks before; kNever if it will not. To be asked
  /// again after every step. While the class is learned this may come early or late; Advance then
  /// decides by what is known at its own time.
  std::int64_t NextChangeNs(const ClassModel& entry, const PresenceRecord& life) const;

  const Config& config() const { return config_; }

 private:
  void MoveTo(const ClassModel& entry, std::int64_t to_ns, PresenceRecord& life) const;
  double LogRatio(const ClassModel& entry, const Evidence& evidence, double ended_since) const;
  bool ApplyEvidence(const ClassModel& entry, const Evidence& evidence, PresenceRecord& life) const;
  double MaxLogOddsPerVehicle(const Evidence& evidence) const;
  void Settle(const ClassModel& entry, std::int64_t now_ns, PresenceRecord& life,
              LifecycleUpdate& step) const;
  double ActiveAbove(const ClassModel& entry) const;
  double VerifyBelow(const ClassModel& entry) const;
  std::optional<LifecycleTransition> Decide(const ClassModel& entry,
                                            const PresenceRecord& life) const;
  bool IsDeniedAway(const PresenceRecord& life) const;
  std::optional<LifecycleTransition> DecideGone(const PresenceRecord& life) const;
  std::optional<LifecycleTransition> DecideRejected(const PresenceRecord& life) const;

  void TakeBack(const ClassModel& entry, const VehicleEvidence& taken, PresenceRecord& life) const;
  void Demote(const ClassModel& entry, const VehicleEvidence& taken, std::int64_t now_ns,
              PresenceRecord& life) const;

  Config config_;
  TrustUpdate trust_update_;
  double max_log_odds_;  // Of presence, by `max_presence`.
  double max_evidence_;  // Of one vehicle, by `malicious_share`.
};

}  // namespace livemap::zone
