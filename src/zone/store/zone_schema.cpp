#include "zone/store/zone_schema.h"

#include <array>
#include <vector>

#include "common/sqlite.h"

namespace livemap::zone {
namespace {

using Statements = std::vector<const char*>;

// Step i brings schema version i to i + 1. Never edited once released. Those up to version 8 are
// SQLite's; PostgreSQL begins with version 8 as a whole. Later steps are for both: plain SQL, whose
// ids are BIGINT. Times are ns since 1970 (UTC), positions WGS84 degrees, covariances m^2 in
// east-north axes, uuids their usual text.

const Statements& ZoneSchemaToVersion1() {
  static const Statements kStatements{
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

/// Hazards get a life, events their states. Rows refer to hazards by a small rising number, and
/// only the uuids of reports are indexed: what a commit touches at random places is what it costs.
/// All that version 1 had on its map was told to drivers.
const Statements& ZoneSchemaToVersion2() {
  static const Statements kStatements{"ALTER TABLE hazards RENAME TO hazards_1",
                                      "ALTER TABLE reports RENAME TO reports_1",
                                      "ALTER TABLE events RENAME TO events_1",
                                      R"(CREATE TABLE hazards (
           id INTEGER PRIMARY KEY,
           uuid VARCHAR(36) NOT NULL,
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
           sequence BIGINT NOT NULL,
           announced_sequence BIGINT NOT NULL,
           image_sha256 VARCHAR(64) NOT NULL,
           image_format VARCHAR(8) NOT NULL,
           state INTEGER NOT NULL,
           presence DOUBLE PRECISION NOT NULL,
           vehicles INTEGER NOT NULL,
           life TEXT NOT NULL))",
                                      R"(INSERT INTO hazards
           SELECT ROW_NUMBER() OVER (ORDER BY h.sequence), h.uuid, h.class_name, h.confidence,
                  h.latitude, h.longitude, h.covariance_ee, h.covariance_en, h.covariance_nn,
                  h.sightings, h.first_seen_ns, h.last_seen_ns, h.updated_ns, h.sequence,
                  h.sequence, h.image_sha256, h.image_format,
                  CASE WHEN h.active <> 0 THEN 1 ELSE 3 END,
                  CASE WHEN h.active <> 0 THEN 0.9 ELSE 0 END,
                  (SELECT count(DISTINCT r.vehicle_id) FROM reports_1 r
                    WHERE r.hazard_uuid = h.uuid), ''
             FROM hazards_1 h)",
                                      R"(CREATE TABLE reports (
           uuid VARCHAR(36) PRIMARY KEY,
           hazard_id INTEGER NOT NULL REFERENCES hazards (id),
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
                                      "CREATE UNIQUE INDEX hazards_1_ids ON hazards (uuid)",
                                      R"(INSERT INTO reports
           SELECT r.uuid, h.id, r.vehicle_id, r.drive_id, r.stamp_ns, r.received_ns, r.confidence,
                  r.latitude, r.longitude, r.covariance_ee, r.covariance_en, r.covariance_nn,
                  r.image_sha256
             FROM reports_1 r JOIN hazards h ON h.uuid = r.hazard_uuid ORDER BY r.received_ns)",
                                      R"(CREATE TABLE events (
           sequence INTEGER PRIMARY KEY,
           hazard_id INTEGER NOT NULL REFERENCES hazards (id),
           previous_sequence BIGINT NOT NULL,
           action INTEGER NOT NULL,
           from_state INTEGER,
           to_state INTEGER NOT NULL,
           announced INTEGER NOT NULL,
           reason TEXT NOT NULL,
           at_ns BIGINT NOT NULL))",
                                      R"(INSERT INTO events
           SELECT e.sequence, h.id,
                  LAG(e.sequence, 1, 0) OVER (PARTITION BY e.hazard_uuid ORDER BY e.sequence),
                  e.action, CASE WHEN e.action = 0 THEN NULL ELSE 1 END,
                  CASE WHEN e.action = 2 THEN 3 ELSE 1 END, 1, e.reason, e.at_ns
             FROM events_1 e JOIN hazards h ON h.uuid = e.hazard_uuid ORDER BY e.sequence)",
                                      "DROP INDEX hazards_1_ids",
                                      "DROP TABLE events_1",
                                      "DROP TABLE reports_1",
                                      "DROP TABLE hazards_1",
                                      R"(CREATE TABLE answers (
           poll_uuid VARCHAR(36) PRIMARY KEY,
           hazard_id INTEGER NOT NULL REFERENCES hazards (id),
           vehicle_id TEXT NOT NULL,
           answer INTEGER NOT NULL,
           reason TEXT NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           stamp_ns BIGINT NOT NULL,
           received_ns BIGINT NOT NULL))",
                                      R"(CREATE TABLE lives (
           class_name TEXT PRIMARY KEY,
           ended DOUBLE PRECISION NOT NULL,
           stood_s DOUBLE PRECISION NOT NULL))",
                                      R"(CREATE TABLE last_reports (
           vehicle_id TEXT PRIMARY KEY,
           stamp_ns BIGINT NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           sigma_m DOUBLE PRECISION NOT NULL))",
                                      "INSERT INTO livemap_schema (version) VALUES (2)"};
  return kStatements;
}

/// What is held against vehicles, by VehicleKey as a signed number.
const Statements& ZoneSchemaToVersion3() {
  static const Statements kStatements{
      R"(CREATE TABLE trust (
           vehicle_key BIGINT PRIMARY KEY,
           suspicion DOUBLE PRECISION NOT NULL,
           at_ns BIGINT NOT NULL,
           vouchers TEXT NOT NULL))",
      "INSERT INTO livemap_schema (version) VALUES (3)"};
  return kStatements;
}

/// Map changes. A report names its feature by uuid: it is kept when the feature is forgotten.
const Statements& ZoneSchemaToVersion4() {
  static const Statements kStatements{
      R"(CREATE TABLE map_changes (
           id INTEGER PRIMARY KEY,
           uuid VARCHAR(36) NOT NULL,
           class_name TEXT NOT NULL,
           vanished INTEGER NOT NULL,
           state INTEGER NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           covariance_ee DOUBLE PRECISION NOT NULL,
           covariance_en DOUBLE PRECISION NOT NULL,
           covariance_nn DOUBLE PRECISION NOT NULL,
           reports BIGINT NOT NULL,
           drives BIGINT NOT NULL,
           vehicles INTEGER NOT NULL,
           first_seen_ns BIGINT NOT NULL,
           last_seen_ns BIGINT NOT NULL,
           denied_ns BIGINT NOT NULL,
           updated_ns BIGINT NOT NULL,
           sequence BIGINT NOT NULL,
           witnesses TEXT NOT NULL))",
      R"(CREATE TABLE map_change_reports (
           uuid VARCHAR(36) PRIMARY KEY,
           change_uuid VARCHAR(36) NOT NULL,
           vehicle_id TEXT NOT NULL,
           drive_id TEXT NOT NULL,
           stamp_ns BIGINT NOT NULL,
           earlier_stamp_ns BIGINT NOT NULL,
           received_ns BIGINT NOT NULL,
           class_name TEXT NOT NULL,
           vanished INTEGER NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           seen BIGINT NOT NULL,
           missed BIGINT NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           covariance_ee DOUBLE PRECISION NOT NULL,
           covariance_en DOUBLE PRECISION NOT NULL,
           covariance_nn DOUBLE PRECISION NOT NULL))",
      R"(CREATE TABLE map_change_events (
           sequence INTEGER PRIMARY KEY,
           change_id INTEGER NOT NULL,
           previous_sequence BIGINT NOT NULL,
           from_state INTEGER,
           to_state INTEGER NOT NULL,
           reason TEXT NOT NULL,
           at_ns BIGINT NOT NULL))",
      "CREATE INDEX map_change_events_by_change ON map_change_events (change_id)",
      "INSERT INTO livemap_schema (version) VALUES (4)"};
  return kStatements;
}

/// Where vehicles were, for the rule of speed; the last report's place is the first of them. What
/// officials decided, with what was before, so that it can be taken back.
const Statements& ZoneSchemaToVersion5() {
  static const Statements kStatements{
      R"(CREATE TABLE IF NOT EXISTS places (
           vehicle_id TEXT NOT NULL,
           stamp_ns BIGINT NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           sigma_m DOUBLE PRECISION NOT NULL,
           messages BIGINT NOT NULL,
           PRIMARY KEY (vehicle_id, stamp_ns)))",
      R"(INSERT INTO places
           SELECT vehicle_id, stamp_ns, latitude, longitude, sigma_m, 1 FROM last_reports
            WHERE typeof(vehicle_id) = 'text' AND typeof(stamp_ns) = 'integer' AND
                  typeof(latitude) = 'real' AND typeof(longitude) = 'real' AND
                  typeof(sigma_m) = 'real' ON CONFLICT DO NOTHING)",
      "DROP TABLE last_reports",
      R"(CREATE TABLE IF NOT EXISTS decisions (
           id INTEGER PRIMARY KEY,
           kind INTEGER NOT NULL,
           subject TEXT NOT NULL,
           official TEXT NOT NULL,
           reason TEXT NOT NULL,
           at_ns BIGINT NOT NULL,
           hazards BIGINT NOT NULL,
           undone_by BIGINT NOT NULL,
           before TEXT NOT NULL,
           effects TEXT NOT NULL))",
      "CREATE INDEX IF NOT EXISTS decisions_by_subject ON decisions (subject)",
      R"(CREATE TABLE IF NOT EXISTS withdrawals (
           decision_id BIGINT NOT NULL,
           hazard_uuid VARCHAR(36) NOT NULL,
           before TEXT NOT NULL,
           PRIMARY KEY (decision_id, hazard_uuid)))",
      "INSERT INTO livemap_schema (version) VALUES (5)"};
  return kStatements;
}

/// In which direction hazards are passed. Hazards of before have none.
const Statements& ZoneSchemaToVersion6() {
  static const Statements kStatements{
      R"(CREATE TABLE IF NOT EXISTS hazard_courses (
           hazard_id INTEGER PRIMARY KEY,
           course_rad DOUBLE PRECISION NOT NULL))",
      "INSERT INTO livemap_schema (version) VALUES (6)"};
  return kStatements;
}

/// Where in the pictures of reports the hazards are, edges in shares of the picture. Pictures of
/// before have no box.
const Statements& ZoneSchemaToVersion7() {
  static const Statements kStatements{
      R"(CREATE TABLE IF NOT EXISTS report_boxes (
           id INTEGER PRIMARY KEY,
           hazard_id INTEGER NOT NULL,
           image_sha256 VARCHAR(64) NOT NULL,
           box_left DOUBLE PRECISION NOT NULL,
           box_top DOUBLE PRECISION NOT NULL,
           box_right DOUBLE PRECISION NOT NULL,
           box_bottom DOUBLE PRECISION NOT NULL))",
      "INSERT INTO livemap_schema (version) VALUES (7)"};
  return kStatements;
}

/// What officials do beside confirming and rejecting: who mends a hazard until when, what their
/// decisions changed in words, and where reports of hazards go that were edited (Redirect).
const Statements& ZoneSchemaToVersion8() {
  static const Statements kStatements{
      R"(CREATE TABLE IF NOT EXISTS decision_details (
           decision_id INTEGER PRIMARY KEY,
           detail TEXT NOT NULL))",
      R"(CREATE TABLE IF NOT EXISTS assignments (
           hazard_uuid VARCHAR(36) PRIMARY KEY,
           team TEXT NOT NULL,
           due_ns BIGINT NOT NULL,
           since_ns BIGINT NOT NULL,
           decision_id BIGINT NOT NULL))",
      R"(CREATE TABLE IF NOT EXISTS redirects (
           decision_id INTEGER PRIMARY KEY,
           kind INTEGER NOT NULL,
           class_name TEXT NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           from_uuid VARCHAR(36) NOT NULL,
           hazard_uuid VARCHAR(36) NOT NULL))",
      "INSERT INTO livemap_schema (version) VALUES (8)"};
  return kStatements;
}

/// All tables as they are in version 8, the first that PostgreSQL has: its INTEGER has 32 bits, so
/// that ids are BIGINT, and `rowid`, which SQLite's tables have anyway, is a column that counts the
/// rows of `reports`. No foreign keys, which would read a hazard's row for each report of it: the
/// zone alone writes, a hazard before what refers to it.
const Statements& PostgresqlSchemaOfVersion8() {
  static const Statements kStatements{
      R"(CREATE TABLE hazards (
           id BIGINT PRIMARY KEY,
           uuid VARCHAR(36) NOT NULL,
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
           sequence BIGINT NOT NULL,
           announced_sequence BIGINT NOT NULL,
           image_sha256 VARCHAR(64) NOT NULL,
           image_format VARCHAR(8) NOT NULL,
           state INTEGER NOT NULL,
           presence DOUBLE PRECISION NOT NULL,
           vehicles INTEGER NOT NULL,
           life TEXT NOT NULL) WITH (fillfactor = 70))",
      R"(CREATE TABLE reports (
           rowid BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
           uuid VARCHAR(36) NOT NULL UNIQUE,
           hazard_id BIGINT NOT NULL,
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
      R"(CREATE TABLE events (
           sequence BIGINT PRIMARY KEY,
           hazard_id BIGINT NOT NULL,
           previous_sequence BIGINT NOT NULL,
           action INTEGER NOT NULL,
           from_state INTEGER,
           to_state INTEGER NOT NULL,
           announced INTEGER NOT NULL,
           reason TEXT NOT NULL,
           at_ns BIGINT NOT NULL))",
      R"(CREATE TABLE answers (
           poll_uuid VARCHAR(36) PRIMARY KEY,
           hazard_id BIGINT NOT NULL,
           vehicle_id TEXT NOT NULL,
           answer INTEGER NOT NULL,
           reason TEXT NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           stamp_ns BIGINT NOT NULL,
           received_ns BIGINT NOT NULL))",
      R"(CREATE TABLE lives (
           class_name TEXT PRIMARY KEY,
           ended DOUBLE PRECISION NOT NULL,
           stood_s DOUBLE PRECISION NOT NULL) WITH (fillfactor = 70))",
      R"(CREATE TABLE trust (
           vehicle_key BIGINT PRIMARY KEY,
           suspicion DOUBLE PRECISION NOT NULL,
           at_ns BIGINT NOT NULL,
           vouchers TEXT NOT NULL) WITH (fillfactor = 70))",
      R"(CREATE TABLE map_changes (
           id BIGINT PRIMARY KEY,
           uuid VARCHAR(36) NOT NULL,
           class_name TEXT NOT NULL,
           vanished INTEGER NOT NULL,
           state INTEGER NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           covariance_ee DOUBLE PRECISION NOT NULL,
           covariance_en DOUBLE PRECISION NOT NULL,
           covariance_nn DOUBLE PRECISION NOT NULL,
           reports BIGINT NOT NULL,
           drives BIGINT NOT NULL,
           vehicles INTEGER NOT NULL,
           first_seen_ns BIGINT NOT NULL,
           last_seen_ns BIGINT NOT NULL,
           denied_ns BIGINT NOT NULL,
           updated_ns BIGINT NOT NULL,
           sequence BIGINT NOT NULL,
           witnesses TEXT NOT NULL) WITH (fillfactor = 70))",
      R"(CREATE TABLE map_change_reports (
           uuid VARCHAR(36) PRIMARY KEY,
           change_uuid VARCHAR(36) NOT NULL,
           vehicle_id TEXT NOT NULL,
           drive_id TEXT NOT NULL,
           stamp_ns BIGINT NOT NULL,
           earlier_stamp_ns BIGINT NOT NULL,
           received_ns BIGINT NOT NULL,
           class_name TEXT NOT NULL,
           vanished INTEGER NOT NULL,
           confidence DOUBLE PRECISION NOT NULL,
           seen BIGINT NOT NULL,
           missed BIGINT NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           covariance_ee DOUBLE PRECISION NOT NULL,
           covariance_en DOUBLE PRECISION NOT NULL,
           covariance_nn DOUBLE PRECISION NOT NULL))",
      R"(CREATE TABLE map_change_events (
           sequence BIGINT PRIMARY KEY,
           change_id BIGINT NOT NULL,
           previous_sequence BIGINT NOT NULL,
           from_state INTEGER,
           to_state INTEGER NOT NULL,
           reason TEXT NOT NULL,
           at_ns BIGINT NOT NULL))",
      "CREATE INDEX map_change_events_by_change ON map_change_events (change_id)",
      // Vehicles are ordered by the bytes of their names, as SQLite orders them.
      R"(CREATE TABLE places (
           vehicle_id TEXT COLLATE "C" NOT NULL,
           stamp_ns BIGINT NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           sigma_m DOUBLE PRECISION NOT NULL,
           messages BIGINT NOT NULL,
           PRIMARY KEY (vehicle_id, stamp_ns)))",
      R"(CREATE TABLE decisions (
           id BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
           kind INTEGER NOT NULL,
           subject TEXT NOT NULL,
           official TEXT NOT NULL,
           reason TEXT NOT NULL,
           at_ns BIGINT NOT NULL,
           hazards BIGINT NOT NULL,
           undone_by BIGINT NOT NULL,
           before TEXT NOT NULL,
           effects TEXT NOT NULL))",
      "CREATE INDEX decisions_by_subject ON decisions (subject)",
      R"(CREATE TABLE withdrawals (
           decision_id BIGINT NOT NULL,
           hazard_uuid VARCHAR(36) NOT NULL,
           before TEXT NOT NULL,
           PRIMARY KEY (decision_id, hazard_uuid)))",
      R"(CREATE TABLE hazard_courses (
           hazard_id BIGINT PRIMARY KEY,
           course_rad DOUBLE PRECISION NOT NULL))",
      R"(CREATE TABLE report_boxes (
           id BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,
           hazard_id BIGINT NOT NULL,
           image_sha256 VARCHAR(64) NOT NULL,
           box_left DOUBLE PRECISION NOT NULL,
           box_top DOUBLE PRECISION NOT NULL,
           box_right DOUBLE PRECISION NOT NULL,
           box_bottom DOUBLE PRECISION NOT NULL))",
      R"(CREATE TABLE decision_details (
           decision_id BIGINT PRIMARY KEY,
           detail TEXT NOT NULL))",
      R"(CREATE TABLE assignments (
           hazard_uuid VARCHAR(36) PRIMARY KEY,
           team TEXT NOT NULL,
           due_ns BIGINT NOT NULL,
           since_ns BIGINT NOT NULL,
           decision_id BIGINT NOT NULL))",
      R"(CREATE TABLE redirects (
           decision_id BIGINT PRIMARY KEY,
           kind INTEGER NOT NULL,
           class_name TEXT NOT NULL,
           latitude DOUBLE PRECISION NOT NULL,
           longitude DOUBLE PRECISION NOT NULL,
           from_uuid VARCHAR(36) NOT NULL,
           hazard_uuid VARCHAR(36) NOT NULL))",
      // One row: who writes here, and how often it has committed (ZoneStoreOwner).
      R"(CREATE TABLE livemap_owner (token VARCHAR(36) NOT NULL, commits BIGINT NOT NULL)
           WITH (fillfactor = 50))",
      "INSERT INTO livemap_schema (version) VALUES (8)"};
  return kStatements;
}

/// Which pictures came with answers to polls, and for which official's request (0: for none).
/// Pictures of before that came with answers are in the store of pictures alone.
const Statements& ZoneSchemaToVersion9() {
  static const Statements kStatements{
      R"(CREATE TABLE IF NOT EXISTS answer_pictures (
           poll_uuid VARCHAR(36) PRIMARY KEY,
           hazard_id BIGINT NOT NULL,
           image_sha256 VARCHAR(64) NOT NULL,
           decision_id BIGINT NOT NULL))",
      "CREATE INDEX IF NOT EXISTS answer_pictures_by_hazard ON answer_pictures (hazard_id)",
      "INSERT INTO livemap_schema (version) VALUES (9)"};
  return kStatements;
}

/// How vehicles passed hazards, as protocol::TrailsText writes it. Hazards of before have none.
const Statements& ZoneSchemaToVersion10() {
  static const Statements kStatements{
      R"(CREATE TABLE IF NOT EXISTS hazard_trails (
           hazard_id BIGINT PRIMARY KEY,
           trails TEXT NOT NULL))",
      "INSERT INTO livemap_schema (version) VALUES (10)"};
  return kStatements;
}

int ZoneSchemaVersion(soci::session& session) {
  session << "CREATE TABLE IF NOT EXISTS livemap_schema (version INTEGER NOT NULL)";
  int version = 0;
  session << "SELECT coalesce(max(version), 0) FROM livemap_schema", soci::into(version);
  return version;
}

}  // namespace

void MigrateZoneStore(StoreConnection& connection, const std::string& database) {
  soci::session& session = connection.session();
  const int version = ZoneSchemaVersion(session);
  if (version > kZoneSchemaVersion) {
    throw StoreError("store: database '" + database + "' has schema version " +
                     std::to_string(version) + ", this program knows versions up to " +
                     std::to_string(kZoneSchemaVersion));
  }
  const bool has_no_step = connection.is_postgresql() && version > 0 && version < kPostgresqlBegins;
  if (version < 0 || has_no_step) {
    throw StoreError("store: database '" + database + "' has schema version " +
                     std::to_string(version) + ", which no program wrote");
  }
  const std::array<const Statements*, kZoneSchemaVersion> steps{
      &ZoneSchemaToVersion1(), &ZoneSchemaToVersion2(), &ZoneSchemaToVersion3(),
      &ZoneSchemaToVersion4(), &ZoneSchemaToVersion5(), &ZoneSchemaToVersion6(),
      &ZoneSchemaToVersion7(), &ZoneSchemaToVersion8(), &ZoneSchemaToVersion9(),
      &ZoneSchemaToVersion10()};
  int step = version;
  if (connection.is_postgresql() && version == 0) {
    soci::transaction transaction(session);
    for (const char* statement : PostgresqlSchemaOfVersion8()) session << statement;
    transaction.commit();
    step = kPostgresqlBegins;
  }
  for (; step < kZoneSchemaVersion; ++step) {
    soci::transaction transaction(session);
    for (const char* statement : *steps[static_cast<std::size_t>(step)]) session << statement;
    transaction.commit();
  }
}

}  // namespace livemap::zone
