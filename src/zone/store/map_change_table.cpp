#include "zone/store/map_change_table.h"

#include <algorithm>
#include <utility>

#include "common/time.h"
#include "zone/admission/map_change_validation.h"
#include "zone/belief/map_change_witnesses.h"
#include "zone/store/event_walk.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

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

}  // namespace

MapChangeTable::MapChangeTable(soci::session& session)
    : session_(session),
      find_report_((session.prepare
                        << "SELECT CASE WHEN typeof(change_uuid) = 'text' THEN "
                           "substr(change_uuid, 1, 37) ELSE '' END, CASE WHEN typeof(vehicle_id) = "
                           "'text' THEN substr(vehicle_id, 1, 65) ELSE '' END "
                           "FROM map_change_reports WHERE uuid = :uuid",
                    soci::use(row_.uuid), soci::into(row_.change_uuid),
                    soci::into(row_.vehicle_id))),
      find_event_((session.prepare
                       << "SELECT previous_sequence, from_state, to_state, reason, at_ns FROM "
                          "map_change_events WHERE sequence = :s AND "
                       << kSoundMapChangeEvent,
                   soci::use(row_.sequence), soci::into(row_.previous_sequence),
                   soci::into(row_.from_state, row_.has_from), soci::into(row_.state),
                   soci::into(row_.reason), soci::into(row_.updated_ns))),
      write_((
          session.prepare
              << "INSERT OR REPLACE INTO map_changes (id, uuid, class_name, vanished, state, "
                 "confidence, latitude, longitude, covariance_ee, covariance_en, covariance_nn, "
                 "reports, drives, vehicles, first_seen_ns, last_seen_ns, denied_ns, updated_ns, "
                 "sequence, witnesses) VALUES (:i, :u, :c, :va, :st, :co, :la, :lo, :ee, :en, :nn, "
                 ":re, :dr, :ve, :fi, :ls, :de, :up, :se, :wi)",
          soci::use(row_.id), soci::use(row_.uuid), soci::use(row_.class_name),
          soci::use(row_.vanished), soci::use(row_.state), soci::use(row_.confidence),
          soci::use(row_.latitude), soci::use(row_.longitude), soci::use(row_.covariance_ee),
          soci::use(row_.covariance_en), soci::use(row_.covariance_nn), soci::use(row_.reports),
          soci::use(row_.drives), soci::use(row_.vehicles), soci::use(row_.first_seen_ns),
          soci::use(row_.last_seen_ns), soci::use(row_.denied_ns), soci::use(row_.updated_ns),
          soci::use(row_.sequence), soci::use(row_.witnesses))),
      write_report_(
          (session.prepare
               << "INSERT INTO map_change_reports (uuid, change_uuid, vehicle_id, drive_id, "
                  "stamp_ns, "
                  "earlier_stamp_ns, received_ns, class_name, vanished, confidence, seen, missed, "
                  "latitude, longitude, covariance_ee, covariance_en, covariance_nn) VALUES (:u, "
                  ":c, "
                  ":v, :d, :st, :ea, :re, :cl, :va, :co, :se, :mi, :la, :lo, :ee, :en, :nn)",
           soci::use(row_.uuid), soci::use(row_.change_uuid), soci::use(row_.vehicle_id),
           soci::use(row_.drive_id), soci::use(row_.stamp_ns), soci::use(row_.earlier_stamp_ns),
           soci::use(row_.received_ns), soci::use(row_.class_name), soci::use(row_.vanished),
           soci::use(row_.confidence), soci::use(row_.seen), soci::use(row_.missed),
           soci::use(row_.latitude), soci::use(row_.longitude), soci::use(row_.covariance_ee),
           soci::use(row_.covariance_en), soci::use(row_.covariance_nn))),
      write_event_((session.prepare
                        << "INSERT INTO map_change_events (sequence, change_id, previous_sequence, "
                           "from_state, to_state, reason, at_ns) VALUES (:s, :i, :p, :f, :t, :r, "
                           ":a)",
                    soci::use(row_.sequence), soci::use(row_.id), soci::use(row_.previous_sequence),
                    soci::use(row_.from_state, row_.has_from), soci::use(row_.state),
                    soci::use(row_.reason), soci::use(row_.updated_ns))),
      drop_((session.prepare << "DELETE FROM map_changes WHERE id = :i", soci::use(row_.id))),
      drop_events_((session.prepare << "DELETE FROM map_change_events WHERE change_id = :i",
                    soci::use(row_.id))) {}

ZoneStore::MapChangeRow MapChangeTable::ToMapChange(const Row& row) {
  ZoneStore::MapChangeRow result;
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

void MapChangeTable::PutPlace(const geo::GeoPoint& position, const Eigen::Matrix2d& covariance_m2) {
  row_.latitude = position.latitude_deg;
  row_.longitude = position.longitude_deg;
  row_.covariance_ee = covariance_m2(0, 0);
  row_.covariance_en = covariance_m2(0, 1);
  row_.covariance_nn = covariance_m2(1, 1);
}

StoreDamage MapChangeTable::Load(const std::function<void(ZoneStore::MapChangeRow)>& take) {
  return ExplainStore("loading map changes", [&] {
    using soci::into;
    Row row;
    soci::statement query =
        (session_.prepare
             << "SELECT id, uuid, class_name, vanished, state, confidence, latitude, longitude, "
                "covariance_ee, covariance_en, covariance_nn, reports, drives, first_seen_ns, "
                "last_seen_ns, denied_ns, updated_ns, sequence, witnesses FROM map_changes WHERE "
             << kSoundMapChange << " ORDER BY sequence, id",
         into(row.id), into(row.uuid), into(row.class_name), into(row.vanished), into(row.state),
         into(row.confidence), into(row.latitude), into(row.longitude), into(row.covariance_ee),
         into(row.covariance_en), into(row.covariance_nn), into(row.reports), into(row.drives),
         into(row.first_seen_ns), into(row.last_seen_ns), into(row.denied_ns), into(row.updated_ns),
         into(row.sequence), into(row.witnesses));
    return LoadRows(session_, "map_changes", query, [&] { take(ToMapChange(row)); });
  });
}

std::uint64_t MapChangeTable::LastId() {
  return ExplainStore("reading the newest map change", [&] {
    long long id = 0;
    session_ << "SELECT coalesce(max(id), 0) FROM map_changes WHERE id <= :most",
        soci::use(kMaxRowId), soci::into(id);
    return static_cast<std::uint64_t>(std::max(id, 0LL));
  });
}

std::optional<ZoneStore::KnownMapChangeReport> MapChangeTable::FindReport(const Uuid& report_uuid) {
  return ExplainStore("looking up a map change",
                      [&]() -> std::optional<ZoneStore::KnownMapChangeReport> {
                        row_.uuid = report_uuid.ToString();
                        if (!FetchOne(find_report_)) return std::nullopt;
                        return ZoneStore::KnownMapChangeReport{
                            Uuid::Parse(row_.change_uuid).value_or(Uuid{}), row_.vehicle_id};
                      });
}

std::vector<StoredMapChangeEvent> MapChangeTable::LoadEvents(std::uint64_t sequence,
                                                             std::size_t limit) {
  return ExplainStore("reading events of a map change", [&] {
    return WalkEvents(sequence, limit, find_event_, row_, [](const auto& read) {
      return EventOf<StoredMapChangeEvent>(read, kMapChangeStates);
    });
  });
}

void MapChangeTable::Write(const ZoneStore::MapChangeRow& written) {
  ExplainStore("writing a map change", [&] {
    const MapChangeFeature& feature = written.feature;
    row_.id = static_cast<long long>(written.id);
    row_.uuid = feature.uuid.ToString();
    row_.class_name = feature.class_name;
    row_.vanished = feature.vanished ? 1 : 0;
    row_.state = static_cast<int>(feature.state);
    row_.confidence = static_cast<double>(feature.confidence);
    PutPlace(feature.position, feature.covariance_m2);
    row_.reports = feature.reports;
    row_.drives = feature.drives;
    row_.vehicles = static_cast<int>(feature.Vehicles());
    row_.first_seen_ns = feature.first_seen_ns;
    row_.last_seen_ns = feature.last_seen_ns;
    row_.denied_ns = feature.denied_ns;
    row_.updated_ns = feature.updated_ns;
    row_.sequence = static_cast<long long>(feature.sequence);
    row_.witnesses = PackWitnesses(feature.witnesses);
    write_.execute(true);
  });
}

void MapChangeTable::Drop(std::uint64_t id) {
  ExplainStore("forgetting a map change", [&] {
    row_.id = static_cast<long long>(id);
    drop_.execute(true);
    drop_events_.execute(true);
  });
}

void MapChangeTable::WriteReport(const protocol::MapChangeReport& report, const Uuid& change,
                                 std::int64_t received_ns) {
  ExplainStore("writing what a vehicle told of a map change", [&] {
    row_.uuid = report.uuid.ToString();
    row_.change_uuid = change.ToString();
    row_.vehicle_id = report.vehicle_id;
    row_.drive_id = report.drive_id;
    row_.stamp_ns = report.stamp_ns;
    row_.earlier_stamp_ns = report.earlier_stamp_ns;
    row_.received_ns = received_ns;
    row_.class_name = report.class_name;
    row_.vanished = report.vanished ? 1 : 0;
    row_.confidence = static_cast<double>(report.confidence);
    row_.seen = report.seen;
    row_.missed = report.missed;
    PutPlace(report.position, report.covariance_m2);
    write_report_.execute(true);
  });
}

void MapChangeTable::WriteEvent(const MapChangeEvent& event, std::uint64_t id) {
  ExplainStore("writing an event of a map change", [&] {
    row_.sequence = static_cast<long long>(event.feature.sequence);
    row_.id = static_cast<long long>(id);
    row_.previous_sequence = static_cast<long long>(event.previous_sequence);
    row_.has_from = event.from ? soci::i_ok : soci::i_null;
    row_.from_state = event.from ? static_cast<int>(*event.from) : 0;
    row_.state = static_cast<int>(event.feature.state);
    row_.reason = event.reason;
    row_.updated_ns = event.feature.updated_ns;
    write_event_.execute(true);
  });
}

}  // namespace livemap::zone
