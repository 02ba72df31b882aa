#include "zone/store/place_table.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {
namespace {

std::string IsSoundPlace(const Dialect& dialect) {
  return dialect.AreTexts({{"vehicle_id", 64}}) + " AND " +
         dialect.AreIntegers({"stamp_ns", "messages"}) + " AND " +
         dialect.AreNumbers({"latitude", "longitude", "sigma_m"});
}

/// Of the vehicle :v those older than both :st and its newest, and those beyond its newest :l.
std::string PruneStatement(const Dialect& dialect) {
  const std::string of_vehicle = "FROM places WHERE vehicle_id = :v AND " + IsSoundPlace(dialect);
  return "DELETE " + of_vehicle + " AND stamp_ns < " +
         dialect.Greater(
             dialect.Smaller("CAST(:st AS BIGINT)", "(SELECT max(stamp_ns) " + of_vehicle + ")"),
             "coalesce((SELECT stamp_ns " + of_vehicle +
                 " ORDER BY stamp_ns DESC LIMIT 1 OFFSET :l), 0)");
}

}  // namespace

PlaceTable::PlaceTable(StoreConnection& connection)
    : connection_(connection),
      find_((connection.session().prepare
                 << "SELECT stamp_ns, latitude, longitude, sigma_m, messages FROM "
                    "places WHERE vehicle_id = :v AND "
                 << IsSoundPlace(connection.dialect()) << " ORDER BY stamp_ns DESC LIMIT :l",
             soci::use(row_.vehicle_id), soci::use(row_.limit), soci::into(row_.stamp_ns),
             soci::into(row_.latitude), soci::into(row_.longitude), soci::into(row_.sigma_m),
             soci::into(row_.count))),
      write_(connection,
             "INSERT INTO places (vehicle_id, stamp_ns, latitude, longitude, sigma_m, "
             "messages) VALUES (:v, :st, :la, :lo, :si, :me) ON CONFLICT (vehicle_id, "
             "stamp_ns) DO UPDATE SET latitude = excluded.latitude, "
             "longitude = excluded.longitude, sigma_m = excluded.sigma_m, "
             "messages = excluded.messages",
             {row_.vehicle_id, row_.stamp_ns, row_.latitude, row_.longitude, row_.sigma_m,
              row_.count}),
      drop_(connection, "DELETE FROM places WHERE vehicle_id = :v AND stamp_ns = :st",
            {row_.vehicle_id, row_.stamp_ns}),
      next_((connection.session().prepare
                 << "SELECT vehicle_id FROM places WHERE vehicle_id > :v AND "
                 << connection.dialect().AreTexts({{"vehicle_id", 64}})
                 << " ORDER BY vehicle_id LIMIT 1",
             soci::use(row_.after), soci::into(row_.vehicle_id))),
      prune_((connection.session().prepare << PruneStatement(connection.dialect()),
              soci::use(row_.vehicle_id, "v"), soci::use(row_.stamp_ns, "st"),
              soci::use(row_.limit, "l"))) {}

KnownPlace PlaceTable::ToPlace(const Row& row) {
  KnownPlace place;
  place.fix = {row.stamp_ns, {row.latitude, row.longitude}, row.sigma_m};
  const bool sound = IsStamp(row.stamp_ns) && geo::IsValid(place.fix.position) &&
                     row.sigma_m >= 0 && row.sigma_m <= std::sqrt(2 * kMaxVarianceM2) &&
                     row.count >= 1 && row.count <= UINT32_MAX;
  if (!sound) throw Error("a place of a vehicle is none");
  place.count = static_cast<std::uint32_t>(row.count);
  place.is_kept = true;
  return place;
}

StoreDamage PlaceTable::Load(const std::function<void(const std::string&, KnownPlace)>& take) {
  return ExplainStore("loading places of vehicles", [&] {
    Row row;
    soci::statement query =
        (connection_.session().prepare
             << "SELECT vehicle_id, stamp_ns, latitude, longitude, sigma_m, messages "
                "FROM places WHERE "
             << IsSoundPlace(connection_.dialect()) << " ORDER BY vehicle_id DESC, stamp_ns DESC",
         soci::into(row.vehicle_id), soci::into(row.stamp_ns), soci::into(row.latitude),
         soci::into(row.longitude), soci::into(row.sigma_m), soci::into(row.count));
    return LoadRows(connection_, "places", query, [&] {
      if (!protocol::IsPrintableText(row.vehicle_id, kMaxStoredTextBytes)) {
        throw Error("a place is of no vehicle");
      }
      take(row.vehicle_id, ToPlace(row));
    });
  });
}

std::vector<KnownPlace> PlaceTable::Find(const std::string& vehicle_id, std::size_t limit) {
  return ExplainStore("looking up places of a vehicle", [&] {
    std::vector<KnownPlace> places;
    row_.vehicle_id = vehicle_id;
    row_.limit = static_cast<long long>(limit);
    connection_.Run(find_);
    while (find_.fetch()) {
      try {
        places.push_back(ToPlace(row_));
      } catch (const Error&) {  // Told at the start, as damage.
      }
    }
    return places;
  });
}

void PlaceTable::Write(const std::string& vehicle_id, const KnownPlace& place) {
  ExplainStore("writing a place of a vehicle", [&] {
    row_.vehicle_id = vehicle_id;
    row_.stamp_ns = place.fix.stamp_ns;
    row_.latitude = place.fix.position.latitude_deg;
    row_.longitude = place.fix.position.longitude_deg;
    row_.sigma_m = place.fix.sigma_m;
    row_.count = place.count;
    write_.Execute();
  });
}

void PlaceTable::Drop(const std::string& vehicle_id, std::int64_t stamp_ns) {
  ExplainStore("dropping a place of a vehicle", [&] {
    row_.vehicle_id = vehicle_id;
    row_.stamp_ns = stamp_ns;
    drop_.Execute();
  });
}

std::optional<std::string> PlaceTable::Prune(const std::string& after, std::int64_t before_ns,
                                             std::size_t max_places) {
  return ExplainStore("dropping old places of a vehicle", [&]() -> std::optional<std::string> {
    row_.after = after;
    if (!FetchOne(connection_, next_)) return std::nullopt;
    row_.stamp_ns = before_ns;
    row_.limit = static_cast<long long>(max_places) - 1;
    connection_.Flush();
    prune_.execute(true);
    return row_.vehicle_id;
  });
}

}  // namespace livemap::zone
