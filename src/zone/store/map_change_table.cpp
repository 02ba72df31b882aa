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

std::string IsSoundMapChange(const Dialect& dialect) {
  return dialect.AreTexts({{"uuid", 36}, {"class_name", 64}, {"witnesses", 4096}}) + " AND " +
         dialect.AreNumbers({"confidence", "latitude", "longitude", "covariance_ee",
                             "covariance_en", "covariance_nn"}) +
         " AND " +
         dialect.AreIntegers({"vanished", "state", "reports", "drives", "first_seen_ns",
                              "last_seen_ns", "denied_ns", "updated_ns", "sequence"});
}
std::string IsSoundMapChangeEvent(const Dialect& dialect) {
  return dialect.AreIntegers({"previous_sequence", "to_state", "at_ns"}) + " AND " +
         dialect.IsIntegerOrNull("from_state") + " AND " + dialect.AreTexts({{"reason", 200}});
}

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

MapChangeTable::MapChangeTable(StoreConnection& connection)
    : connection_(connection),
      find_report_((connection.session().prepare
                        << "SELECT " << connection.dialect().TextOrEmpty("change_uuid", 37) << ", "
                        << connection.dialect().TextOrEmpty("vehicle_id", 65)
                        << " FROM map_change_reports WHERE uuid = :uuid",
                    soci::use(row_.uuid), soci::into(row_.change_uuid),
                    soci::into(row_.vehicle_id))),
      find_event_((connection.session().prepare
                       << "SELECT previous_sequence, from_state, to_state, reason, at_ns FROM "
                          "map_change_events WHERE sequence = :s AND "
                       << IsSoundMapChangeEvent(connection.dialect()),
                   soci::use(row_.sequence), soci::into(row_.previous_sequence),
                   soci::into(row_.from_state, row_.has_from), soci::into(row_.state),
                   soci::into(row_.reason), soci::into(row_.updated_ns))),
      write_(connection,
             "INSERT INTO map_changes (id, uuid, class_name, vanished, state, "
             "confidence, latitude, longitude, covariance_ee, covariance_en, covariance_nn, "
             "reports, drives, vehicles, first_seen_ns, last_seen_ns, denied_ns, updated_ns, "
             "sequence, witnesses) VALUES (:i, :u, :c, :va, :st, :co, :la, :lo, :ee, :en, :nn, "
             ":re, :dr, :ve, :fi, :ls, :de, :up, :se, :wi) ON CONFLICT (id) DO UPDATE SET "
             "uuid = excluded.uuid, class_name = excluded.class_name, "
             "vanished = excluded.vanished, state = excluded.state, "
             "confidence = excluded.confidence, latitude = excluded.latitude, "
             "longitude = excluded.longitude, covariance_ee = excluded.covariance_ee, "
             "covariance_en = excluded.covariance_en, covariance_nn = excluded.covariance_nn, "
             "reports = excluded.reports, drives = excluded.drives, "
             "vehicles = excluded.vehicles, first_seen_ns = excluded.first_seen_ns, "
             "last_seen_ns = excluded.last_seen_ns, denied_ns = excluded.denied_ns, "
             "updated_ns = excluded.updated_ns, sequence = excluded.sequence, "
             "witnesses = excluded.witnesses",
             {row_.id,
              row_.uuid,
              row_.class_name,
              row_.vanished,
              row_.state,
              row_.confidence,
              row_.latitude,
              row_.longitude,
              row_.covariance_ee,
              row_.covariance_en,
              row_.covariance_nn,
              row_.reports,
              row_.drives,
              row_.vehicles,
              row_.first_seen_ns,
              row_.last_seen_ns,
              row_.denied_ns,
              row_.updated_ns,
              row_.sequence,
              row_.witnesses}),
      write_report_(
          connection,
          "INSERT INTO map_change_reports (uuid, change_uuid, vehicle_id, drive_id, "
          "stamp_ns, "
          "earlier_stamp_ns, received_ns, class_name, vanished, confidence, seen, missed, "
          "latitude, longitude, covariance_ee, covariance_en, covariance_nn) VALUES (:u, "
          ":c, "
          ":v, :d, :st, :ea, :re, :cl, :va, :co, :se, :mi, :la, :lo, :ee, :en, :nn)",
          {row_.uuid, row_.change_uuid, row_.vehicle_id, row_.drive_id, row_.stamp_ns,
           row_.earlier_stamp_ns, row_.received_ns, row_.class_name, row_.vanished, row_.confidence,
           row_.seen, row_.missed, row_.latitude, row_.longitude, row_.covariance_ee,
           row_.covariance_en, row_.covariance_nn}),
      write_event_(
          connection,
          "INSERT INTO map_change_events (sequence, change_id, previous_sequence, "
          "from_state, to_state, reason, at_ns) VALUES (:s, :i, :p, :f, :t, :r, "
          ":a)",
          {row_.sequence, row_.id, row_.previous_sequence,
           BoundPlace(row_.from_state, row_.has_from), row_.state, row_.reason, row_.updated_ns}),
      drop_(connection, "DELETE FROM map_changes WHERE id = :i", {row_.id}),
      drop_events_(connection, "DELETE FROM map_change_events WHERE change_id = :i", {row_.id}) {}

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
        (connection_.session().prepare
             << "SELECT id, uuid, class_name, vanished, state, confidence, latitude, longitude, "
                "covariance_ee, covariance_en, covariance_nn, reports, drives, first_seen_ns, "
                "last_seen_ns, denied_ns, updated_ns, sequence, witnesses FROM map_changes WHERE "
             << IsSoundMapChange(connection_.dialect()) << " ORDER BY sequence, id",
         into(row.id), into(row.uuid), into(row.class_name), into(row.vanished), into(row.state),
         into(row.confidence), into(row.latitude), into(row.longitude), into(row.covariance_ee),
         into(row.covariance_en), into(row.covariance_nn), into(row.reports), into(row.drives),
         into(row.first_seen_ns), into(row.last_seen_ns), into(row.denied_ns), into(row.updated_ns),
         into(row.sequence), into(row.witnesses));
    return LoadRows(connection_, "map_changes", query, [&] { take(ToMapChange(row)); });
  });
}

std::uint64_t MapChangeTable::LastId() {
  return ExplainStore("reading the newest map change", [&] {
    long long id = 0;
    connection_.session() << "SELECT coalesce(max(id), 0) FROM map_changes WHERE id <= :most",
        soci::use(kMaxRowId), soci::into(id);
    return static_cast<std::uint64_t>(std::max(id, 0LL));
  });
}

std::optional<ZoneStore::KnownMapChangeReport> MapChangeTable::FindReport(const Uuid& report_uuid) {
  return ExplainStore("looking up a map change",
                      [&]() -> std::optional<ZoneStore::KnownMapChangeReport> {
                        row_.uuid = report_uuid.ToString();
                        if (!FetchOne(connection_, find_report_)) return std::nullopt;
                        return ZoneStore::KnownMapChangeReport{
                            Uuid::Parse(row_.change_uuid).value_or(Uuid{}), row_.vehicle_id};
                      });
}

std::vector<StoredMapChangeEvent> MapChangeTable::LoadEvents(std::uint64_t sequence,
                                                             std::size_t limit) {
  return ExplainStore("reading events of a map change", [&] {
    return WalkEvents(connection_, sequence, limit, find_event_, row_, [](const auto& read) {
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
    write_.Execute();
  });
}

void MapChangeTable::Drop(std::uint64_t id) {
  ExplainStore("forgetting a map change", [&] {
    row_.id = static_cast<long long>(id);
    drop_.Execute();
    drop_events_.Execute();
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
    write_report_.Execute();
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
    write_event_.Execute();
  });
}

}  // namespace livemap::zone
