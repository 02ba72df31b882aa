#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <random>
#include <shared_mutex>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "zone/event_stream.h"
#include "zone/hazard_registry.h"
#include "zone/image_store.h"
#include "zone/owned_directory.h"
#include "zone/speed_rule.h"
#include "zone/vehicle_table.h"
#include "zone/zone_service.h"
#include "zone/zone_store.h"

namespace livemap {

/// What stands behind ZoneService; only its own sources include this.
class ZoneService::Implementation {
 public:
  using Slot = HazardRegistry::Slot;

  Implementation(Config config, Clock now_ns, std::uint64_t uuid_seed);

  std::vector<Receipt> HandleBatch(const std::vector<Report>& reports);
  bool Reject(const Uuid& uuid, const std::string& official, const std::string& reason);
  bool Confirm(const Uuid& uuid, const std::string& official);
  bool Remove(const Uuid& uuid, const std::string& reason);
  std::vector<PollOrder> TakeDuePolls();
  bool HandleAnswer(const PollAnswer& answer);
  void Advance();
  bool UpdateVehicle(const VehicleState& told);
  std::vector<StoredEvent> Events(const Uuid& uuid, std::size_t limit) const;
  ZoneStatistics Statistics() const;

  const Config config_;
  const Clock now_ns_;
  const OwnedDirectory directory_;

  /// One writer at a time: owns store_, generator_, tracks_ and the right to change what
  /// data_mutex_ guards.
  mutable std::mutex writer_mutex_;
  mutable ZoneStore store_;
  ImageStore images_;
  VehicleTable vehicles_;
  EventStream stream_;
  std::unordered_map<std::string, ReportTrack> tracks_;  ///< By vehicle id.

  /// Held exclusively from the first change to the end of its commit, so that no reader ever sees
  /// what is not on disk: guards sequence_, announced_, registry_ and statistics_.
  mutable std::shared_mutex data_mutex_;
  std::uint64_t sequence_;
  std::uint64_t announced_;
  std::mt19937_64 generator_;
  HazardRegistry registry_;
  ZoneStatistics statistics_;
  std::atomic<std::uint64_t> vehicle_positions_{0};
  std::atomic<std::uint64_t> vehicle_positions_refused_{0};
  std::atomic<std::uint64_t> store_errors_{0};

 private:
  /// What a transaction changes: kept when its commit succeeds, thrown away when it fails.
  struct Change {
    std::uint64_t sequence = 0;
    std::uint64_t announced = 0;
    std::vector<HazardEvent> events;
    std::vector<std::pair<std::string, std::string>> pictures;  ///< Before and after.
    std::vector<Slot> touched;                                  ///< Hazards to write; may repeat.
  };
  /// A report that may change the map.
  struct Candidate {
    std::size_t index = 0;  ///< In the batch.
    PictureName picture;
  };
  /// A batch on its way.
  struct Batch {
    Change change;
    std::vector<std::optional<Receipt>> receipts;  ///< None: not taken now.
    std::vector<Candidate> candidates;
    std::unordered_map<Uuid, Uuid> hazard_of_report;
    std::unordered_map<std::string, ReportTrack> tracks;  ///< As they will be.
    ZoneStatistics counted;
  };

  /// The same seed gives other ids after a restart: the ids of before are taken.
  static std::mt19937_64 MakeGenerator(std::uint64_t seed, std::uint64_t sequence);

  void Triage(const std::vector<Report>& reports, Batch& batch);
  std::optional<Refusal> WhyNot(const Report& report, std::int64_t now_ns, Batch& batch);
  void Refuse(const Report& report, const Refusal& refusal, std::size_t index, Batch& batch);
  ReportTrack& TrackOf(const std::string& vehicle_id, Batch& batch);
  void Apply(const std::vector<Report>& reports, Batch& batch);
  void Register(const Report& report, const PictureName& picture, std::optional<Slot> match,
                Batch& batch);
  void Count(const ZoneStatistics& counted);

  /// Takes one hazard to `state` in a transaction of its own; the reason is cut to what is kept.
  Change Decide(Slot slot, HazardState state, const std::string& reason);

  Change NewChange() const;
  /// The event of what just happened to `slot`, whose sequence is the change's.
  void NoteEvent(Slot slot, HazardAction action, std::optional<HazardState> from,
                 std::string reason, Change& change);
  /// Runs `body` between Begin and Commit of store and registry; when anything throws both are as
  /// before. The caller holds both locks.
  template <typename Body>
  void InTransaction(Change& change, const Body& body);
  void WriteTouched(Change& change);
  /// After the locks of data: pictures' references, subscribers.
  void Settle(const Change& change);
};

template <typename Body>
void ZoneService::Implementation::InTransaction(Change& change, const Body& body) {
  try {
    store_.Begin();
    registry_.Begin();
    try {
      body();
      WriteTouched(change);
      store_.Commit();
    } catch (...) {
      store_.Rollback();
      registry_.Rollback();
      throw;
    }
  } catch (const StoreError&) {
    ++store_errors_;
    throw;
  }
  registry_.Commit();
  sequence_ = change.sequence;
  announced_ = change.announced;
}

}  // namespace livemap
