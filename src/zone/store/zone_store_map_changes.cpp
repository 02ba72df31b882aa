// What ZoneStore reads and writes of map changes; see zone_store_read.cpp for how far a file is
// trusted.
#include <soci/soci.h>

#include <algorithm>
#include <utility>

#include "common/time.h"
#include "zone/admission/map_change_validation.h"
#include "zone/belief/map_change_witnesses.h"
#include "zone/store/event_walk.h"
#include "zone/store/store_validation.h"
#include "zone/store/zone_store_state.h"

namespace livemap::zone {
namespace {

constexpr char kSoundMapChange[] =
    "typeof(uuid) = 'text' AND length(CAST(uuid AS BLOB)) = 36 AND "
    "typeof(class_name) = 'text' AND length(CAST(class_name AS BLOB)) <= 64 AND "
    "typeof(vanished) = 'integer' AND typeof(state) = 'integer' AND "
    "typeof(confidence) IN ('real', 'integer') AND typeof(latitude) IN ('real', 'integer') AND "
    "typeof(longitude) IN ('real', 'integer') AND typeof(covariance_ee) IN ('real', 'integer') "
    "AND typeof(covariance_en) IN ('real', 'integer') AND "
    "typeof(covariance_nn) IN ('real', 'integer') AND typeof(reports) = 'integer' AND "
    "typeof(drives) = 'integer' AND typeof(first_seen_ns) = 'integer' AND "
    "typeof(last_seen_ns) = 'integer' AND typeof(denied_ns) = 'integer' AND "
    "typeof(updated_ns) = 'integer' AND typeof(sequence) = 'integer' AND "
    "typeof(witnesses) = 'text' AND length(CAST(witnesses AS BLOB)) <= 4096";
constexpr char kSoundMapChangeEvent[] =
    "typeof(previous_sequence) = 'integer' AND typeof(from_state) IN ('integer', 'null') AND "
    "typeof(to_state) = 'integer' AND typeof(reason) = 'text' AND "
    "length(CAST(reason AS BLOB)) <= 200 AND typeof(at_ns) = 'integer'";

/// Why these are no values of a map change; nullptr when they are.
template <typename Row>
const char* WhyNoMapChange(const Row& row, const MapChangeFeature& feature) {
  const bool counts = row.id >= 1 && row.id <= kMaxRowId && row.reports >= 1 &&
                      row.reports <= UINT32_MAX && row.drives >= 0 && row.drives <= row.reports;
  if (!counts) return "counts out of range";
  if (feature.uuid.IsNil()) return "no uuid";
  if (!IsMapChangeClass(feature.class_name)) return "no class of changes";
  if (!(row.confidence >= 0 && row.confidence <= 1)) return "no probability";
  if (!geo::IsValid(feature.position)) return "no position on Earth";
  if (!IsCovariance(feature.covariance_m2)) return "no covariance";
  const bool times = IsStamp(row.first_seen_ns) && IsStamp(row.last_seen_ns) &&
                     IsStamp(row.denied_ns) && IsStamp(row.updated_ns) &&
                     row.first_seen_ns <= row.last_seen_ns;
  if (!times) return "no times";
  if (row.sequence < 1 || row.sequence >= kMaxSequence) return "no sequence";
  return IsIndex(row.state, kMapChangeStates) ? nullptr : "no state";
}

template <typename Row>
void PutPlace(const geo::GeoPoint& position, const Eigen::Matrix2d& covariance_m2, Row& row) {
  row.latitude = position.latitude_deg;
  row.longitude = position.longitude_deg;
  row.covariance_ee = covariance_m2(0, 0);
  row.covariance_en = covariance_m2(0, 1);
  row.covariance_nn = covariance_m2(1, 1);
}

}  // namespace

ZoneStore::MapChangeRow ZoneStore::Implementation::ToMapChange(const ChangeRow& row) {
  MapChangeRow result;
  result.id = static_cast<std::uint64_t>(row.id);
  MapChangeFeature& feature = result.feature;
  feature.uuid = Uuid::Parse(row.uuid).value_or(Uuid{});
  feature.class_name = row.class_name;
  feature.vanished = row.vanished != 0;
  feature.confidence = static_cast<float>(row.confidence);
  feature.position = {row.latitude, row.longitude};
  feature.covariance_m2 << row.covariance_ee, row.covariance_en, row.covariance_en,
      row.covariance_nn;
  feature.reports = static_cast<std::uint32_t>(row.reports);
  feature.drives = static_cast<std::uint32_t>(row.drives);
  feature.first_seen_ns = row.first_seen_ns;
  feature.last_seen_ns = row.last_seen_ns;
  feature.denied_ns = row.denied_ns;
  feature.updated_ns = row.updated_ns;
  feature.sequence = static_cast<std::uint64_t>(row.sequence);
  const std::string name = "map change " + std::to_string(row.id);
  if (const char* why = WhyNoMapChange(row, feature)) throw Error(name + " has " + why);
  feature.state = static_cast<MapChangeState>(row.state);
  auto witnesses = UnpackWitnesses(row.witnesses);
  if (!witnesses) throw Error(name + " has no witnesses that can be read");
  feature.witnesses = *std::move(witnesses);
  return result;
}

void ZoneStore::Implementation::PrepareMapChangeReads() {
  using soci::into;
  using soci::use;
  ChangeRow& row = change_row_;
  find_map_change_report_.emplace(
      (session_.prepare << "SELECT CASE WHEN typeof(change_uuid) = 'text' THEN "
                           "substr(change_uuid, 1, 37) ELSE '' END, CASE WHEN typeof(vehicle_id) = "
                           "'text' THEN substr(vehicle_id, 1, 65) ELSE '' END "
                           "FROM map_change_reports WHERE uuid = :uuid",
       use(row.uuid), into(row.change_uuid), into(row.vehicle_id)));
  find_map_change_event_.emplace(
      (session_.prepare << "SELECT previous_sequence, from_state, to_state, reason, at_ns FROM "
                           "map_change_events WHERE sequence = :s AND "
                        << kSoundMapChangeEvent,
       use(row.sequence), into(row.previous_sequence), into(row.from_state, row.has_from),
       into(row.state), into(row.reason), into(row.updated_ns)));
}

void ZoneStore::Implementation::PrepareMapChangeWrites() {
  using soci::use;
  ChangeRow& row = change_row_;
  write_map_change_.emplace(
      (session_.prepare
           << "INSERT OR REPLACE INTO map_changes (id, uuid, class_name, vanished, state, "
              "confidence, latitude, longitude, covariance_ee, covariance_en, covariance_nn, "
              "reports, drives, vehicles, first_seen_ns, last_seen_ns, denied_ns, updated_ns, "
              "sequence, witnesses) VALUES (:i, :u, :c, :va, :st, :co, :la, :lo, :ee, :en, :nn, "
              ":re, :dr, :ve, :fi, :ls, :de, :up, :se, :wi)",
       use(row.id), use(row.uuid), use(row.class_name), use(row.vanished), use(row.state),
       use(row.confidence), use(row.latitude), use(row.longitude), use(row.covariance_ee),
       use(row.covariance_en), use(row.covariance_nn), use(row.reports), use(row.drives),
       use(row.vehicles), use(row.first_seen_ns), use(row.last_seen_ns), use(row.denied_ns),
       use(row.updated_ns), use(row.sequence), use(row.witnesses)));
  write_map_change_report_.emplace(
      (session_.prepare
           << "INSERT INTO map_change_reports (uuid, change_uuid, vehicle_id, drive_id, stamp_ns, "
              "earlier_stamp_ns, received_ns, class_name, vanished, confidence, seen, missed, "
              "latitude, longitude, covariance_ee, covariance_en, covariance_nn) VALUES (:u, :c, "
              ":v, :d, :st, :ea, :re, :cl, :va, :co, :se, :mi, :la, :lo, :ee, :en, :nn)",
       use(row.uuid), use(row.change_uuid), use(row.vehicle_id), use(row.drive_id),
       use(row.stamp_ns), use(row.earlier_stamp_ns), use(row.received_ns), use(row.class_name),
       use(row.vanished), use(row.confidence), use(row.seen), use(row.missed), use(row.latitude),
       use(row.longitude), use(row.covariance_ee), use(row.covariance_en), use(row.covariance_nn)));
  write_map_change_event_.emplace(
      (session_.prepare << "INSERT INTO map_change_events (sequence, change_id, previous_sequence, "
                           "from_state, to_state, reason, at_ns) VALUES (:s, :i, :p, :f, :t, :r, "
                           ":a)",
       use(row.sequence), use(row.id), use(row.previous_sequence),
       use(row.from_state, row.has_from), use(row.state), use(row.reason), use(row.updated_ns)));
  drop_map_change_.emplace(
      (session_.prepare << "DELETE FROM map_changes WHERE id = :i", use(row.id)));
  drop_map_change_events_.emplace(
      (session_.prepare << "DELETE FROM map_change_events WHERE change_id = :i", use(row.id)));
}

StoreDamage ZoneStore::LoadMapChanges(const std::function<void(MapChangeRow)>& take) {
  return ExplainStore("loading map changes", [&] {
    using soci::into;
    Implementation::ChangeRow row;
    soci::statement query =
        (implementation_->session_.prepare
             << "SELECT id, uuid, class_name, vanished, state, confidence, latitude, longitude, "
                "covariance_ee, covariance_en, covariance_nn, reports, drives, first_seen_ns, "
                "last_seen_ns, denied_ns, updated_ns, sequence, witnesses FROM map_changes WHERE "
             << kSoundMapChange << " ORDER BY sequence, id",
         into(row.id), into(row.uuid), into(row.class_name), into(row.vanished), into(row.state),
         into(row.confidence), into(row.latitude), into(row.longitude), into(row.covariance_ee),
         into(row.covariance_en), into(row.covariance_nn), into(row.reports), into(row.drives),
         into(row.first_seen_ns), into(row.last_seen_ns), into(row.denied_ns), into(row.updated_ns),
         into(row.sequence), into(row.witnesses));
    return implementation_->LoadRows("map_changes", query,
                                     [&] { take(Implementation::ToMapChange(row)); });
  });
}

std::uint64_t ZoneStore::LastMapChangeId() {
  return ExplainStore("reading the newest map change", [&] {
    long long id = 0;
    implementation_->session_ << "SELECT coalesce(max(id), 0) FROM map_changes WHERE id <= :most",
        soci::use(kMaxRowId), soci::into(id);
    return static_cast<std::uint64_t>(std::max(id, 0LL));
  });
}

std::optional<ZoneStore::KnownMapChangeReport> ZoneStore::FindMapChangeReport(
    const Uuid& report_uuid) {
  return ExplainStore("looking up a map change", [&]() -> std::optional<KnownMapChangeReport> {
    Implementation::ChangeRow& row = implementation_->change_row_;
    row.uuid = report_uuid.ToString();
    if (!FetchOne(*implementation_->find_map_change_report_)) return std::nullopt;
    return KnownMapChangeReport{Uuid::Parse(row.change_uuid).value_or(Uuid{}), row.vehicle_id};
  });
}

std::vector<StoredMapChangeEvent> ZoneStore::LoadMapChangeEvents(std::uint64_t sequence,
                                                                 std::size_t limit) {
  return ExplainStore("reading events of a map change", [&] {
    Implementation::ChangeRow& row = implementation_->change_row_;
    return WalkEvents(
        sequence, limit, *implementation_->find_map_change_event_, row,
        [](const auto& read) { return EventOf<StoredMapChangeEvent>(read, kMapChangeStates); });
  });
}

void ZoneStore::WriteMapChange(const MapChangeRow& written) {
  ExplainStore("writing a map change", [&] {
    Implementation::ChangeRow& row = implementation_->change_row_;
    const MapChangeFeature& feature = written.feature;
    row.id = static_cast<long long>(written.id);
    row.uuid = feature.uuid.ToString();
    row.class_name = feature.class_name;
    row.vanished = feature.vanished ? 1 : 0;
    row.state = static_cast<int>(feature.state);
    row.confidence = static_cast<double>(feature.confidence);
    PutPlace(feature.position, feature.covariance_m2, row);
    row.reports = feature.reports;
    row.drives = feature.drives;
    row.vehicles = static_cast<int>(feature.Vehicles());
    row.first_seen_ns = feature.first_seen_ns;
    row.last_seen_ns = feature.last_seen_ns;
    row.denied_ns = feature.denied_ns;
    row.updated_ns = feature.updated_ns;
    row.sequence = static_cast<long long>(feature.sequence);
    row.witnesses = PackWitnesses(feature.witnesses);
    implementation_->write_map_change_->execute(true);
  });
}

void ZoneStore::DropMapChange(std::uint64_t id) {
  ExplainStore("forgetting a map change", [&] {
    implementation_->change_row_.id = static_cast<long long>(id);
    implementation_->drop_map_change_->execute(true);
    implementation_->drop_map_change_events_->execute(true);
  });
}

void ZoneStore::WriteMapChangeReport(const protocol::MapChangeReport& report, const Uuid& change,
                                     std::int64_t received_ns) {
  ExplainStore("writing what a vehicle told of a map change", [&] {
    Implementation::ChangeRow& row = implementation_->change_row_;
    row.uuid = report.uuid.ToString();
    row.change_uuid = change.ToString();
    row.vehicle_id = report.vehicle_id;
    row.drive_id = report.drive_id;
    row.stamp_ns = report.stamp_ns;
    row.earlier_stamp_ns = report.earlier_stamp_ns;
    row.received_ns = received_ns;
    row.class_name = report.class_name;
    row.vanished = report.vanished ? 1 : 0;
    row.confidence = static_cast<double>(report.confidence);
    row.seen = report.seen;
    row.missed = report.missed;
    PutPlace(report.position, report.covariance_m2, row);
    implementation_->write_map_change_report_->execute(true);
  });
}

void ZoneStore::WriteMapChangeEvent(const MapChangeEvent& event, std::uint64_t id) {
  ExplainStore("writing an event of a map change", [&] {
    Implementation::ChangeRow& row = implementation_->change_row_;
    row.sequence = static_cast<long long>(event.feature.sequence);
    row.id = static_cast<long long>(id);
    row.previous_sequence = static_cast<long long>(event.previous_sequence);
    row.has_from = event.from ? soci::i_ok : soci::i_null;
    row.from_state = event.from ? static_cast<int>(*event.from) : 0;
    row.state = static_cast<int>(event.feature.state);
    row.reason = event.reason;
    row.updated_ns = event.feature.updated_ns;
    implementation_->write_map_change_event_->execute(true);
  });
}

}  // namespace livemap::zone
