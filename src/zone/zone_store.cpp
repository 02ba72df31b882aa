#include "zone/zone_store.h"

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <array>
#include <utility>

#include "base/sqlite.h"

namespace livemap {
namespace {

/// Step i brings schema version i to i + 1; each in its own transaction. Never edited once
/// released. Plain SQL that other databases understand: times are ns since 1970 (UTC), positions
/// WGS84 degrees, covariances m^2 in east-north axes, uuids their usual text.
const std::array<const char*, 5>& FirstSchema() {
  static const std::array<const char*, 5> kStatements{
      R"(CREATE TABLE hazards (
           uuid VARCHAR(36) PRIMARY KEY,
           class_name TEXT NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           covariance_ee DOUBLE PRECISION NOT NULL,
           covariance_en DOUBLE PRECISION NOT NULL,
           covariance_nn DOUBLE PRECISION NOT NULL,
           sightings BIGINT NOT NULL,
           first_seen_ns BIGINT NOT NULL,
           last_seen_ns BIGINT NOT NULL,
           updated_ns BIGINT NOT NULL,
           sequence BIGINT NOT NULL UNIQUE,
           image_sha256 VARCHAR(64) NOT NULL,
           image_format VARCHAR(8) NOT NULL,
           active INTEGER NOT NULL))",
      R"(CREATE TABLE reports (
           uuid VARCHAR(36) PRIMARY KEY,
           hazard_uuid VARCHAR(36) NOT NULL REFERENCES hazards (uuid),
           vehicle_id TEXT NOT NULL,
           drive_id TEXT NOT NULL,
           stamp_ns BIGINT NOT NULL,
           received_ns BIGINT NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           covariance_ee DOUBLE PRECISION NOT NULL,
           covariance_en DOUBLE PRECISION NOT NULL,
           covariance_nn DOUBLE PRECISION NOT NULL,
           image_sha256 VARCHAR(64) NOT NULL))",
      "CREATE INDEX reports_by_hazard ON reports (hazard_uuid)",
      R"(CREATE TABLE events (
           sequence BIGINT PRIMARY KEY,
           hazard_uuid VARCHAR(36) NOT NULL REFERENCES hazards (uuid),
           action INTEGER NOT NULL,
           reason TEXT NOT NULL,
           at_ns BIGINT NOT NULL))",
      "INSERT INTO livemap_schema (version) VALUES (1)"};
  return kStatements;
}

constexpr int kSchemaVersion = 1;

}  // namespace

/// The values of all statements: SOCI binds to places, not to values.
struct ZoneStoreRow {
  std::string uuid, hazard_uuid, class_name, vehicle_id, drive_id, image_sha256, image_format;
  std::string reason;
  double confidence = 0, latitude = 0, longitude = 0;
  double covariance_ee = 0, covariance_en = 0, covariance_nn = 0;
  long long sightings = 0, first_seen_ns = 0, last_seen_ns = 0, updated_ns = 0, sequence = 0;
  long long stamp_ns = 0, received_ns = 0;
  int active = 0, action = 0;
};

namespace {

using Row = ZoneStoreRow;

Uuid ParseUuid(const std::string& text) {
  const auto uuid = Uuid::Parse(text);
  if (!uuid) throw StoreError("store: '" + text + "' stands where a uuid belongs");
  return *uuid;
}

Hazard ToHazard(const Row& row) {
  Hazard hazard;
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
  hazard.image_sha256 = row.image_sha256;
  hazard.image_format = row.image_format;
  hazard.state = row.active != 0 ? HazardState::kActive : HazardState::kGone;
  return hazard;
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

  void Prepare() {
    session_ << "PRAGMA synchronous=FULL";
    std::string mode;
    session_ << "PRAGMA journal_mode=WAL", soci::into(mode);
    session_ << "PRAGMA foreign_keys=ON";
    std::string verdict;
    session_ << "PRAGMA quick_check(1)", soci::into(verdict);
    if (verdict != "ok") {
      throw StoreError("store: database '" + path_ + "' is damaged: " + verdict);
    }
    Migrate();
    PrepareStatements();
  }

  int Version() {
    session_ << "CREATE TABLE IF NOT EXISTS livemap_schema (version INTEGER NOT NULL)";
    int version = 0;
    session_ << "SELECT coalesce(max(version), 0) FROM livemap_schema", soci::into(version);
    return version;
  }

  void Migrate() {
    const int version = Version();
    if (version > kSchemaVersion) {
      throw StoreError("store: database '" + path_ + "' has schema version " +
                       std::to_string(version) + ", this program knows versions up to " +
                       std::to_string(kSchemaVersion));
    }
    if (version == kSchemaVersion) return;
    soci::transaction transaction(session_);
    for (const char* statement : FirstSchema()) session_ << statement;
    transaction.commit();
  }

  void PrepareStatements();

  /// Declared before the statements, which must go first.
  std::string path_;
  soci::session session_;
  Row row_;
  std::optional<soci::statement> find_report_;
  std::optional<soci::statement> write_hazard_;
  std::optional<soci::statement> write_report_;
  std::optional<soci::statement> write_event_;
};

void ZoneStore::Implementation::PrepareStatements() {
  using soci::use;
  find_report_.emplace(
      (session_.prepare << "SELECT hazard_uuid, vehicle_id FROM reports WHERE uuid = :uuid",
       use(row_.uuid), soci::into(row_.hazard_uuid), soci::into(row_.vehicle_id)));
  write_hazard_.emplace(
      (session_.prepare
           << "INSERT INTO hazards (uuid, class_name, confidence, latitude, longitude, "
              "covariance_ee, covariance_en, covariance_nn, sightings, first_seen_ns, "
              "last_seen_ns, updated_ns, sequence, image_sha256, image_format, active) VALUES "
              "(:u, :c, :co, :la, :lo, :ee, :en, :nn, :si, :fi, :ls, :up, :se, :is, :im, :ac) "
              "ON CONFLICT (uuid) DO UPDATE SET confidence = excluded.confidence, "
              "latitude = excluded.latitude, longitude = excluded.longitude, "
              "covariance_ee = excluded.covariance_ee, covariance_en = excluded.covariance_en, "
              "covariance_nn = excluded.covariance_nn, sightings = excluded.sightings, "
              "first_seen_ns = excluded.first_seen_ns, last_seen_ns = excluded.last_seen_ns, "
              "updated_ns = excluded.updated_ns, sequence = excluded.sequence, "
              "image_sha256 = excluded.image_sha256, image_format = excluded.image_format, "
              "active = excluded.active",
       use(row_.uuid), use(row_.class_name), use(row_.confidence), use(row_.latitude),
       use(row_.longitude), use(row_.covariance_ee), use(row_.covariance_en),
       use(row_.covariance_nn), use(row_.sightings), use(row_.first_seen_ns),
       use(row_.last_seen_ns), use(row_.updated_ns), use(row_.sequence), use(row_.image_sha256),
       use(row_.image_format), use(row_.active)));
  write_report_.emplace(
      (session_.prepare
           << "INSERT INTO reports (uuid, hazard_uuid, vehicle_id, drive_id, stamp_ns, "
              "received_ns, confidence, latitude, longitude, covariance_ee, covariance_en, "
              "covariance_nn, image_sha256) VALUES "
              "(:u, :h, :v, :d, :st, :re, :co, :la, :lo, :ee, :en, :nn, :im)",
       use(row_.uuid), use(row_.hazard_uuid), use(row_.vehicle_id), use(row_.drive_id),
       use(row_.stamp_ns), use(row_.received_ns), use(row_.confidence), use(row_.latitude),
       use(row_.longitude), use(row_.covariance_ee), use(row_.covariance_en),
       use(row_.covariance_nn), use(row_.image_sha256)));
  write_event_.emplace((session_.prepare
                            << "INSERT INTO events (sequence, hazard_uuid, action, reason, at_ns) "
                               "VALUES (:s, :h, :a, :r, :t)",
                        use(row_.sequence), use(row_.hazard_uuid), use(row_.action),
                        use(row_.reason), use(row_.updated_ns)));
}

ZoneStore::ZoneStore(const std::string& path) {
  Explained("opening '" + path + "'",
            [&] { implementation_ = std::make_unique<Implementation>(path); });
}

ZoneStore::~ZoneStore() = default;

int ZoneStore::SchemaVersion() { return kSchemaVersion; }

void ZoneStore::LoadHazards(const std::function<void(Hazard)>& take) {
  Explained("loading hazards", [&] {
    Row row;
    soci::statement query =
        (implementation_->session_.prepare
             << "SELECT uuid, class_name, confidence, latitude, longitude, covariance_ee, "
                "covariance_en, covariance_nn, sightings, first_seen_ns, last_seen_ns, "
                "updated_ns, sequence, image_sha256, image_format, active FROM hazards "
                "ORDER BY sequence",
         soci::into(row.uuid), soci::into(row.class_name), soci::into(row.confidence),
         soci::into(row.latitude), soci::into(row.longitude), soci::into(row.covariance_ee),
         soci::into(row.covariance_en), soci::into(row.covariance_nn), soci::into(row.sightings),
         soci::into(row.first_seen_ns), soci::into(row.last_seen_ns), soci::into(row.updated_ns),
         soci::into(row.sequence), soci::into(row.image_sha256), soci::into(row.image_format),
         soci::into(row.active));
    query.execute();
    while (query.fetch()) take(ToHazard(row));
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

std::optional<ZoneStore::KnownReport> ZoneStore::FindReport(const Uuid& report_uuid) {
  return Explained("looking up a report", [&]() -> std::optional<KnownReport> {
    Row& row = implementation_->row_;
    row.uuid = report_uuid.ToString();
    soci::statement& find = *implementation_->find_report_;
    if (!find.execute(true)) return std::nullopt;
    const KnownReport known{ParseUuid(row.hazard_uuid), row.vehicle_id};
    // Read to the end: an unfinished query would keep its snapshot and with it the whole WAL.
    while (find.fetch()) {
    }
    return known;
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

void ZoneStore::WriteHazard(const Hazard& hazard) {
  Explained("writing a hazard", [&] {
    Row& row = implementation_->row_;
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
    row.image_sha256 = hazard.image_sha256;
    row.image_format = hazard.image_format;
    row.active = IsOnMap(hazard.state) ? 1 : 0;
    implementation_->write_hazard_->execute(true);
  });
}

void ZoneStore::WriteReport(const Report& report, const Uuid& hazard_uuid,
                            const std::string& image_sha256, std::int64_t received_ns) {
  Explained("writing a report", [&] {
    Row& row = implementation_->row_;
    row.uuid = report.uuid.ToString();
    row.hazard_uuid = hazard_uuid.ToString();
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

void ZoneStore::WriteEvent(const HazardEvent& event, const std::string& reason) {
  Explained("writing an event", [&] {
    Row& row = implementation_->row_;
    row.sequence = static_cast<long long>(event.hazard.sequence);
    row.hazard_uuid = event.hazard.uuid.ToString();
    row.action = static_cast<int>(event.action);
    row.reason = reason;
    row.updated_ns = event.hazard.updated_ns;
    implementation_->write_event_->execute(true);
  });
}

}  // namespace livemap
