#include "zone/zone_store.h"

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/sqlite.h"
#include "zone/zone_schema.h"
#include "zone/zone_service.h"

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

/// Runs `body` and turns the library's exceptions into the project's.
template <typename Body>
auto Explained(const std::string& doing, const Body& body) -> decltype(body()) {
  try {
    return body();
  } catch (const soci::soci_error& error) {
    throw StoreError("store: " + doing + " failed: " + error.get_error_message());
  }
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

class ZoneStore::Implementation {
 public:
  explicit Implementation(const std::string& path)
      : path_(path), session_(soci::sqlite3, ConnectionText(path)) {
    Prepare();
  }

  void Prepare();
  void PrepareReads();
  void PrepareWrites();

  /// The values of all statements: SOCI binds to places, not to values.
  struct Row {
    std::string uuid, class_name, vehicle_id, drive_id, image_sha256, image_format, reason, life;
    double confidence = 0, latitude = 0, longitude = 0, presence = 0, sigma_m = 0;
    double covariance_ee = 0, covariance_en = 0, covariance_nn = 0, ended = 0, stood_s = 0;
    long long id = 0, sightings = 0, first_seen_ns = 0, last_seen_ns = 0, updated_ns = 0;
    long long sequence = 0, announced_sequence = 0, previous_sequence = 0;
    long long stamp_ns = 0, received_ns = 0;
    int state = 0, vehicles = 0, action = 0, from_state = 0, announced = 0, answer = 0;
    soci::indicator has_from = soci::i_ok;
  };
  static HazardRow ToHazard(const Row& row);

  /// Declared before the statements, which must go first.
  std::string path_;
  soci::session session_;
  Row row_;
  std::optional<soci::statement> find_report_;
  std::optional<soci::statement> find_last_report_;
  std::optional<soci::statement> find_event_;
  std::optional<soci::statement> write_hazard_;
  std::optional<soci::statement> write_report_;
  std::optional<soci::statement> write_event_;
  std::optional<soci::statement> write_answer_;
  std::optional<soci::statement> write_life_;
  std::optional<soci::statement> write_last_report_;
};

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

void ZoneStore::Implementation::PrepareWrites() {
  using soci::use;
  write_hazard_.emplace(
      (session_.prepare
           << "INSERT INTO hazards (id, uuid, class_name, confidence, latitude, longitude, "
              "covariance_ee, covariance_en, covariance_nn, sightings, first_seen_ns, "
              "last_seen_ns, updated_ns, sequence, announced_sequence, image_sha256, "
              "image_format, state, presence, vehicles, life) VALUES (:i, :u, :c, :co, :la, :lo, "
              ":ee, :en, :nn, :si, :fi, :ls, :up, :se, :an, :is, :im, :st, :pr, :ve, :li) "
              "ON CONFLICT (id) DO UPDATE SET confidence = excluded.confidence, "
              "latitude = excluded.latitude, longitude = excluded.longitude, "
              "covariance_ee = excluded.covariance_ee, covariance_en = excluded.covariance_en, "
              "covariance_nn = excluded.covariance_nn, sightings = excluded.sightings, "
              "first_seen_ns = excluded.first_seen_ns, last_seen_ns = excluded.last_seen_ns, "
              "updated_ns = excluded.updated_ns, sequence = excluded.sequence, "
              "announced_sequence = excluded.announced_sequence, "
              "image_sha256 = excluded.image_sha256, image_format = excluded.image_format, "
              "state = excluded.state, presence = excluded.presence, "
              "vehicles = excluded.vehicles, life = excluded.life",
       use(row_.id), use(row_.uuid), use(row_.class_name), use(row_.confidence), use(row_.latitude),
       use(row_.longitude), use(row_.covariance_ee), use(row_.covariance_en),
       use(row_.covariance_nn), use(row_.sightings), use(row_.first_seen_ns),
       use(row_.last_seen_ns), use(row_.updated_ns), use(row_.sequence),
       use(row_.announced_sequence), use(row_.image_sha256), use(row_.image_format),
       use(row_.state), use(row_.presence), use(row_.vehicles), use(row_.life)));
  write_report_.emplace(
      (session_.prepare
           << "INSERT INTO reports (uuid, hazard_id, vehicle_id, drive_id, stamp_ns, "
              "received_ns, confidence, latitude, longitude, covariance_ee, covariance_en, "
              "covariance_nn, image_sha256) VALUES "
              "(:u, :h, :v, :d, :st, :re, :co, :la, :lo, :ee, :en, :nn, :im)",
       use(row_.uuid), use(row_.id), use(row_.vehicle_id), use(row_.drive_id), use(row_.stamp_ns),
       use(row_.received_ns), use(row_.confidence), use(row_.latitude), use(row_.longitude),
       use(row_.covariance_ee), use(row_.covariance_en), use(row_.covariance_nn),
       use(row_.image_sha256)));
  write_event_.emplace((session_.prepare
                            << "INSERT INTO events (sequence, hazard_id, previous_sequence, "
                               "action, from_state, to_state, announced, reason, at_ns) "
                               "VALUES (:s, :h, :p, :a, :f, :t, :an, :r, :at)",
                        use(row_.sequence), use(row_.id), use(row_.previous_sequence),
                        use(row_.action), use(row_.from_state, row_.has_from), use(row_.state),
                        use(row_.announced), use(row_.reason), use(row_.updated_ns)));
  write_answer_.emplace(
      (session_.prepare
           << "INSERT INTO answers (poll_uuid, hazard_id, vehicle_id, answer, reason, confidence, "
              "stamp_ns, received_ns) VALUES (:u, :h, :v, :a, :r, :c, :st, :re)",
       use(row_.uuid), use(row_.id), use(row_.vehicle_id), use(row_.answer), use(row_.reason),
       use(row_.confidence), use(row_.stamp_ns), use(row_.received_ns)));
  write_life_.emplace((session_.prepare
                           << "INSERT INTO lives (class_name, ended, stood_s) VALUES (:c, :e, :s) "
                              "ON CONFLICT (class_name) DO UPDATE SET ended = excluded.ended, "
                              "stood_s = excluded.stood_s",
                       use(row_.class_name), use(row_.ended), use(row_.stood_s)));
  write_last_report_.emplace(
      (session_.prepare
           << "INSERT INTO last_reports (vehicle_id, stamp_ns, latitude, longitude, sigma_m) "
              "VALUES (:v, :st, :la, :lo, :si) ON CONFLICT (vehicle_id) DO UPDATE SET "
              "stamp_ns = excluded.stamp_ns, latitude = excluded.latitude, "
              "longitude = excluded.longitude, sigma_m = excluded.sigma_m",
       use(row_.vehicle_id), use(row_.stamp_ns), use(row_.latitude), use(row_.longitude),
       use(row_.sigma_m)));
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
  Explained("loading hazards", [&] {
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
  Explained("loading what was learned of classes", [&] {
    Implementation::Row row;
    soci::statement query =
        (implementation_->session_.prepare << "SELECT class_name, ended, stood_s FROM lives",
         soci::into(row.class_name), soci::into(row.ended), soci::into(row.stood_s));
    query.execute();
    while (query.fetch()) take(row.class_name, {row.ended, row.stood_s});
  });
}

std::uint64_t ZoneStore::LastSequence() {
  return Explained("reading the newest sequence", [&] {
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
  return Explained("looking up a report", [&]() -> std::optional<KnownReport> {
    Implementation::Row& row = implementation_->row_;
    row.reason = report_uuid.ToString();
    if (!FetchOne(*implementation_->find_report_)) return std::nullopt;
    return KnownReport{ParseUuid(row.uuid), row.vehicle_id};
  });
}

std::optional<ReportedFix> ZoneStore::FindLastReport(const std::string& vehicle_id) {
  return Explained("looking up a vehicle", [&]() -> std::optional<ReportedFix> {
    Implementation::Row& row = implementation_->row_;
    row.vehicle_id = vehicle_id;
    if (!FetchOne(*implementation_->find_last_report_)) return std::nullopt;
    return ReportedFix{row.stamp_ns, {row.latitude, row.longitude}, row.sigma_m};
  });
}

std::vector<StoredEvent> ZoneStore::LoadEvents(const Uuid& hazard, std::uint64_t sequence,
                                               std::size_t limit) {
  return Explained("reading events", [&] {
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

void ZoneStore::Begin() {
  Explained("beginning a transaction", [&] { implementation_->session_ << "BEGIN IMMEDIATE"; });
}

void ZoneStore::Commit() {
  Explained("committing", [&] { implementation_->session_ << "COMMIT"; });
}

void ZoneStore::Rollback() noexcept {
  try {
    implementation_->session_ << "ROLLBACK";
  } catch (const std::exception&) {  // See the header.
  }
}

void ZoneStore::WriteHazard(const HazardRow& written) {
  Explained("writing a hazard", [&] {
    Implementation::Row& row = implementation_->row_;
    const Hazard& hazard = written.hazard;
    row.id = static_cast<long long>(written.id);
    row.uuid = hazard.uuid.ToString();
    row.class_name = hazard.class_name;
    row.confidence = static_cast<double>(hazard.confidence);
    row.latitude = hazard.position.latitude_deg;
    row.longitude = hazard.position.longitude_deg;
    row.covariance_ee = hazard.covariance_m2(0, 0);
    row.covariance_en = hazard.covariance_m2(0, 1);
    row.covariance_nn = hazard.covariance_m2(1, 1);
    row.sightings = hazard.sightings;
    row.first_seen_ns = hazard.first_seen_ns;
    row.last_seen_ns = hazard.last_seen_ns;
    row.updated_ns = hazard.updated_ns;
    row.sequence = static_cast<long long>(hazard.sequence);
    row.announced_sequence = static_cast<long long>(hazard.announced_sequence);
    row.image_sha256 = hazard.image_sha256;
    row.image_format = hazard.image_format;
    row.state = static_cast<int>(hazard.state);
    row.presence = static_cast<double>(hazard.presence);
    row.vehicles = static_cast<int>(hazard.vehicles);
    row.life = PackLife(written.life);
    implementation_->write_hazard_->execute(true);
  });
}

void ZoneStore::WriteReport(const Report& report, std::uint64_t hazard_id,
                            const std::string& image_sha256, std::int64_t received_ns) {
  Explained("writing a report", [&] {
    Implementation::Row& row = implementation_->row_;
    row.uuid = report.uuid.ToString();
    row.id = static_cast<long long>(hazard_id);
    row.vehicle_id = report.vehicle_id;
    row.drive_id = report.drive_id;
    row.stamp_ns = report.stamp_ns;
    row.received_ns = received_ns;
    row.confidence = static_cast<double>(report.confidence);
    row.latitude = report.position.latitude_deg;
    row.longitude = report.position.longitude_deg;
    row.covariance_ee = report.covariance_m2(0, 0);
    row.covariance_en = report.covariance_m2(0, 1);
    row.covariance_nn = report.covariance_m2(1, 1);
    row.image_sha256 = image_sha256;
    implementation_->write_report_->execute(true);
  });
}

void ZoneStore::WriteEvent(const HazardEvent& event, std::uint64_t hazard_id,
                           std::uint64_t previous_sequence) {
  Explained("writing an event", [&] {
    Implementation::Row& row = implementation_->row_;
    row.sequence = static_cast<long long>(event.hazard.sequence);
    row.id = static_cast<long long>(hazard_id);
    row.previous_sequence = static_cast<long long>(previous_sequence);
    row.action = static_cast<int>(event.action);
    row.has_from = event.from ? soci::i_ok : soci::i_null;
    row.from_state = event.from ? static_cast<int>(*event.from) : 0;
    row.state = static_cast<int>(event.hazard.state);
    row.announced = event.announced ? 1 : 0;
    row.reason = event.reason;
    row.updated_ns = event.hazard.updated_ns;
    implementation_->write_event_->execute(true);
  });
}

void ZoneStore::WriteAnswer(const PollAnswer& answer, std::uint64_t hazard_id,
                            std::int64_t received_ns) {
  Explained("writing an answer", [&] {
    Implementation::Row& row = implementation_->row_;
    row.uuid = answer.poll.ToString();
    row.id = static_cast<long long>(hazard_id);
    row.vehicle_id = answer.vehicle_id;
    row.answer = static_cast<int>(answer.answer);
    row.reason = answer.reason;
    row.confidence = answer.confidence;
    row.stamp_ns = answer.stamp_ns;
    row.received_ns = received_ns;
    implementation_->write_answer_->execute(true);
  });
}

void ZoneStore::WriteLife(const std::string& class_name, const LearnedLife& learned) {
  Explained("writing what was learned of a class", [&] {
    Implementation::Row& row = implementation_->row_;
    row.class_name = class_name;
    row.ended = learned.ended;
    row.stood_s = learned.stood_s;
    implementation_->write_life_->execute(true);
  });
}

void ZoneStore::WriteLastReport(const std::string& vehicle_id, const ReportedFix& fix) {
  Explained("writing a vehicle's last report", [&] {
    Implementation::Row& row = implementation_->row_;
    row.vehicle_id = vehicle_id;
    row.stamp_ns = fix.stamp_ns;
    row.latitude = fix.position.latitude_deg;
    row.longitude = fix.position.longitude_deg;
    row.sigma_m = fix.sigma_m;
    implementation_->write_last_report_->execute(true);
  });
}

}  // namespace livemap
