#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <shared_mutex>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "zone/pictures/image_store.h"
#include "zone/pictures/owned_directory.h"
#include "zone/polling/due_queue.h"
#include "zone/registry/hazard_registry.h"
#include "zone/registry/vehicle_table.h"
#include "zone/service/event_stream.h"
#include "zone/service/zone_service.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// An official's reason, cut to an event's length. Throws Error when it or the official's name is
/// no acceptable text; an empty reason is.
std::string CheckedReason(const std::string& official, const std::string& reason,
                          std::size_t max_name_bytes);

/// What stands behind ZoneService; only its own sources include this. Locks are taken in the order
/// writer_mutex_, data_mutex_, polls_mutex_.
class ZoneService::Implementation {
 public:
  using Slot = HazardRegistry::Slot;

  Implementation(Config config, Clock now_ns, std::uint64_t uuid_seed);

  std::vector<protocol::Receipt> HandleBatch(const std::vector<protocol::Report>& reports);
  bool Reject(const Uuid& uuid, const std::string& official, const std::string& reason);
  bool Confirm(const Uuid& uuid, const std::string& official, const std::string& reason);
  std::optional<std::size_t> Distrust(const std::string& vehicle_id, const std::string& official,
                                      const std::string& reason);
  bool Remove(const Uuid& uuid, const std::string& reason);
  std::vector<protocol::Receipt> HandleMapChanges(
      const std::vector<protocol::MapChangeReport>& reports);
  bool DecideMapChange(const Uuid& uuid, MapChangeState to, const std::string& official,
                       const std::string& reason);
  std::vector<StoredMapChangeEvent> MapChangeEvents(const Uuid& uuid, std::size_t limit);
  std::vector<protocol::Poll> TakeDuePolls();
  bool HandleAnswer(const protocol::PollAnswer& answer);
  void Advance();
  bool UpdateVehicle(const VehicleState& told);
  std::vector<StoredEvent> Events(const Uuid& uuid, std::size_t limit);
  ZoneStatistics Statistics() const;

  const Config config_;
  const Clock now_ns_;
  const OwnedDirectory directory_;
  const HazardLifecycle life_;

  /// One writer at a time: owns what follows up to the vehicles, and the right to change what
  /// data_mutex_ guards.
  std::mutex writer_mutex_;
  ZoneStore store_;
  SurvivalModel survival_;
  VehicleTrust trust_;
  VehicleAllowance allowance_;
  VehicleAllowance map_change_allowance_;
  std::unordered_map<std::string, ReportTrack> tracks_;  ///< By vehicle id; the rest is stored.
  DueQueue due_;

  ImageStore images_;
  VehicleTable vehicles_;
  EventStream stream_;

  /// Held exclusively from the first change to the end of its commit, so that no reader ever sees
  /// what is not on disk: guards sequence_, announced_, the registries and statistics_.
  mutable std::shared_mutex data_mutex_;
  std::uint64_t sequence_;
  std::uint64_t announced_ = 0;
  std::mt19937_64 generator_;
  HazardRegistry registry_;
  MapChangeRegistry map_changes_;
  ZoneStatistics statistics_;
  std::atomic<std::uint64_t> vehicle_positions_{0};
  std::atomic<std::uint64_t> vehicle_positions_refused_{0};
  std::atomic<std::uint64_t> store_errors_{0};

  std::mutex polls_mutex_;
  PollScheduler scheduler_;

 private:
  /// A hazard before something happens to it.
  struct Before {
    HazardState state = HazardState::kCandidate;
    std::uint64_t sequence = 0;
    PackedPicture picture;
  };
  struct EventPlace {
    std::uint32_t hazard_id = 0;
    std::uint64_t previous_sequence = 0;  ///< Of the hazard's event before; 0 without one.
  };
  struct AcceptedReport {
    const protocol::Report* report = nullptr;
    std::uint32_t hazard_id = 0;
    std::string image_sha256;
  };
  /// What a transaction changes: kept when its commit succeeds, thrown away when it fails.
  struct Change {
    std::int64_t now_ns = 0;
    std::uint64_t sequence = 0;
    std::uint64_t announced = 0;
    std::vector<HazardEvent> events;
    std::vector<EventPlace> places;                             ///< Of each event.
    std::vector<std::pair<std::string, std::string>> pictures;  ///< Before and after.
    std::vector<Slot> touched;                                  ///< Hazards to write; may repeat.
    std::map<std::string, LearnedLifetime> learned_before;      ///< By class.
    std::map<std::uint64_t, TrustRecord> trust_before;          ///< By vehicle.
    std::vector<AcceptedReport> reports;
    const protocol::PollAnswer* answer = nullptr;
    std::uint32_t answered_id = 0;  ///< Hazard of the answer.
    std::vector<MapChangeEvent> map_change_events;
    std::vector<std::pair<const protocol::MapChangeReport*, Uuid>>
        map_change_reports;  ///< And the feature.
  };
  /// A report that may change the map.
  struct PendingReport {
    std::size_t index = 0;  ///< In the batch.
    PictureName picture;
  };
  /// A batch on its way.
  struct Batch {
    Change change;
    std::vector<std::optional<protocol::Receipt>> receipts;  ///< None: not taken now.
    std::vector<PendingReport> candidates;
    std::unordered_map<Uuid, Uuid> hazard_of_report;
    std::map<std::string, ReportTrack> tracks;  ///< As they will be.
    ZoneStatistics counted;
  };

  /// The same seed gives other ids after a restart: the ids of before are taken.
  static std::mt19937_64 MakeGenerator(std::uint64_t seed, std::uint64_t sequence);
  void Load();

  // Reports: zone_service_reports.cpp.
  void Triage(const std::vector<protocol::Report>& reports, Batch& batch);
  bool Examine(const protocol::Report& report, std::size_t index, Batch& batch);
  std::optional<Refusal> WhyTooFast(const protocol::Report& report, Batch& batch);
  void Refuse(const protocol::Report& report, const Refusal& refusal, std::size_t index,
              Batch& batch);
  ReportTrack& TrackOf(const std::string& vehicle_id, Batch& batch);
  void KeepTracks(const Batch& batch);
  void Apply(const std::vector<protocol::Report>& reports, Batch& batch);
  Slot Register(const protocol::Report& report, const PictureName& picture, Change& change);
  void Sight(Slot slot, const protocol::Report& report, const PictureName& picture, Change& change);
  void Count(const ZoneStatistics& counted);

  // One step of a hazard's life, in a running transaction: zone_service_life.cpp.
  ClassModel ClassOf(Slot slot) const;
  Before BeforeOf(Slot slot) const;
  /// The map's hazard that the report is a sighting of, after time has done what is due to it.
  std::optional<Slot> MatchNow(const protocol::Report& report, Change& change);
  /// Does what time has made due; false when that was nothing.
  bool PassTime(Slot slot, Change& change);
  /// `life` is what `step` made of the hazard's life. Gives the event its own sequence.
  void Step(Slot slot, const PresenceRecord& life, const LifecycleUpdate& step,
            const std::string& reason, const Before& before, Change& change);
  /// The event of what happened to `slot` since `before` (none: it is new); its sequence is the
  /// change's. `tells`: drivers hear of it even when the state stays.
  void RecordEvent(Slot slot, const std::optional<Before>& before, std::string reason, bool tells,
                   Change& change);
  void Learn(const std::string& class_name, const LifetimeObservation& lesson, Change& change);
  /// What the step teaches of vehicles.
  void Judge(const LifecycleUpdate& step, Change& change);
  /// What a vehicle says of a hazard, with how far it is believed.
  Evidence EvidenceOf(EvidenceKind kind, const std::string& vehicle_id, std::int64_t stamp_ns,
                      std::int64_t now_ns) const;
  void Withdraw(Slot slot, std::uint64_t vehicle, const std::string& why, Change& change);
  /// Whether anything at all came from the vehicle.
  bool HasHeardOf(const std::string& vehicle_id);
  /// A decision about one hazard, in a transaction of its own: false when it leads to no
  /// transition.
  template <typename Decision>
  bool Decide(const Uuid& uuid, const Decision& decision);

  // Transactions: zone_service.cpp.
  Change NewChange() const;
  /// When something was seen, by an image's stamp; see Config::replay.
  std::int64_t SeenNs(std::int64_t stamp_ns, std::int64_t now_ns) const {
    return config_.replay ? now_ns : stamp_ns;
  }
  /// Runs `body` between Begin and Commit of store and registry; when anything throws both are as
  /// before. The caller holds writer_mutex_ and, exclusively, data_mutex_.
  template <typename Body>
  void InTransaction(Change& change, const Body& body);
  /// All that changed in memory, to the store.
  void Write(Change& change);
  void Forget(const Change& change);
  /// After data_mutex_ was released: pictures' references, what is due when, subscribers.
  void Settle(const Change& change);
  void Schedule(Slot slot, std::int64_t now_ns);

  // Map changes: zone_service_map_changes.cpp.
  struct MapChangeBatch;
  bool ExamineMapChange(const protocol::MapChangeReport& report, std::size_t index,
                        MapChangeBatch& batch);
  void ApplyMapChange(const protocol::MapChangeReport& report, std::size_t index,
                      MapChangeBatch& batch);
  void WriteMapChanges(const Change& change);
  void CountMapChanges(const MapChangeStatistics& counted);

  // Polls: zone_service_polls.cpp.
  std::optional<PollScheduler::OpenPoll> FindOpenPoll(const Uuid& poll, std::int64_t now_ns);
  bool IsAcceptable(const protocol::PollAnswer& answer, const PollScheduler::OpenPoll& poll,
                    std::int64_t now_ns) const;
  Change CommitAnswer(const protocol::PollAnswer& answer, Slot slot);
  void CountAnswer(bool accepted);
};

template <typename Body>
void ZoneService::Implementation::InTransaction(Change& change, const Body& body) {
  try {
    store_.Begin();
    registry_.Begin();
    map_changes_.Begin();
    try {
      body();
      Write(change);
      store_.Commit();
    } catch (...) {
      store_.Rollback();
      registry_.Rollback();
      map_changes_.Rollback();
      Forget(change);
      throw;
    }
  } catch (const StoreError&) {
    ++store_errors_;
    throw;
  }
  registry_.Commit();
  map_changes_.Commit();
  sequence_ = change.sequence;
  announced_ = change.announced;
}

}  // namespace livemap::zone
