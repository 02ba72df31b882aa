#include "zone/store/zone_store.h"

#include <soci/soci.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <random>
#include <thread>
#include <utility>

#include "common/sqlite.h"
#include "common/uuid.h"
#include "zone/store/answer_picture_table.h"
#include "zone/store/decision_table.h"
#include "zone/store/desk_table.h"
#include "zone/store/erasure_tables.h"
#include "zone/store/event_log.h"
#include "zone/store/hazard_table.h"
#include "zone/store/learned_tables.h"
#include "zone/store/lease_row.h"
#include "zone/store/map_change_table.h"
#include "zone/store/place_table.h"
#include "zone/store/postgresql_url.h"
#include "zone/store/queries.h"
#include "zone/store/report_log.h"
#include "zone/store/store_connection.h"
#include "zone/store/store_validation.h"
#include "zone/store/stored_histories.h"
#include "zone/store/zone_lease.h"
#include "zone/store/zone_schema.h"

namespace livemap::zone {
namespace {

/// Within one database of PostgreSQL, the lock that the zone holds which writes to it.
constexpr char kTryLock[] =
    "SELECT CASE WHEN pg_try_advisory_lock(7810761180241193) THEN 1 ELSE 0 END";
/// Those that write by a lease share it: it keeps zones without one out. A process that stands
/// still keeps its lock, so that the lease has to tell them from each other.
constexpr char kTrySharedLock[] =
    "SELECT CASE WHEN pg_try_advisory_lock_shared(7810761180241193) THEN 1 ELSE 0 END";
/// The server notices within moments that the process which held the lock has died.
constexpr std::chrono::seconds kLockPatience{3};
/// A server that was killed is back within seconds, and then says whether it had committed.
constexpr std::chrono::seconds kOutcomePatience{30};
constexpr std::chrono::milliseconds kTryPause{100};

std::chrono::steady_clock::time_point Until(std::chrono::milliseconds patience) {
  return std::chrono::steady_clock::now() + patience;
}

bool IsOver(std::chrono::steady_clock::time_point end) {
  return std::chrono::steady_clock::now() >= end;
}

void TakeDatabase(StoreConnection& connection, const std::string& database,
                  std::uint64_t lease_epoch) {
  const auto end = Until(kLockPatience);
  const char* const try_lock = lease_epoch == 0 ? kTryLock : kTrySharedLock;
  int is_taken = 0;
  for (connection.session() << try_lock, soci::into(is_taken); is_taken == 0;
       connection.session() << try_lock, soci::into(is_taken)) {
    if (IsOver(end)) {
      throw StoreError("store: database '" + database +
                       "' is in use by another zone, or by a connection of this one that the "
                       "server has not given up yet");
    }
    std::this_thread::sleep_for(kTryPause);
  }
}

/// Runs one of the statements of a transaction that a former holder of the lease must not commit.
/// Throws LeaseLost.
void RequireLease(StoreConnection& connection, const char* statement, std::uint64_t lease_epoch) {
  const auto epoch = static_cast<long long>(lease_epoch);
  long long found = 0;
  connection.session() << statement, soci::use(epoch), soci::into(found);
  if (connection.session().got_data()) return;
  throw LeaseLost("store: the lease of epoch " + std::to_string(lease_epoch) +
                  " is lost, another process of the zone has taken it: nothing was written");
}

/// Brings the database into the state that the tables expect. Throws StoreError.
StoreConnection& PrepareZoneStore(StoreConnection& connection, const std::string& database,
                                  std::uint64_t lease_epoch) {
  if (lease_epoch != 0 && !connection.is_postgresql()) {
    throw StoreError("store: '" + database + "' is written by a lease, which wants PostgreSQL");
  }
  if (connection.is_postgresql()) TakeDatabase(connection, database, lease_epoch);
  if (lease_epoch != 0) RequireLease(connection, kBecomeWriter, lease_epoch);
  MigrateZoneStore(connection, database);
  return connection;
}

}  // namespace

bool HoldsStore(const std::string& database) {
  if (!IsPostgresqlUrl(database)) return std::filesystem::is_regular_file(database);
  return ExplainStore("looking for a store in '" + database + "'", [&] {
    StoreConnection connection(database, StoreConnection::Use::kRead);
    int tables = 0;
    connection.session() << "SELECT CASE WHEN to_regclass('livemap_schema') IS NULL THEN 0 ELSE 1 "
                            "END",
        soci::into(tables);
    return tables == 1;
  });
}

/// Owns the connection that writes, and makes a new one where that to a server has broken.
///
/// A server can go away after it was told to commit and before it has answered. So each commit
/// counts itself in the table livemap_owner, and a new connection reads there what became of it.
/// The token says that nobody else has written meanwhile, on whose rows the zone's memory would not
/// stand.
class ZoneStore::Implementation {
 public:
  /// The tables over the connection that writes.
  struct Writer {
    Writer(const std::string& database, std::uint64_t lease_epoch)
        : connection(database, StoreConnection::Use::kWrite),
          hazards(PrepareZoneStore(connection, database, lease_epoch)),
          reports(connection),
          events(connection),
          learned(connection),
          map_changes(connection),
          places(connection),
          decisions(connection),
          desk(connection),
          answer_pictures(connection),
          erasure(connection) {}

    StoreConnection connection;
    HazardTable hazards;
    ReportLog reports;
    EventLog events;
    LearnedTables learned;
    MapChangeTable map_changes;
    PlaceTable places;
    DecisionTable decisions;
    DeskTable desk;
    AnswerPictureTable answer_pictures;
    ErasureTables erasure;
  };

  Implementation(const std::string& database, std::uint64_t lease_epoch)
      : database_(database),
        lease_epoch_(lease_epoch),
        writer_(std::make_unique<Writer>(database, lease_epoch)),
        histories_(database) {
    if (!writer_->connection.is_postgresql()) return;
    std::random_device seed;
    std::mt19937_64 generator((static_cast<std::uint64_t>(seed()) << 32) | seed());
    token_ = Uuid::Random(generator).ToString();
    soci::session& session = writer_->connection.session();
    soci::transaction transaction(session);
    if (lease_epoch_ != 0) RequireLease(writer_->connection, kCheckLease, lease_epoch_);
    session << "DELETE FROM livemap_owner";
    session << "INSERT INTO livemap_owner (token, commits) VALUES (:t, 0)", soci::use(token_);
    transaction.commit();
  }

  /// In a transaction that of it, else one whose connection was alive when it was used last.
  Writer& writer() {
    if (!is_in_transaction_) RequireConnection();
    return *writer_;
  }
  StoredHistories& histories() { return histories_; }

  /// Runs a query once more over a new connection where the old one turns out to be broken.
  template <typename Body>
  auto Read(const Body& body) {
    try {
      return body(writer());
    } catch (const StoreError&) {
      if (is_in_transaction_ || writer_ == nullptr || !writer_->connection.IsLost()) throw;
    }
    return body(writer());
  }

  /// Asks once: after a connection that broke meanwhile, the next call connects anew.
  void Ping() {
    ExplainStore("asking the database", [&] { writer().connection.Ping(); });
  }

  void Begin() {
    Read([](Writer& writer) {
      ExplainStore("beginning a transaction", [&] {
        const bool is_postgresql = writer.connection.is_postgresql();
        writer.connection.session() << (is_postgresql ? "BEGIN" : "BEGIN IMMEDIATE");
      });
      return true;
    });
    is_in_transaction_ = true;
  }

  void Commit() {
    ExplainStore("committing", [&] {
      StoreConnection& connection = writer_->connection;
      if (!connection.is_postgresql()) {
        connection.session() << "COMMIT";
        is_in_transaction_ = false;
        return;
      }
      // Last of all: from here to the end of the transaction nobody takes the lease.
      if (lease_epoch_ != 0) RequireLease(connection, kCheckLease, lease_epoch_);
      const long long commits = commits_ + 1;
      connection.session() << "UPDATE livemap_owner SET commits = :c", soci::use(commits);
      is_uncertain_ = true;
      try {
        connection.session() << "COMMIT";
      } catch (const soci::soci_error&) {
        if (!connection.IsLost()) {
          is_uncertain_ = false;
          throw;
        }
        is_in_transaction_ = false;
        AwaitOutcome();
        return;
      }
      is_uncertain_ = false;
      is_in_transaction_ = false;
      commits_ = commits;
    });
  }

  void Rollback() noexcept {
    if (!is_in_transaction_) return;
    is_in_transaction_ = false;
    try {
      writer_->connection.Discard();
      writer_->connection.session() << "ROLLBACK";
    } catch (const std::exception&) {  // See the header.
    }
  }

 private:
  /// Throws StoreError where there is none. What a commit without an answer came to is known then.
  void RequireConnection() {
    if (writer_ && !writer_->connection.IsLost()) return;
    writer_ = nullptr;
    auto fresh = ExplainStore("connecting again to '" + database_ + "'",
                              [&] { return std::make_unique<Writer>(database_, lease_epoch_); });
    const long long commits = CommitsOf(*fresh);
    const bool was_committed = is_uncertain_ && commits == commits_ + 1;
    if (was_committed && !is_awaited_) {
      throw StoreError(
          "store: the last commit came to pass although its answer was lost, and the zone does not "
          "know what it wrote: it must be started again");
    }
    if (was_committed) {
      commits_ = commits;
      is_uncertain_ = false;
    } else if (commits != commits_) {
      throw StoreError("store: database '" + database_ +
                       "' is not as this zone left it, it was set back: the zone must be started "
                       "again");
    }
    writer_ = std::move(fresh);
  }

  long long CommitsOf(Writer& writer) const {
    return ExplainStore("reading whose the store is", [&] {
      std::string token;
      long long commits = 0;
      writer.connection.session() << "SELECT token, commits FROM livemap_owner", soci::into(token),
          soci::into(commits);
      if (token == token_) return commits;
      throw StoreError("store: database '" + database_ +
                       "' was used by another zone meanwhile: this one must be started again");
    });
  }

  /// Returns when the commit whose answer was lost came to pass. Throws StoreError when it did not,
  /// or when the server does not come back: a later connection tells.
  void AwaitOutcome() {
    const auto end = Until(kOutcomePatience);
    is_awaited_ = true;
    for (;;) {
      try {
        RequireConnection();
        is_awaited_ = false;
        break;
      } catch (const LeaseLost&) {
        is_awaited_ = false;
        throw;
      } catch (const StoreError&) {
        if (IsOver(end)) {
          is_awaited_ = false;
          throw;
        }
      }
      std::this_thread::sleep_for(kTryPause);
    }
    if (!is_uncertain_) return;
    is_uncertain_ = false;
    throw StoreError("store: committing failed: the connection to the server was lost");
  }

  const std::string database_;
  const std::uint64_t lease_epoch_;  ///< 0: the database is this zone's without a lease.
  std::unique_ptr<Writer> writer_;   ///< Null between two connections.
  StoredHistories histories_;
  bool is_in_transaction_ = false;
  // Of PostgreSQL.
  std::string token_;
  long long commits_ = 0;      ///< That are known to have come to pass.
  bool is_uncertain_ = false;  ///< Whether a further one may have.
  bool is_awaited_ = false;    ///< Whether somebody waits to hear of that one.
};

ZoneStore::ZoneStore(const std::string& database, std::uint64_t lease_epoch) {
  try {
    implementation_ = std::make_unique<Implementation>(database, lease_epoch);
  } catch (const soci::soci_error& error) {
    const std::string words = OneLine(error.get_error_message());
    const bool damaged = words.find("malformed") != std::string::npos ||
                         words.find("not a database") != std::string::npos;
    if (damaged && !IsPostgresqlUrl(database)) throw StoreError(WhyStoreDamaged(database, words));
    throw StoreError("store: opening '" + database + "' failed: " + words);
  }
}

ZoneStore::~ZoneStore() = default;

StoreDamage ZoneStore::LoadHazards(const std::function<void(HazardRow)>& take) {
  return implementation_->writer().hazards.Load(take);
}

StoreDamage ZoneStore::LoadCourses(const std::function<void(std::uint64_t, double)>& take) {
  return implementation_->writer().hazards.LoadCourses(take);
}

StoreDamage ZoneStore::LoadTrails(
    const std::function<void(std::uint64_t, std::vector<protocol::Trail>)>& take) {
  return implementation_->writer().hazards.LoadTrails(take);
}

StoreDamage ZoneStore::LoadLives(
    const std::function<void(const std::string&, LearnedLifetime)>& take) {
  return implementation_->writer().learned.LoadLives(take);
}

StoreDamage ZoneStore::LoadTrust(
    const std::function<void(std::uint64_t, const TrustRecord&)>& take) {
  return implementation_->writer().learned.LoadTrust(take);
}

std::uint64_t ZoneStore::LastHazardId() { return implementation_->writer().hazards.LastId(); }

std::uint64_t ZoneStore::LastSequence() {
  return ExplainStore("reading the newest sequence", [&] {
    long long sequence = 0;
    StoreConnection& connection = implementation_->writer().connection;
    const std::string newest = connection.dialect().Greater(
        "(SELECT coalesce(max(sequence), 0) FROM events WHERE sequence < :most)",
        "(SELECT coalesce(max(sequence), 0) FROM map_change_events WHERE sequence < :most)");
    connection.session() << "SELECT " << newest, soci::use(kMaxSequence, "most"),
        soci::into(sequence);
    return static_cast<std::uint64_t>(std::max(sequence, 0LL));
  });
}

std::vector<std::optional<ZoneStore::KnownReport>> ZoneStore::FindReports(
    const std::vector<Uuid>& reports) {
  return implementation_->Read([&](auto& writer) { return writer.reports.FindReports(reports); });
}

std::vector<StoredEvent> ZoneStore::LoadEvents(const Uuid& hazard, std::uint64_t sequence,
                                               std::size_t limit) const {
  return implementation_->histories().OfHazard(hazard, sequence, limit);
}

StoreDamage ZoneStore::LoadMapChanges(const std::function<void(MapChangeRow)>& take) {
  return implementation_->writer().map_changes.Load(take);
}

std::uint64_t ZoneStore::LastMapChangeId() {
  return implementation_->writer().map_changes.LastId();
}

std::optional<ZoneStore::KnownMapChangeReport> ZoneStore::FindMapChangeReport(
    const Uuid& report_uuid) {
  return implementation_->Read(
      [&](auto& writer) { return writer.map_changes.FindReport(report_uuid); });
}

std::vector<StoredMapChangeEvent> ZoneStore::LoadMapChangeEvents(std::uint64_t sequence,
                                                                 std::size_t limit) const {
  return implementation_->histories().OfMapChange(sequence, limit);
}

std::vector<DecisionRecord> ZoneStore::LoadAllDecisions(std::uint64_t before,
                                                        std::size_t limit) const {
  return implementation_->histories().OfOfficials(before, limit);
}

std::vector<DecisionRecord> ZoneStore::LoadDecisionsAfter(std::uint64_t id,
                                                          std::size_t limit) const {
  return implementation_->histories().DecisionsAfter(id, limit);
}

std::vector<StoredEvent> ZoneStore::LoadTurnsAfter(std::uint64_t sequence,
                                                   std::size_t limit) const {
  return implementation_->histories().TurnsAfter(sequence, limit);
}

std::vector<DecisionRecord> ZoneStore::LoadDecisionsAbout(const std::string& subject,
                                                          std::size_t limit) const {
  return implementation_->histories().OfSubject(subject, limit);
}

std::vector<Assignment> ZoneStore::LoadAssignments() const {
  return implementation_->histories().Assignments();
}

std::vector<Assignment> ZoneStore::LoadAssignmentsForWriter() {
  return implementation_->Read([&](auto& writer) { return writer.desk.LoadAssignments(); });
}

std::vector<SightingRecord> ZoneStore::LoadSightings(std::uint64_t hazard_id, const Uuid& hazard,
                                                     std::size_t limit) const {
  return implementation_->histories().Sightings(hazard_id, hazard, limit);
}

std::vector<AnswerPicture> ZoneStore::LoadAnswerPictures(std::uint64_t hazard_id,
                                                         std::size_t limit) const {
  return implementation_->histories().AnswerPictures(hazard_id, limit);
}

std::vector<FrameRequest> ZoneStore::LoadFrameRequests(std::int64_t since_ns) {
  return implementation_->writer().answer_pictures.LoadFrameRequests(since_ns);
}

StoreDamage ZoneStore::LoadRedirects(const std::function<void(Redirect)>& take) {
  return implementation_->writer().desk.LoadRedirects(take);
}

StoreDamage ZoneStore::LoadPlaces(const std::function<void(const std::string&, KnownPlace)>& take) {
  return implementation_->writer().places.Load(take);
}

std::vector<KnownPlace> ZoneStore::FindPlaces(const std::string& vehicle_id, std::size_t limit) {
  return implementation_->Read([&](auto& writer) { return writer.places.Find(vehicle_id, limit); });
}

std::vector<DecisionRecord> ZoneStore::LoadDecisions(const std::string& subject,
                                                     std::size_t limit) {
  return implementation_->Read(
      [&](auto& writer) { return writer.decisions.LoadDecisions(subject, limit); });
}

std::optional<DecisionRecord> ZoneStore::FindNewestDecision(const std::string& subject) {
  return implementation_->Read(
      [&](auto& writer) { return writer.decisions.FindNewestDecision(subject); });
}

std::optional<DecisionRecord> ZoneStore::FindStandingDistrust(const std::string& vehicle_id,
                                                              std::uint64_t before) {
  return implementation_->Read(
      [&](auto& writer) { return writer.decisions.FindStandingDistrust(vehicle_id, before); });
}

StoreDamage ZoneStore::CheckWithdrawals() {
  return implementation_->writer().decisions.CheckWithdrawals();
}

std::vector<Withdrawal> ZoneStore::LoadWithdrawals(std::uint64_t decision, std::size_t limit) {
  return implementation_->Read(
      [&](auto& writer) { return writer.decisions.LoadWithdrawals(decision, limit); });
}

void ZoneStore::Begin() { implementation_->Begin(); }

void ZoneStore::Commit() { implementation_->Commit(); }

void ZoneStore::Rollback() noexcept { implementation_->Rollback(); }

void ZoneStore::WriteHazard(const HazardRow& row) { implementation_->writer().hazards.Write(row); }

void ZoneStore::WriteClass(std::uint64_t hazard_id, const std::string& class_name) {
  implementation_->writer().hazards.WriteClass(hazard_id, class_name);
}

void ZoneStore::WriteCourse(std::uint64_t hazard_id, double course_rad) {
  implementation_->writer().hazards.WriteCourse(hazard_id, course_rad);
}

void ZoneStore::WriteTrails(std::uint64_t hazard_id, const std::vector<protocol::Trail>& trails) {
  implementation_->writer().hazards.WriteTrails(hazard_id, trails);
}

void ZoneStore::WriteReport(const protocol::Report& report, std::uint64_t hazard_id,
                            const std::string& image_sha256, std::int64_t received_ns) {
  implementation_->writer().reports.WriteReport(report, hazard_id, image_sha256, received_ns);
}

void ZoneStore::WriteEvent(const HazardEvent& event, std::uint64_t hazard_id,
                           std::uint64_t previous_sequence) {
  implementation_->writer().events.Write(event, hazard_id, previous_sequence);
}

void ZoneStore::WriteAnswer(const protocol::PollAnswer& answer, std::uint64_t hazard_id,
                            std::int64_t received_ns) {
  implementation_->writer().reports.WriteAnswer(answer, hazard_id, received_ns);
}

void ZoneStore::WriteAnswerPicture(const Uuid& poll, std::uint64_t hazard_id,
                                   const std::string& image_sha256, std::uint64_t decision) {
  implementation_->writer().answer_pictures.WriteAnswerPicture(poll, hazard_id, image_sha256,
                                                               decision);
}

void ZoneStore::WriteLife(const std::string& class_name, const LearnedLifetime& learned) {
  implementation_->writer().learned.WriteLife(class_name, learned);
}

void ZoneStore::WriteTrust(std::uint64_t vehicle, const TrustRecord& record) {
  implementation_->writer().learned.WriteTrust(vehicle, record);
}

void ZoneStore::WritePlace(const std::string& vehicle_id, const KnownPlace& place) {
  implementation_->writer().places.Write(vehicle_id, place);
}

void ZoneStore::DropPlace(const std::string& vehicle_id, std::int64_t stamp_ns) {
  implementation_->writer().places.Drop(vehicle_id, stamp_ns);
}

std::optional<std::string> ZoneStore::PrunePlaces(const std::string& after, std::int64_t before_ns,
                                                  std::size_t max_places) {
  return implementation_->writer().places.Prune(after, before_ns, max_places);
}

std::uint64_t ZoneStore::WriteDecision(const DecisionRecord& decision) {
  return implementation_->writer().decisions.WriteDecision(decision);
}

void ZoneStore::MarkDecisionUndone(std::uint64_t decision, std::uint64_t undone_by) {
  implementation_->writer().decisions.MarkUndone(decision, undone_by);
}

void ZoneStore::AddDecidedHazards(std::uint64_t decision, std::uint64_t hazards) {
  implementation_->writer().decisions.AddHazards(decision, hazards);
}

void ZoneStore::WriteWithdrawal(std::uint64_t decision, const Withdrawal& withdrawal) {
  implementation_->writer().decisions.WriteWithdrawal(decision, withdrawal);
}

void ZoneStore::DropWithdrawal(std::uint64_t decision, const Uuid& hazard) {
  implementation_->writer().decisions.DropWithdrawal(decision, hazard);
}

void ZoneStore::WriteRedirect(const Redirect& redirect) {
  implementation_->writer().desk.WriteRedirect(redirect);
}

void ZoneStore::DropRedirect(std::uint64_t decision) {
  implementation_->writer().desk.DropRedirect(decision);
}

void ZoneStore::WriteAssignment(const Assignment& assignment) {
  implementation_->writer().desk.WriteAssignment(assignment);
}

void ZoneStore::DropAssignment(const Uuid& hazard) {
  implementation_->writer().desk.DropAssignment(hazard);
}

void ZoneStore::WriteMapChange(const MapChangeRow& row) {
  implementation_->writer().map_changes.Write(row);
}

void ZoneStore::DropMapChange(std::uint64_t id) { implementation_->writer().map_changes.Drop(id); }

void ZoneStore::WriteMapChangeReport(const protocol::MapChangeReport& report, const Uuid& change,
                                     std::int64_t received_ns) {
  implementation_->writer().map_changes.WriteReport(report, change, received_ns);
}

void ZoneStore::WriteMapChangeEvent(const MapChangeEvent& event, std::uint64_t id) {
  implementation_->writer().map_changes.WriteEvent(event, id);
}

void ZoneStore::EraseStep(const Pseudonyms& names, ErasureWalk& walk) {
  implementation_->writer().erasure.Step(names, walk);
}

bool ZoneStore::EmptyLog() {
  StoreConnection& connection = implementation_->writer().connection;
  if (connection.is_postgresql()) return true;
  return ExplainStore("emptying the write-ahead log", [&] {
    int busy = 0;
    int log_pages = 0;
    int moved_pages = 0;
    connection.session() << "PRAGMA wal_checkpoint(TRUNCATE)", soci::into(busy),
        soci::into(log_pages), soci::into(moved_pages);
    return busy == 0;
  });
}

void ZoneStore::Ping() { implementation_->Ping(); }

void ZoneStore::TryWrite() {
  Begin();
  try {
    StoreConnection& connection = implementation_->writer().connection;
    // PostgreSQL's commits count themselves.
    if (!connection.is_postgresql()) {
      ExplainStore("trying to write",
                   [&] { connection.session() << "UPDATE livemap_schema SET version = version"; });
    }
    Commit();
  } catch (...) {
    Rollback();
    throw;
  }
}

int ZoneStore::SchemaVersion() { return kZoneSchemaVersion; }

}  // namespace livemap::zone
