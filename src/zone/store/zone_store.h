#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/map_change_report.h"
#include "protocol/report.h"
#include "zone/admission/speed_rule.h"
#include "zone/belief/hazard_lifecycle.h"
#include "zone/belief/survival_model.h"
#include "zone/belief/vehicle_trust.h"
#include "zone/desk/desk_action.h"
#include "zone/desk/frame_request.h"
#include "zone/desk/redirects.h"
#include "zone/model/decision.h"
#include "zone/model/erasure.h"
#include "zone/model/hazard.h"
#include "zone/model/map_change.h"
#include "zone/model/store_damage.h"

namespace livemap::protocol {
struct PollAnswer;
}

namespace livemap::zone {

/// A hazard from which a vehicle's words were withdrawn, with its life of before.
struct Withdrawal {
  Uuid hazard;
  std::string before;  ///< PackPresence.
};

/// Whether the database, named as for ZoneStore's constructor, holds a store. Makes nothing. Throws
/// StoreError when the server does not say.
///
/// Typical usage:
///   if (!HoldsStore(url)) throw Error("'" + url + "' holds no store");
bool HoldsStore(const std::string& database);

/// The zone's database: hazards as they are, every accepted report and answer, every event, what
/// was learned of classes and of vehicles, where each vehicle was, and the same of map changes.
/// Through SOCI in SQLite, in WAL mode with synchronous=FULL, or in PostgreSQL with
/// synchronous_commit. Not thread-safe: one writer owns it.
/// Only those that say so, LoadEvents and LoadMapChangeEvents may be called by any thread at any
/// time: they read what is committed, over a connection of their own, so that nobody who reads a
/// history keeps the writer waiting.
///
/// Every function throws StoreError with the database's own words when it fails. A server that goes
/// away makes them fail until it is back; the next call connects again. Then nothing of the running
/// transaction is there: even where the server had gone while it committed, Commit throws only if
/// it did not. Where that cannot be told in time, or somebody else has written, every further
/// function throws, as what is in the zone's memory is not what the database holds.
class ZoneStore {
 public:
  /// Opens the database and brings its schema up to date: the SQLite file at this path, which is
  /// made when missing, or what a `postgresql://` URL names (CheckedPostgresqlUrl). Refuses files
  /// that are damaged, no database at all, or of a newer schema than this program knows, and a
  /// PostgreSQL database that another store has open.
  /// `lease_epoch`: of the ZoneLease under which it is written, in PostgreSQL alone; 0: none. Once
  /// another process has the lease, the constructor, and Commit for good, throw LeaseLost, and
  /// nothing of the transaction is there.
  explicit ZoneStore(const std::string& database, std::uint64_t lease_epoch = 0);
  ~ZoneStore();
  ZoneStore(const ZoneStore&) = delete;
  ZoneStore& operator=(const ZoneStore&) = delete;

  /// A hazard with its life; `id` numbers the rows, from 1.
  struct HazardRow {
    std::uint64_t id = 0;
    Hazard hazard;
    PresenceRecord life;
  };
  /// Every hazard, in ascending order of sequence. One of an older schema gets a life that says
  /// what that schema knew. What the four Load functions give to `take` is sound; a row that the
  /// program cannot have written, or for which `take` throws Error, is left out and told.
  StoreDamage LoadHazards(const std::function<void(HazardRow)>& take);
  /// The directions in which hazards are passed, by id of the hazard, radians clockwise from north.
  StoreDamage LoadCourses(const std::function<void(std::uint64_t, double)>& take);
  /// How vehicles passed hazards, by id of the hazard.
  StoreDamage LoadTrails(
      const std::function<void(std::uint64_t, std::vector<protocol::Trail>)>& take);
  StoreDamage LoadLives(const std::function<void(const std::string&, LearnedLifetime)>& take);
  StoreDamage LoadTrust(const std::function<void(std::uint64_t, const TrustRecord&)>& take);
  /// The greatest id that a row of a hazard has, sound or not; 0 without rows. What lies beyond the
  /// ids that hazards can have is passed over.
  std::uint64_t LastHazardId();
  /// Of the newest event of a hazard or a map change; 0 without events.
  std::uint64_t LastSequence();
  struct KnownReport {
    Uuid hazard;  ///< What it became or was merged into; nil when its hazard's row is broken.
    std::string vehicle_id;
  };
  /// Which of these reports are committed, in their order.
  std::vector<std::optional<KnownReport>> FindReports(const std::vector<Uuid>& reports);
  /// Where vehicles were (PlaceBook): every sound row, of no vehicle twice at one stamp; those of
  /// one vehicle follow each other, the newest first.
  StoreDamage LoadPlaces(const std::function<void(const std::string&, KnownPlace)>& take);
  /// The newest `limit` of one vehicle, the newest first; broken rows are left out.
  std::vector<KnownPlace> FindPlaces(const std::string& vehicle_id, std::size_t limit);
  /// The newest `limit` events of a hazard whose newest one is `sequence`, oldest first; broken
  /// rows are left out.
  std::vector<StoredEvent> LoadEvents(const Uuid& hazard, std::uint64_t sequence,
                                      std::size_t limit) const;

  /// Map changes: as the functions above.
  struct MapChangeRow {
    std::uint64_t id = 0;
    MapChangeFeature feature;
  };
  StoreDamage LoadMapChanges(const std::function<void(MapChangeRow)>& take);
  std::uint64_t LastMapChangeId();
  struct KnownMapChangeReport {
    Uuid change;  ///< The feature that it was about; the row of that may be gone.
    std::string vehicle_id;
  };
  std::optional<KnownMapChangeReport> FindMapChangeReport(const Uuid& report_uuid);
  /// The newest `limit` events of a feature whose newest one is `sequence`, oldest first.
  std::vector<StoredMapChangeEvent> LoadMapChangeEvents(std::uint64_t sequence,
                                                        std::size_t limit) const;

  /// The newest `limit` decisions of all officials whose id is below `before`, the newest first;
  /// broken rows are left out. Any thread may.
  std::vector<DecisionRecord> LoadAllDecisions(std::uint64_t before, std::size_t limit) const;
  /// The first `limit` decisions whose id is above `id`, in the order of their ids; broken rows are
  /// left out. Any thread may.
  std::vector<DecisionRecord> LoadDecisionsAfter(std::uint64_t id, std::size_t limit) const;
  /// The first `limit` events above `sequence` by which drivers are told of a hazard of which they
  /// were not, or by which it leaves the map, in the order of their sequence; broken rows are left
  /// out. Any thread may.
  std::vector<StoredEvent> LoadTurnsAfter(std::uint64_t sequence, std::size_t limit) const;
  /// The newest `limit` decisions about one subject, as LoadDecisions. Any thread may.
  std::vector<DecisionRecord> LoadDecisionsAbout(const std::string& subject,
                                                 std::size_t limit) const;
  /// Who mends which hazard, the first due first and those without a day last; broken rows are left
  /// out. Any thread may.
  std::vector<Assignment> LoadAssignments() const;
  /// The same over the writer's connection: with what the running transaction wrote.
  std::vector<Assignment> LoadAssignmentsForWriter();
  /// Up to `limit` reports that became, or were merged into, the hazard of this row, the newest
  /// first; broken rows are left out. Any thread may. It reads the reports since the oldest of
  /// them.
  std::vector<SightingRecord> LoadSightings(std::uint64_t hazard_id, const Uuid& hazard,
                                            std::size_t limit) const;
  /// The newest `limit` pictures that came with answers about the hazard of this row, the newest
  /// first; broken rows are left out. Any thread may.
  std::vector<AnswerPicture> LoadAnswerPictures(std::uint64_t hazard_id, std::size_t limit) const;
  /// Officials' requests for whole frames since `since_ns` that stand and have no frame yet, in the
  /// order of their decisions, without `until_ns`; broken rows are left out.
  std::vector<FrameRequest> LoadFrameRequests(std::int64_t since_ns);
  /// Every redirect, in the order of their decisions; as LoadHazards.
  StoreDamage LoadRedirects(const std::function<void(Redirect)>& take);
  /// The newest `limit` decisions about a hazard, a map change or a vehicle
  /// (DecisionRecord::subject), the newest first; broken rows are left out.
  std::vector<DecisionRecord> LoadDecisions(const std::string& subject, std::size_t limit);
  /// The newest decision about the subject that is no undo; broken rows are left out.
  std::optional<DecisionRecord> FindNewestDecision(const std::string& subject);
  /// The newest distrust of the vehicle that stands, of those whose id is below `before`; broken
  /// rows are left out.
  std::optional<DecisionRecord> FindStandingDistrust(const std::string& vehicle_id,
                                                     std::uint64_t before);
  /// Up to `limit` hazards from which a distrust withdrew something that is not restored yet, and
  /// fewer only when there are no more; broken rows are left out.
  std::vector<Withdrawal> LoadWithdrawals(std::uint64_t decision, std::size_t limit);
  /// The rows of withdrawals that LoadWithdrawals leaves out.
  StoreDamage CheckWithdrawals();

  /// Writes happen between Begin and Commit; Commit returns when they are on disk.
  void Begin();
  void Commit();
  /// Never throws: after a full disk the database may have rolled back by itself.
  void Rollback() noexcept;

  /// Adds the hazard, or replaces the row of the same id, which keeps its class's name.
  void WriteHazard(const HazardRow& row);
  /// The hazard's row, which is there, has this class from now on.
  void WriteClass(std::uint64_t hazard_id, const std::string& class_name);
  /// Adds the course, or replaces that of the same hazard.
  void WriteCourse(std::uint64_t hazard_id, double course_rad);
  /// The same for its trails.
  void WriteTrails(std::uint64_t hazard_id, const std::vector<protocol::Trail>& trails);
  void WriteReport(const protocol::Report& report, std::uint64_t hazard_id,
                   const std::string& image_sha256, std::int64_t received_ns);
  /// `previous_sequence`: of the hazard's event before; 0 without one.
  void WriteEvent(const HazardEvent& event, std::uint64_t hazard_id,
                  std::uint64_t previous_sequence);
  void WriteAnswer(const protocol::PollAnswer& answer, std::uint64_t hazard_id,
                   std::int64_t received_ns);
  /// The picture came with the answer to that poll, and is the frame of that decision's request; 0:
  /// of none.
  void WriteAnswerPicture(const Uuid& poll, std::uint64_t hazard_id,
                          const std::string& image_sha256, std::uint64_t decision);
  void WriteLife(const std::string& class_name, const LearnedLifetime& learned);
  void WriteTrust(std::uint64_t vehicle, const TrustRecord& record);
  /// Adds the place, or replaces that of the same vehicle and stamp.
  void WritePlace(const std::string& vehicle_id, const KnownPlace& place);
  void DropPlace(const std::string& vehicle_id, std::int64_t stamp_ns);
  /// Of the first vehicle whose id comes after `after`: drops its places of before `before_ns`,
  /// except its newest, and those beyond its newest `max_places`, at least 1. The vehicle's id;
  /// none when there is no further one. Broken rows stay.
  std::optional<std::string> PrunePlaces(const std::string& after, std::int64_t before_ns,
                                         std::size_t max_places);
  /// Adds the decision under a new id, which is returned.
  std::uint64_t WriteDecision(const DecisionRecord& decision);
  /// The decision was taken back by the other one.
  void MarkDecisionUndone(std::uint64_t decision, std::uint64_t undone_by);
  /// The decision changed so many hazards more.
  void AddDecidedHazards(std::uint64_t decision, std::uint64_t hazards);
  /// Keeps what a distrust withdrew, unless that hazard has a row of this decision already.
  void WriteWithdrawal(std::uint64_t decision, const Withdrawal& withdrawal);
  void DropWithdrawal(std::uint64_t decision, const Uuid& hazard);
  void WriteRedirect(const Redirect& redirect);
  void DropRedirect(std::uint64_t decision);
  /// Adds the assignment, or replaces that of the same hazard.
  void WriteAssignment(const Assignment& assignment);
  void DropAssignment(const Uuid& hazard);
  void WriteMapChange(const MapChangeRow& row);
  /// Forgets a feature and its history; what vehicles told of it stays, so that they are answered.
  void DropMapChange(std::uint64_t id);
  void WriteMapChangeReport(const protocol::MapChangeReport& report, const Uuid& change,
                            std::int64_t received_ns);
  void WriteMapChangeEvent(const MapChangeEvent& event, std::uint64_t id);

  /// The next step of forgetting a vehicle, in a transaction: a page of rows is looked at, and what
  /// they say of the vehicle is put under its pseudonyms or dropped. `walk.pictures` are then those
  /// that it sent. `walk.part` says what comes next.
  void EraseStep(const Pseudonyms& names, ErasureWalk& walk);
  /// Takes what was committed out of the write-ahead log, whose end holds rows as they were before
  /// an erasure. False while a reader still needs it: to be tried again. PostgreSQL's log is its
  /// server's, which writes over it in time.
  bool EmptyLog();

  /// Asks the database for as little as can be. Throws StoreError when it does not answer within
  /// 2 s, when it only reads, or when SQLite's file was moved or removed. Not to be called in a
  /// transaction, nor is TryWrite.
  void Ping();
  /// Commits a transaction that changes nothing. Throws StoreError when that is not kept.
  void TryWrite();

  /// The schema that this program writes.
  static int SchemaVersion();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap::zone
