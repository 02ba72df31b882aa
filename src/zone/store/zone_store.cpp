#include "zone/store/zone_store.h"

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <algorithm>

#include "common/sqlite.h"
#include "zone/store/decision_table.h"
#include "zone/store/desk_table.h"
#include "zone/store/event_log.h"
#include "zone/store/hazard_table.h"
#include "zone/store/learned_tables.h"
#include "zone/store/map_change_table.h"
#include "zone/store/place_table.h"
#include "zone/store/queries.h"
#include "zone/store/report_log.h"
#include "zone/store/store_validation.h"
#include "zone/store/stored_histories.h"
#include "zone/store/zone_schema.h"

namespace livemap::zone {
namespace {

std::string WhyZoneStoreDamaged(const std::string& path, const std::string& verdict) {
  return "store: database '" + path + "' is damaged and left alone: " + verdict +
         "; how to recover what it holds stands in docs/how-to/recover-a-store.md";
}

std::string ZoneStoreConnection(const std::string& path) {
  if (path.find('"') != std::string::npos) {
    throw StoreError("store: path '" + path + "' holds a quotation mark, which is not accepted");
  }
  return "db=\"" + path + "\" timeout=10";
}

/// Brings the database into the state that the tables expect. Throws StoreError.
soci::session& PrepareZoneStore(soci::session& session, const std::string& path) {
  session << "PRAGMA synchronous=FULL";
  std::string mode;
  session << "PRAGMA journal_mode=WAL", soci::into(mode);
  session << "PRAGMA foreign_keys=ON";
  // 64 MB of pages stay in memory; the log is taken over after 40 MB, so that a page that many
  // commits touch is written to its place once for all of them.
  session << "PRAGMA cache_size=-65536";
  int pages = 0;
  session << "PRAGMA wal_autocheckpoint=10000", soci::into(pages);
  std::string verdict;
  session << "PRAGMA quick_check(1)", soci::into(verdict);
  if (verdict != "ok") throw StoreError(WhyZoneStoreDamaged(path, verdict));
  MigrateZoneStore(session, path);
  return session;
}

}  // namespace

class ZoneStore::Implementation {
 public:
  explicit Implementation(const std::string& path)
      : session_(soci::sqlite3, ZoneStoreConnection(path)),
        hazards_(PrepareZoneStore(session_, path)),
        reports_(session_),
        events_(session_),
        learned_(session_),
        map_changes_(session_),
        places_(session_),
        decisions_(session_),
        desk_(session_),
        histories_(ZoneStoreConnection(path)) {}

  soci::session session_;
  HazardTable hazards_;
  ReportLog reports_;
  EventLog events_;
  LearnedTables learned_;
  MapChangeTable map_changes_;
  PlaceTable places_;
  DecisionTable decisions_;
  DeskTable desk_;
  StoredHistories histories_;
};

ZoneStore::ZoneStore(const std::string& path) {
  try {
    implementation_ = std::make_unique<Implementation>(path);
  } catch (const soci::soci_error& error) {
    const std::string words = error.get_error_message();
    const bool damaged = words.find("malformed") != std::string::npos ||
                         words.find("not a database") != std::string::npos;
    if (damaged) throw StoreError(WhyZoneStoreDamaged(path, words));
    throw StoreError("store: opening '" + path + "' failed: " + words);
  }
}

ZoneStore::~ZoneStore() = default;

StoreDamage ZoneStore::LoadHazards(const std::function<void(HazardRow)>& take) {
  return implementation_->hazards_.Load(take);
}

StoreDamage ZoneStore::LoadCourses(const std::function<void(std::uint64_t, double)>& take) {
  return implementation_->hazards_.LoadCourses(take);
}

StoreDamage ZoneStore::LoadLives(
    const std::function<void(const std::string&, LearnedLifetime)>& take) {
  return implementation_->learned_.LoadLives(take);
}

StoreDamage ZoneStore::LoadTrust(
    const std::function<void(std::uint64_t, const TrustRecord&)>& take) {
  return implementation_->learned_.LoadTrust(take);
}

std::uint64_t ZoneStore::LastHazardId() { return implementation_->hazards_.LastId(); }

std::uint64_t ZoneStore::LastSequence() {
  return ExplainStore("reading the newest sequence", [&] {
    long long sequence = 0;
    implementation_->session_
        << "SELECT max((SELECT coalesce(max(sequence), 0) FROM events WHERE sequence < :most), "
           "(SELECT coalesce(max(sequence), 0) FROM map_change_events WHERE sequence < :most))",
        soci::use(kMaxSequence, "most"), soci::into(sequence);
    return static_cast<std::uint64_t>(std::max(sequence, 0LL));
  });
}

std::optional<ZoneStore::KnownReport> ZoneStore::FindReport(const Uuid& report_uuid) {
  return implementation_->reports_.FindReport(report_uuid);
}

std::vector<StoredEvent> ZoneStore::LoadEvents(const Uuid& hazard, std::uint64_t sequence,
                                               std::size_t limit) const {
  return implementation_->histories_.OfHazard(hazard, sequence, limit);
}

StoreDamage ZoneStore::LoadMapChanges(const std::function<void(MapChangeRow)>& take) {
  return implementation_->map_changes_.Load(take);
}

std::uint64_t ZoneStore::LastMapChangeId() { return implementation_->map_changes_.LastId(); }

std::optional<ZoneStore::KnownMapChangeReport> ZoneStore::FindMapChangeReport(
    const Uuid& report_uuid) {
  return implementation_->map_changes_.FindReport(report_uuid);
}

std::vector<StoredMapChangeEvent> ZoneStore::LoadMapChangeEvents(std::uint64_t sequence,
                                                                 std::size_t limit) const {
  return implementation_->histories_.OfMapChange(sequence, limit);
}

std::vector<DecisionRecord> ZoneStore::LoadAllDecisions(std::uint64_t before,
                                                        std::size_t limit) const {
  return implementation_->histories_.OfOfficials(before, limit);
}

std::vector<DecisionRecord> ZoneStore::LoadDecisionsAfter(std::uint64_t id,
                                                          std::size_t limit) const {
  return implementation_->histories_.DecisionsAfter(id, limit);
}

std::vector<StoredEvent> ZoneStore::LoadTurnsAfter(std::uint64_t sequence,
                                                   std::size_t limit) const {
  return implementation_->histories_.TurnsAfter(sequence, limit);
}

std::vector<DecisionRecord> ZoneStore::LoadDecisionsAbout(const std::string& subject,
                                                          std::size_t limit) const {
  return implementation_->histories_.OfSubject(subject, limit);
}

std::vector<Assignment> ZoneStore::LoadAssignments() const {
  return implementation_->histories_.Assignments();
}

std::vector<Assignment> ZoneStore::LoadAssignmentsForWriter() {
  return implementation_->desk_.LoadAssignments();
}

std::vector<SightingRecord> ZoneStore::LoadSightings(std::uint64_t hazard_id, const Uuid& hazard,
                                                     std::size_t limit) const {
  return implementation_->histories_.Sightings(hazard_id, hazard, limit);
}

StoreDamage ZoneStore::LoadRedirects(const std::function<void(Redirect)>& take) {
  return implementation_->desk_.LoadRedirects(take);
}

StoreDamage ZoneStore::LoadPlaces(const std::function<void(const std::string&, KnownPlace)>& take) {
  return implementation_->places_.Load(take);
}

std::vector<KnownPlace> ZoneStore::FindPlaces(const std::string& vehicle_id, std::size_t limit) {
  return implementation_->places_.Find(vehicle_id, limit);
}

std::vector<DecisionRecord> ZoneStore::LoadDecisions(const std::string& subject,
                                                     std::size_t limit) {
  return implementation_->decisions_.LoadDecisions(subject, limit);
}

std::optional<DecisionRecord> ZoneStore::FindNewestDecision(const std::string& subject) {
  return implementation_->decisions_.FindNewestDecision(subject);
}

std::optional<DecisionRecord> ZoneStore::FindStandingDistrust(const std::string& vehicle_id,
                                                              std::uint64_t before) {
  return implementation_->decisions_.FindStandingDistrust(vehicle_id, before);
}

StoreDamage ZoneStore::CheckWithdrawals() { return implementation_->decisions_.CheckWithdrawals(); }

std::vector<Withdrawal> ZoneStore::LoadWithdrawals(std::uint64_t decision, std::size_t limit) {
  return implementation_->decisions_.LoadWithdrawals(decision, limit);
}

void ZoneStore::Begin() {
  ExplainStore("beginning a transaction", [&] { implementation_->session_ << "BEGIN IMMEDIATE"; });
}

void ZoneStore::Commit() {
  ExplainStore("committing", [&] { implementation_->session_ << "COMMIT"; });
}

void ZoneStore::Rollback() noexcept {
  try {
    implementation_->session_ << "ROLLBACK";
  } catch (const std::exception&) {  // See the header.
  }
}

void ZoneStore::WriteHazard(const HazardRow& row) { implementation_->hazards_.Write(row); }

void ZoneStore::WriteClass(std::uint64_t hazard_id, const std::string& class_name) {
  implementation_->hazards_.WriteClass(hazard_id, class_name);
}

void ZoneStore::WriteCourse(std::uint64_t hazard_id, double course_rad) {
  implementation_->hazards_.WriteCourse(hazard_id, course_rad);
}

void ZoneStore::WriteReport(const protocol::Report& report, std::uint64_t hazard_id,
                            const std::string& image_sha256, std::int64_t received_ns) {
  implementation_->reports_.WriteReport(report, hazard_id, image_sha256, received_ns);
}

void ZoneStore::WriteEvent(const HazardEvent& event, std::uint64_t hazard_id,
                           std::uint64_t previous_sequence) {
  implementation_->events_.Write(event, hazard_id, previous_sequence);
}

void ZoneStore::WriteAnswer(const protocol::PollAnswer& answer, std::uint64_t hazard_id,
                            std::int64_t received_ns) {
  implementation_->reports_.WriteAnswer(answer, hazard_id, received_ns);
}

void ZoneStore::WriteLife(const std::string& class_name, const LearnedLifetime& learned) {
  implementation_->learned_.WriteLife(class_name, learned);
}

void ZoneStore::WriteTrust(std::uint64_t vehicle, const TrustRecord& record) {
  implementation_->learned_.WriteTrust(vehicle, record);
}

void ZoneStore::WritePlace(const std::string& vehicle_id, const KnownPlace& place) {
  implementation_->places_.Write(vehicle_id, place);
}

void ZoneStore::DropPlace(const std::string& vehicle_id, std::int64_t stamp_ns) {
  implementation_->places_.Drop(vehicle_id, stamp_ns);
}

std::optional<std::string> ZoneStore::PrunePlaces(const std::string& after, std::int64_t before_ns,
                                                  std::size_t max_places) {
  return implementation_->places_.Prune(after, before_ns, max_places);
}

std::uint64_t ZoneStore::WriteDecision(const DecisionRecord& decision) {
  return implementation_->decisions_.WriteDecision(decision);
}

void ZoneStore::MarkDecisionUndone(std::uint64_t decision, std::uint64_t undone_by) {
  implementation_->decisions_.MarkUndone(decision, undone_by);
}

void ZoneStore::AddDecidedHazards(std::uint64_t decision, std::uint64_t hazards) {
  implementation_->decisions_.AddHazards(decision, hazards);
}

void ZoneStore::WriteWithdrawal(std::uint64_t decision, const Withdrawal& withdrawal) {
  implementation_->decisions_.WriteWithdrawal(decision, withdrawal);
}

void ZoneStore::DropWithdrawal(std::uint64_t decision, const Uuid& hazard) {
  implementation_->decisions_.DropWithdrawal(decision, hazard);
}

void ZoneStore::WriteRedirect(const Redirect& redirect) {
  implementation_->desk_.WriteRedirect(redirect);
}

void ZoneStore::DropRedirect(std::uint64_t decision) {
  implementation_->desk_.DropRedirect(decision);
}

void ZoneStore::WriteAssignment(const Assignment& assignment) {
  implementation_->desk_.WriteAssignment(assignment);
}

void ZoneStore::DropAssignment(const Uuid& hazard) {
  implementation_->desk_.DropAssignment(hazard);
}

void ZoneStore::WriteMapChange(const MapChangeRow& row) {
  implementation_->map_changes_.Write(row);
}

void ZoneStore::DropMapChange(std::uint64_t id) { implementation_->map_changes_.Drop(id); }

void ZoneStore::WriteMapChangeReport(const protocol::MapChangeReport& report, const Uuid& change,
                                     std::int64_t received_ns) {
  implementation_->map_changes_.WriteReport(report, change, received_ns);
}

void ZoneStore::WriteMapChangeEvent(const MapChangeEvent& event, std::uint64_t id) {
  implementation_->map_changes_.WriteEvent(event, id);
}

int ZoneStore::SchemaVersion() { return kZoneSchemaVersion; }

}  // namespace livemap::zone
