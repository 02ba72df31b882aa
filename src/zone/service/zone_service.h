#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/clock.h"
#include "common/histogram.h"
#include "common/mutex.h"
#include "common/sqlite.h"
#include "geo/geo_box.h"
#include "protocol/map_change_report.h"
#include "protocol/poll.h"
#include "protocol/report.h"
#include "streets/street_place.h"
#include "zone/admission/vehicle_allowance.h"
#include "zone/desk/desk_action.h"
#include "zone/model/decision.h"
#include "zone/model/erasure.h"
#include "zone/model/hazard.h"
#include "zone/model/map_change.h"
#include "zone/model/page.h"
#include "zone/model/vehicle_state.h"
#include "zone/pictures/image_store.h"
#include "zone/pictures/owned_directory.h"
#include "zone/pictures/picture_allowance.h"
#include "zone/places/place_book.h"
#include "zone/registry/shared_view.h"
#include "zone/registry/vehicle_table.h"
#include "zone/service/ageing.h"
#include "zone/service/event_stream.h"
#include "zone/service/hazard_desk.h"
#include "zone/service/hazard_steps.h"
#include "zone/service/map_change_intake.h"
#include "zone/service/map_reader.h"
#include "zone/service/official_actions.h"
#include "zone/service/poll_coordinator.h"
#include "zone/service/report_intake.h"
#include "zone/service/trail_collector.h"
#include "zone/service/vehicle_claims.h"
#include "zone/service/zone_config.h"
#include "zone/service/zone_state.h"
#include "zone/service/zone_statistics.h"
#include "zone/service/zone_transaction.h"

namespace livemap::zone {

/// The zone's state behind one thread-safe door: registry, store, pictures, vehicles, event stream.
///
/// Promises: a COMMITTED receipt is returned only after the report, its hazard and its event are in
/// the database with synchronous=FULL; a report's uuid counts once, also across restarts; a reader
/// never sees what is not committed; events reach subscribers after their commit, in the order of
/// their sequence.
class ZoneService : public MapReader {
 public:
  using Config = ZoneConfig;
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.

  /// Opens or makes the store and loads it; rows of impossible values are left out, left alone and
  /// counted. `uuid_seed` seeds the ids of new hazards: a test gives
  /// a number, a node gives entropy. Throws Error for a bad setting, StoreError for a store that
  /// cannot be used: not writable, corrupt, or of a newer schema.
  ZoneService(Config config, Clock now_ns, std::uint64_t uuid_seed);
  ~ZoneService() override;

  /// Validates, registers or merges, commits; idempotent by uuid. Throws StoreError when the store
  /// fails: then nothing of the report counts, and the vehicle sends it again. Throws Error when
  /// the vehicle's hourly cap is reached: HandleBatch just leaves such a report unanswered.
  protocol::Receipt Handle(const protocol::Report& report);
  /// The same for many in one transaction, in order; one receipt per report in the order of the
  /// reports, but none for a report that is not taken now (see Config::allowance): its
  /// vehicle sends it again. All or nothing when the store fails.
  std::vector<protocol::Receipt> HandleBatch(const std::vector<protocol::Report>& reports);

  /// What vehicles tell of map changes: as HandleBatch, with their own hourly cap
  /// (Config::map_changes_per_hour). A receipt's hazard_uuid is that of the feature.
  std::vector<protocol::Receipt> HandleMapChanges(
      const std::vector<protocol::MapChangeReport>& reports);
  /// Features whose last event is newer than `since_sequence`, in the order of that sequence, at
  /// most `limit`: open ones, with `since_sequence` > 0 the others too. With `states` exactly those
  /// in one of them. Sequences are those of hazards' events, too.
  std::vector<MapChangeFeature> QueryMapChanges(const std::optional<geo::GeoBox>& box,
                                                std::uint64_t since_sequence, std::size_t limit,
                                                const MapChangeStates& states = {}) const;
  /// The next page, of at most `limit`, of a walk over the map changes. Whoever walks until
  /// Sequence() as it was at the start is told each map change once; those that change meanwhile
  /// may be left out and have a newer sequence.
  Page<MapChangeFeature> ReadMapChanges(const Walk<MapChangeState>& walk,
                                        std::size_t limit) const override;
  std::optional<MapChangeFeature> FindMapChange(const Uuid& uuid) const override;
  /// As Events.
  std::vector<StoredMapChangeEvent> MapChangeEvents(const Uuid& uuid, std::size_t limit) const;
  /// An official's decisions, as Confirm and Reject below. None when there is no such feature, or
  /// none to decide about (MapChangeRegistry::Decide).
  std::optional<std::uint64_t> ConfirmMapChange(const Uuid& uuid, const std::string& official,
                                                const std::string& reason = "");
  std::optional<std::uint64_t> DismissMapChange(const Uuid& uuid, const std::string& official,
                                                const std::string& reason);

  /// Hazards whose last event is newer than `since_sequence`, in the order of that sequence, at
  /// most `limit`. Those on the officials' map; gone and rejected ones too when `since_sequence`
  /// > 0, so that a view catches up after a gap. With `states` exactly those in one of them.
  std::vector<Hazard> Query(const std::optional<geo::GeoBox>& box, std::uint64_t since_sequence,
                            std::size_t limit, const HazardStates& states = {}) const;
  /// As ReadMapChanges.
  Page<Hazard> ReadHazards(const Walk<HazardState>& walk, std::size_t limit) const override;
  /// How many hazards are in each state, by HazardState.
  std::array<std::size_t, kHazardStates> HazardCounts() const override;
  /// Hazards that drivers are told of within `radius_m` of `centre`, nearest first, at most
  /// `limit`.
  std::vector<Hazard> QueryNear(const geo::GeoPoint& centre, double radius_m,
                                std::size_t limit) const;
  /// What a vehicle that knows all announcements up to `since_sequence` must hear: hazards within
  /// `radius_m` of `centre` that were announced since, in the order of their last announcement, at
  /// most `limit`. Those that drivers are no longer told of too (IsTold(state) is false), unless
  /// `since_sequence` is 0.
  std::vector<Hazard> ChangedAround(const geo::GeoPoint& centre, double radius_m,
                                    std::uint64_t since_sequence, std::size_t limit) const;
  /// What a map shows that is opened: the zone's bounds where they are set, else where most hazards
  /// are (ViewOf); none while there is nothing. It may be a little old (SharedView).
  std::optional<geo::GeoBox> View() const override;
  /// Also one that is gone or rejected.
  std::optional<Hazard> Find(const Uuid& uuid) const override;
  /// The newest `limit` events of a hazard, oldest of them first; empty for an unknown one. Throws
  /// StoreError. Waits for no writer, unless one commits just now.
  std::vector<StoredEvent> Events(const Uuid& hazard, std::size_t limit) const override;

  /// The audit trail: the newest `limit` decisions of all officials whose id is below `before`, the
  /// newest first. Throws StoreError. Waits for no writer, unless one commits just now.
  std::vector<DecisionRecord> Decisions(std::uint64_t before, std::size_t limit) const;
  /// The first `limit` decisions whose id is above `id`, in the order of their ids. As Decisions.
  std::vector<DecisionRecord> DecisionsAfter(std::uint64_t id, std::size_t limit) const;
  /// The first `limit` events above `sequence` by which drivers are told of a hazard of which they
  /// were not, or by which it leaves the map, in the order of their sequence. As Decisions.
  std::vector<StoredEvent> TurnsAfter(std::uint64_t sequence, std::size_t limit) const;

  /// An official's decisions; they return the decision's id. The same decision by the same official
  /// for the same reason returns the id of the one before, and changes nothing, while it holds.
  /// Each is committed with its event, whose reason names the official (printable UTF-8 of at most
  /// 64 bytes) and gives `reason` as far as 200 bytes go. None when no hazard of that uuid is on
  /// the map (Confirm: or it is rejected, which it revokes). Throw Error for an unacceptable name,
  /// StoreError when the store fails, and DecisionConflict when the hazard has another state than
  /// when it was `seen`, or lies further from where it was than two reports of one hazard may.
  std::optional<std::uint64_t> Reject(const Uuid& hazard, const std::string& official,
                                      const std::string& reason,
                                      const std::optional<SeenHazard>& seen = std::nullopt);
  std::optional<std::uint64_t> Confirm(const Uuid& hazard, const std::string& official,
                                       const std::string& reason = "",
                                       const std::optional<SeenHazard>& seen = std::nullopt);
  /// As Reject: the hazard was there and is repaired.
  std::optional<std::uint64_t> Close(const Uuid& hazard, const std::string& official,
                                     const std::string& reason = "",
                                     const std::optional<SeenHazard>& seen = std::nullopt);
  /// An official comments, assigns, edits or merges a hazard (HazardDesk), or asks for a whole
  /// frame of it (PollCoordinator): committed, with an event where the hazard itself changes.
  /// Returns the decision's id; none for an unknown hazard. Throws Error for what is not
  /// acceptable, DecisionConflict for what does not fit what is there, DecisionTooOften for too
  /// many requests for frames, and StoreError.
  std::optional<std::uint64_t> Act(const Uuid& hazard, const std::string& official,
                                   const DeskAction& action);
  /// The newest `limit` decisions about one hazard, the newest first. Throws StoreError. As Events.
  std::vector<DecisionRecord> DecisionsAbout(const Uuid& hazard, std::size_t limit) const;
  /// Who mends which hazard that is on the map, the first due first. Throws StoreError. As Events.
  std::vector<Assignment> Assignments() const;
  /// The newest `limit` reports of the hazard and of those that were merged into it, the newest
  /// first; empty for an unknown one. Throws StoreError. As Events.
  std::vector<SightingRecord> Sightings(const Uuid& hazard, std::size_t limit) const;
  /// The newest `limit` pictures that came with answers about the hazard and about those that were
  /// merged into it, the newest first; empty for an unknown one. Throws StoreError. As Events.
  std::vector<AnswerPicture> AnswerPictures(const Uuid& hazard, std::size_t limit) const;
  /// The newest request for a whole frame of the hazard (DecisionKind::kAskFrame) and what became
  /// of it; none where nobody has asked. Throws StoreError. As Events.
  std::optional<FrameStatus> FrameOf(const Uuid& hazard) const;
  /// The zone's clock.
  std::int64_t NowNs() const { return now_ns_(); }
  /// An official does not believe a vehicle: it is as suspect as can be, which fades as any
  /// suspicion does, and all that it said is taken back from the hazards that are not gone
  /// (HazardLifecycle::Withdraw), each with an event whose reason names vehicle and official as far
  /// as 200 bytes go. Returns how many hazards that were; none when the zone has never heard of the
  /// vehicle. Some hundred hazards are committed at a time, and reports come between: when it
  /// throws StoreError those before stay changed, and another call does the rest. Throws Error as
  /// Reject does, and DecisionConflict while another decision about the vehicle is carried out.
  std::optional<std::size_t> Distrust(const std::string& vehicle_id, const std::string& official,
                                      const std::string& reason);
  /// Erases all that leads to a vehicle: what it said stands under pseudonyms, another one at each
  /// hazard and map change, so that it counts as it did; its pictures are deleted, and where it
  /// was, what is held against it, and what was decided about it no longer lead to it. Decisions
  /// about it cannot be taken back any more. The trail has a decision `forget` of `by` without the
  /// name, where there was anything. On disk no byte of its name stays in the store. In pieces, as
  /// Distrust; what the vehicle tells meanwhile and afterwards is a new vehicle's. Throws Error for
  /// an unacceptable name `by`, DecisionConflict while a decision about the vehicle is carried out,
  /// and StoreError: then another call with the same pseudonyms does the rest.
  ErasureCounts Forget(const Pseudonyms& names, const std::string& by);
  /// What came of an undo.
  using Undone = OfficialActions::Undone;
  /// Takes the newest confirmation, rejection or repair of the hazard back, or the desk's decision
  /// that is meant or is newer (HazardDesk::MeantBy). Of the former: state, odds, voices and the
  /// official's mark are as before, what vehicles have said since counts on top, and what the
  /// decision held against vehicles or taught of the class is taken back. Committed with an event.
  /// With `meant`, the id of a decision, nothing is taken back unless that is the newest one.
  /// Throws as Reject does.
  Undone Undo(const Uuid& hazard, const std::string& official, const std::string& reason = "",
              std::optional<std::uint64_t> meant = std::nullopt);
  /// The same of a map change.
  Undone UndoMapChange(const Uuid& uuid, const std::string& official,
                       const std::string& reason = "",
                       std::optional<std::uint64_t> meant = std::nullopt);
  /// What Distrust would do now; none when the zone has never heard of the vehicle. Changes
  /// nothing. Throws StoreError.
  std::optional<DistrustPreview> PreviewDistrust(const std::string& vehicle_id) const;
  /// Takes every Distrust of the vehicle back that stands: what it said counts again in the hazards
  /// from which it was withdrawn, each with an event, and what is held against it is what it was.
  /// Returns how many hazards that were; 0 when none stands; none when the zone has never heard of
  /// the vehicle. In pieces, as Distrust.
  std::optional<std::size_t> Trust(const std::string& vehicle_id, const std::string& official,
                                   const std::string& reason = "");

  /// Somebody says that the hazard was repaired: one that drivers are told of is verified, so that
  /// the next vehicles that pass are asked (HazardLifecycle::Doubt). False where there is none
  /// such.
  bool Verify(const Uuid& hazard, const std::string& why);

  /// Takes a hazard off the map for good. False when none of that uuid is on the map.
  bool Remove(const Uuid& hazard, const std::string& reason);

  /// Polls to be sent now; each is remembered until it is answered or expires. They are not stored:
  /// after a restart the zone asks anew.
  std::vector<protocol::Poll> TakeDuePolls();
  /// Counts the answer and commits what follows. False, and counted, when the answer is not
  /// acceptable: the poll is unknown, expired or another vehicle's, its stamp is off, or that
  /// vehicle cannot have seen the place by the positions that the zone knows. Throws StoreError:
  /// then the poll stays open.
  bool HandleAnswer(const protocol::PollAnswer& answer);
  /// Time passes: tells subscribers of positions that they have not heard of, commits the
  /// transitions that are due, and forgets where vehicles were too long ago. To be called about
  /// once a second. Throws StoreError: then what failed has not happened, and is tried again.
  void Advance();
  /// Looks whether the store can be used: by a question, and where it did not keep or answer the
  /// last time by a transaction that changes nothing. IsStoreWell says so from then on. To be
  /// called about once a second, so that it is known when nobody writes. Throws StoreError: it
  /// cannot be used.
  void CheckStore();

  /// File of a stored picture; only 64 lower-case hex digits name one.
  std::optional<std::string> ImagePath(const std::string& sha256) const;

  /// Remembers where a vehicle is and tells subscribers, of one vehicle four times a second at most
  /// (VehicleTable::kTellNs): of what comes faster they hear the newest, by Advance at the latest.
  /// False, and counted by its kind, when it is no acceptable position: ids or numbers, a stamp out
  /// of the window, or a place that the vehicle cannot have reached by all that it told before
  /// (PlaceBook).
  bool UpdateVehicle(const VehicleState& vehicle);
  /// Vehicles heard of within the retention time, by id.
  std::vector<VehicleState> Vehicles() const;
  /// The first `limit` of them whose id comes after `id`.
  std::vector<VehicleState> VehiclesAfter(const std::string& id, std::size_t limit) const override;

  /// `subscriber` is called from whichever thread commits, one call at a time. It may read from
  /// this service but must neither write to it nor (un)subscribe.
  int Subscribe(Subscriber subscriber) override;
  /// When this returns the subscriber is not running and will not be called again.
  void Unsubscribe(int id) override;

  /// Of the newest committed event; 0 when nothing ever happened. Waits for nothing, not for the
  /// disk either.
  std::uint64_t Sequence() const override { return sequence_; }
  Uuid LogId() const override { return log_id_; }
  /// Of the newest event that drivers were told; 0 without one. As Sequence.
  std::uint64_t AnnouncedSequence() const { return announced_; }
  ZoneStatistics Statistics() const;
  /// Whether the store kept the newest transaction and answered the newest CheckStore, and has left
  /// neither without an answer for 5 s; true before the first one. Waits for nothing.
  bool IsStoreWell() const;
  /// Under which the zone writes; null: no other process waits to take over.
  const ZoneLease* lease() const { return config_.lease.get(); }
  /// Whether this process may speak for the zone: false while its lease may be another's.
  bool IsActive() const { return !config_.lease || config_.lease->IsHeld(); }
  /// How long the transactions of reports took.
  DurationHistogram::Counts commit_times() const { return commit_times_.counts(); }
  /// Of committed reports, from their image's stamp to the commit. Not of drives that are played
  /// back (ZoneConfig::replay).
  DurationHistogram::Counts report_ages() const { return report_ages_.counts(); }
  /// The streets that the zone knows; null: none. They do not change.
  const streets::StreetMap* streets() const override { return config_.streets.get(); }
  /// Where on them the hazard lies; nothing but a note where the zone knows none. Quick, any
  /// thread.
  streets::StreetWords WordsOf(const Hazard& hazard) const override;

 private:
  using Slot = HazardRegistry::Slot;

  /// What a reader may read: all but what ZoneState keeps for the writer.
  const ZoneState& StateForReaders() const REQUIRES_SHARED(data_mutex_) { return state_; }
  /// What the writer may read, and change in a transaction.
  ZoneState& StateForWriter() REQUIRES(writer_mutex_) { return state_; }
  const ZoneState& StateForWriter() const REQUIRES(writer_mutex_) { return state_; }

  /// Runs the transaction and counts a failure of the store.
  template <typename Body>
  void Commit(ZoneTransaction& transaction, const Body& body) REQUIRES(writer_mutex_, data_mutex_);
  /// Notes whether the store could be used for `body`.
  template <typename Body>
  void AskStore(const Body& body) REQUIRES(writer_mutex_);
  /// What follows from a committed transaction: the pictures' references, when its hazards change
  /// and are asked about next, and events for subscribers.
  void FollowUp(const ZoneTransaction& transaction) REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  void Schedule(Slot slot, std::int64_t now_ns) REQUIRES(writer_mutex_);
  void PublishVehicle(VehicleState vehicle) REQUIRES(telling_mutex_);
  void LetHazardsAge() REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  void CompleteTrails() REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  template <typename Decide>
  std::optional<std::uint64_t> DecideHazard(const Decide& decide);
  template <typename Change>
  std::uint64_t ChangeAtDesk(const Change& change) REQUIRES(writer_mutex_) EXCLUDES(data_mutex_);
  std::optional<Undone> UndoAtDesk(const Uuid& hazard, const std::string& official,
                                   const std::string& why, std::optional<std::uint64_t> meant);
  std::optional<std::uint64_t> DecideMapChange(const Uuid& uuid, MapChangeState to,
                                               const std::string& official,
                                               const std::string& reason);
  std::vector<Uuid> WithMerged(const Uuid& hazard, std::size_t limit) const;
  const ZoneStore& HistoryStore() const EXCLUDES(data_mutex_);
  /// The parts of Forget, each in pieces.
  void ForgetEvidence(const Pseudonyms& names, ErasureWalk& walk) EXCLUDES(writer_mutex_);
  void ForgetMapChanges(const Pseudonyms& names, ErasureWalk& walk) EXCLUDES(writer_mutex_);
  void ForgetRows(const Pseudonyms& names, ErasureWalk& walk) EXCLUDES(writer_mutex_);
  void ForgetAnswerPictures(ErasureWalk& walk) EXCLUDES(writer_mutex_);
  void ForgetForGood(const Pseudonyms& names, const ErasureCounts& counts, const std::string& by)
      EXCLUDES(writer_mutex_);
  bool HasHeardOf(const std::string& vehicle_id) const REQUIRES(writer_mutex_);
  std::optional<geo::GeoBox> MakeView() const EXCLUDES(data_mutex_);
  void CountAnswer(bool accepted) EXCLUDES(data_mutex_);
  void NoteAges(const ReportIntake::Batch& batch, std::int64_t now_ns);

  const ZoneConfig config_;
  const Clock now_ns_;
  const Uuid log_id_;
  const OwnedDirectory directory_;

  // Locks are taken in the order writer_mutex_, data_mutex_, then those that parts own: of the
  // polls' scheduler, the pictures, the vehicles and the subscribers.

  /// One writer at a time: owns state_ as ZoneState says, and the collaborators.
  mutable Mutex writer_mutex_ ACQUIRED_BEFORE(data_mutex_);
  /// Held exclusively from the first change to the end of its commit, so that no reader ever sees
  /// what is not on disk.
  mutable SharedMutex data_mutex_;
  /// Guarded by both, as ZoneState says. One of two locks is enough to read it, which GUARDED_BY
  /// cannot express: it is used by StateForReaders and StateForWriter alone.
  ZoneState state_;
  ZoneStatistics statistics_ GUARDED_BY(data_mutex_);
  // As in state_. Set before data_mutex_ is let go: who reads one finds all up to it.
  std::atomic<std::uint64_t> sequence_{0};
  std::atomic<std::uint64_t> announced_{0};

  // Thread-safe each by itself.
  VehicleClaims claims_;
  mutable SharedView view_;
  ImageStore images_;
  VehicleTable vehicles_;
  EventStream stream_;
  /// From the choice of a position to its way to subscribers: of one vehicle the newest one is told
  /// last. No other lock is taken under it but those of the vehicles and of the subscribers.
  Mutex telling_mutex_;
  std::atomic<std::uint64_t> vehicle_positions_{0};
  std::array<std::atomic<std::uint64_t>, kRefusalKinds> positions_refused_{};
  std::atomic<std::uint64_t> store_errors_{0};
  std::atomic<bool> store_well_{true};
  std::atomic<std::int64_t> store_asked_ns_{0};  ///< SteadyNs; 0: it owes no answer.
  DurationHistogram commit_times_;
  DurationHistogram report_ages_;

  // Collaborators on the state. Two of them have a function that wants no lock; for their other
  // functions the writer's lock is held, too.
  PlaceBook places_;  ///< ChallengePosition: any thread.
  VehicleAllowance allowance_ GUARDED_BY(writer_mutex_);
  PictureAllowance pictures_;  ///< refused: any thread.
  HazardSteps steps_ GUARDED_BY(writer_mutex_);
  TrailCollector trails_ GUARDED_BY(writer_mutex_);
  ReportIntake reports_ GUARDED_BY(writer_mutex_);
  MapChangeIntake map_changes_ GUARDED_BY(writer_mutex_);
  PollCoordinator polls_;      ///< SetVehicle: any thread.
  OfficialActions officials_;  ///< CheckedReason: any thread.
  HazardDesk desk_ GUARDED_BY(writer_mutex_);
  Ageing ageing_ GUARDED_BY(writer_mutex_);
};

template <typename Body>
void ZoneService::AskStore(const Body& body) {
  store_asked_ns_ = SteadyNs();
  try {
    body();
  } catch (const StoreError&) {
    store_well_ = false;
    store_asked_ns_ = 0;
    throw;
  } catch (...) {
    store_asked_ns_ = 0;
    throw;
  }
  store_well_ = true;
  store_asked_ns_ = 0;
}

template <typename Body>
void ZoneService::Commit(ZoneTransaction& transaction, const Body& body) {
  try {
    AskStore([&] { transaction.Run(body); });
  } catch (const StoreError&) {
    ++store_errors_;
    throw;
  }
  sequence_ = StateForReaders().sequence;
  announced_ = StateForReaders().announced;
}

}  // namespace livemap::zone
