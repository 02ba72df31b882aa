#include "zone/zone_store.h"

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/sqlite.h"
#include "zone/zone_schema.h"
#include "zone/zone_store_state.h"

namespace livemap {
namespace {

Uuid ParseUuid(const std::string& text) {
  const auto uuid = Uuid::Parse(text);
  if (!uuid) throw StoreError("store: '" + text + "' stands where a uuid belongs");
  return *uuid;
}

HazardState ParseState(int number) {
  if (number >= 0 && number < static_cast<int>(kHazardStates)) {
    return static_cast<HazardState>(number);
  }
  throw StoreError("store: " + std::to_string(number) + " stands where a state belongs");
}

/// What schema 1 knew of a life: drivers were told, nobody asked.
LifeRecord LifeOf(const Hazard& hazard) {
  LifeRecord life;
  life.state = hazard.state;
  life.since_ns = hazard.updated_ns;
  life.first_seen_ns = hazard.first_seen_ns;
  life.last_yes_ns = hazard.last_seen_ns;
  life.at_ns = hazard.last_seen_ns;
  const double presence = std::clamp(static_cast<double>(hazard.presence), 0.01, 0.99);
  life.log_odds = static_cast<float>(std::log(presence / (1 - presence)));
  life.undenied_log_odds = life.log_odds;
  return life;
}

std::string WhyDamaged(const std::string& path, const std::string& verdict) {
  return "store: database '" + path + "' is damaged and left alone: " + verdict +
         "; how to recover what it holds stands in docs/zone.md";
}

std::string ConnectionText(const std::string& path) {
  if (path.find('"') != std::string::npos) {
    throw StoreError("store: path '" + path + "' holds a quotation mark, which is not accepted");
  }
  return "db=\"" + path + "\" timeout=10";
}

}  // namespace

ZoneStore::Implementation::Implementation(const std::string& path)
    : path_(path), session_(soci::sqlite3, ConnectionText(path)) {
  Prepare();
}

ZoneStore::HazardRow ZoneStore::Implementation::ToHazard(const Row& row) {
  HazardRow result;
  result.id = static_cast<std::uint64_t>(row.id);
  Hazard& hazard = result.hazard;
  hazard.uuid = ParseUuid(row.uuid);
  hazard.class_name = row.class_name;
  hazard.confidence = static_cast<float>(row.confidence);
  hazard.position = {row.latitude, row.longitude};
  if (!IsValid(hazard.position)) {
    throw StoreError("store: hazard '" + row.uuid + "' has no position on Earth");
  }
  hazard.covariance_m2 << row.covariance_ee, row.covariance_en, row.covariance_en,
      row.covariance_nn;
  hazard.sightings = static_cast<std::uint32_t>(row.sightings);
  hazard.first_seen_ns = row.first_seen_ns;
  hazard.last_seen_ns = row.last_seen_ns;
  hazard.updated_ns = row.updated_ns;
  hazard.sequence = static_cast<std::uint64_t>(row.sequence);
  hazard.announced_sequence = static_cast<std::uint64_t>(row.announced_sequence);
  hazard.image_sha256 = row.image_sha256;
  hazard.image_format = row.image_format;
  hazard.state = ParseState(row.state);
  hazard.presence = static_cast<float>(row.presence);
  hazard.vehicles = static_cast<std::uint32_t>(row.vehicles);
  const auto life = row.life.empty() ? LifeOf(hazard) : UnpackLife(row.life);
  if (!life || life->state != hazard.state) {
    throw StoreError("store: hazard '" + row.uuid + "' has no life that can be read");
  }
  result.life = *life;
  return result;
}

void ZoneStore::Implementation::Prepare() {
  session_ << "PRAGMA synchronous=FULL";
  std::string mode;
  session_ << "PRAGMA journal_mode=WAL", soci::into(mode);
  session_ << "PRAGMA foreign_keys=ON";
  // 64 MB of pages stay in memory; the log is taken over after 40 MB, so that a page that many
  // commits touch is written to its place once for all of them.
  session_ << "PRAGMA cache_size=-65536";
  int pages = 0;
  session_ << "PRAGMA wal_autocheckpoint=10000", soci::into(pages);
  std::string verdict;
  session_ << "PRAGMA quick_check(1)", soci::into(verdict);
  if (verdict != "ok") throw StoreError(WhyDamaged(path_, verdict));
  MigrateZoneStore(session_, path_);
  PrepareReads();
  PrepareWrites();
}

void ZoneStore::Implementation::PrepareReads() {
  using soci::into;
  using soci::use;
  find_report_.emplace((session_.prepare
                            << "SELECT h.uuid, r.vehicle_id FROM reports r JOIN hazards h "
                               "ON h.id = r.hazard_id WHERE r.uuid = :uuid",
                        use(row_.reason), into(row_.uuid), into(row_.vehicle_id)));
  find_last_report_.emplace((session_.prepare << "SELECT stamp_ns, latitude, longitude, sigma_m "
                                                 "FROM last_reports WHERE vehicle_id = :v",
                             use(row_.vehicle_id), into(row_.stamp_ns), into(row_.latitude),
                             into(row_.longitude), into(row_.sigma_m)));
  find_event_.emplace((session_.prepare
                           << "SELECT previous_sequence, action, from_state, to_state, announced, "
                              "reason, at_ns FROM events WHERE sequence = :s",
                       use(row_.sequence), into(row_.previous_sequence), into(row_.action),
                       into(row_.from_state, row_.has_from), into(row_.state), into(row_.announced),
                       into(row_.reason), into(row_.updated_ns)));
}

ZoneStore::ZoneStore(const std::string& path) {
  try {
    implementation_ = std::make_unique<Implementation>(path);
  } catch (const soci::soci_error& error) {
    const std::string words = error.get_error_message();
    const bool damaged = words.find("malformed") != std::string::npos ||
                         words.find("not a database") != std::string::npos;
    if (damaged) throw StoreError(WhyDamaged(path, words));
    throw StoreError("store: opening '" + path + "' failed: " + words);
  }
}

ZoneStore::~ZoneStore() = default;

int ZoneStore::SchemaVersion() { return kZoneSchemaVersion; }

void ZoneStore::LoadHazards(const std::function<void(HazardRow)>& take) {
  ExplainStore("loading hazards", [&] {
    using soci::into;
    Implementation::Row row;
    soci::statement query =
        (implementation_->session_.prepare
             << "SELECT id, uuid, class_name, confidence, latitude, longitude, covariance_ee, "
                "covariance_en, covariance_nn, sightings, first_seen_ns, last_seen_ns, "
                "updated_ns, sequence, announced_sequence, image_sha256, image_format, state, "
                "presence, vehicles, life FROM hazards ORDER BY sequence",
         into(row.id), into(row.uuid), into(row.class_name), into(row.confidence),
         into(row.latitude), into(row.longitude), into(row.covariance_ee), into(row.covariance_en),
         into(row.covariance_nn), into(row.sightings), into(row.first_seen_ns),
         into(row.last_seen_ns), into(row.updated_ns), into(row.sequence),
         into(row.announced_sequence), into(row.image_sha256), into(row.image_format),
         into(row.state), into(row.presence), into(row.vehicles), into(row.life));
    query.execute();
    while (query.fetch()) take(Implementation::ToHazard(row));
  });
}

void ZoneStore::LoadLives(const std::function<void(const std::string&, LearnedLife)>& take) {
  ExplainStore("loading what was learned of classes", [&] {
    Implementation::Row row;
    soci::statement query =
        (implementation_->session_.prepare << "SELECT class_name, ended, stood_s FROM lives",
         soci::into(row.class_name), soci::into(row.ended), soci::into(row.stood_s));
    query.execute();
    while (query.fetch()) take(row.class_name, {row.ended, row.stood_s});
  });
}

std::uint64_t ZoneStore::LastSequence() {
  return ExplainStore("reading the newest sequence", [&] {
    long long sequence = 0;
    implementation_->session_ << "SELECT coalesce(max(sequence), 0) FROM events",
        soci::into(sequence);
    return static_cast<std::uint64_t>(sequence);
  });
}

namespace {

/// Runs a query for at most one row. Reads to the end: an unfinished query would keep its snapshot
/// and with it the whole log.
bool FetchOne(soci::statement& statement) {
  if (!statement.execute(true)) return false;
  while (statement.fetch()) {
  }
  return true;
}

}  // namespace

std::optional<ZoneStore::KnownReport> ZoneStore::FindReport(const Uuid& report_uuid) {
  return ExplainStore("looking up a report", [&]() -> std::optional<KnownReport> {
    Implementation::Row& row = implementation_->row_;
    row.reason = report_uuid.ToString();
    if (!FetchOne(*implementation_->find_report_)) return std::nullopt;
    return KnownReport{ParseUuid(row.uuid), row.vehicle_id};
  });
}

std::optional<ReportedFix> ZoneStore::FindLastReport(const std::string& vehicle_id) {
  return ExplainStore("looking up a vehicle", [&]() -> std::optional<ReportedFix> {
    Implementation::Row& row = implementation_->row_;
    row.vehicle_id = vehicle_id;
    if (!FetchOne(*implementation_->find_last_report_)) return std::nullopt;
    return ReportedFix{row.stamp_ns, {row.latitude, row.longitude}, row.sigma_m};
  });
}

std::vector<StoredEvent> ZoneStore::LoadEvents(const Uuid& hazard, std::uint64_t sequence,
                                               std::size_t limit) {
  return ExplainStore("reading events", [&] {
    Implementation::Row& row = implementation_->row_;
    std::vector<StoredEvent> events;
    while (sequence != 0 && events.size() < limit) {
      row.sequence = static_cast<long long>(sequence);
      if (!FetchOne(*implementation_->find_event_)) break;
      StoredEvent event;
      event.sequence = sequence;
      event.hazard = hazard;
      event.action = static_cast<HazardAction>(std::clamp(row.action, 0, 2));
      if (row.has_from == soci::i_ok) event.from = ParseState(row.from_state);
      event.to = ParseState(row.state);
      event.reason = row.reason;
      event.announced = row.announced != 0;
      event.at_ns = row.updated_ns;
      events.push_back(std::move(event));
      // Downwards only, whatever stands in the file.
      const auto previous = static_cast<std::uint64_t>(std::max(row.previous_sequence, 0LL));
      sequence = previous < sequence ? previous : 0;
    }
    std::reverse(events.begin(), events.end());
    return events;
  });
}

}  // namespace livemap
