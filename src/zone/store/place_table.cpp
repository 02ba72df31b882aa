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

constexpr char kSoundPlace[] =
    "typeof(vehicle_id) = 'text' AND length(CAST(vehicle_id AS BLOB)) <= 64 AND "
    "typeof(stamp_ns) = 'integer' AND typeof(latitude) IN ('real', 'integer') AND "
    "typeof(longitude) IN ('real', 'integer') AND typeof(sigma_m) IN ('real', 'integer') AND "
    "typeof(messages) = 'integer'";

}  // namespace

PlaceTable::PlaceTable(soci::session& session)
    : session_(session),
      find_((session.prepare << "SELECT stamp_ns, latitude, longitude, sigma_m, messages FROM "
                                "places WHERE vehicle_id = :v AND "
                             << kSoundPlace << " ORDER BY stamp_ns DESC LIMIT :l",
             soci::use(row_.vehicle_id), soci::use(row_.limit), soci::into(row_.stamp_ns),
             soci::into(row_.latitude), soci::into(row_.longitude), soci::into(row_.sigma_m),
             soci::into(row_.count))),
      write_((session.prepare
                  << "INSERT INTO places (vehicle_id, stamp_ns, latitude, longitude, sigma_m, "
                     "messages) VALUES (:v, :st, :la, :lo, :si, :me) ON CONFLICT (vehicle_id, "
                     "stamp_ns) DO UPDATE SET latitude = excluded.latitude, "
                     "longitude = excluded.longitude, sigma_m = excluded.sigma_m, "
                     "messages = excluded.messages",
              soci::use(row_.vehicle_id), soci::use(row_.stamp_ns), soci::use(row_.latitude),
              soci::use(row_.longitude), soci::use(row_.sigma_m), soci::use(row_.count))),
      drop_((session.prepare << "DELETE FROM places WHERE vehicle_id = :v AND stamp_ns = :st",
             soci::use(row_.vehicle_id), soci::use(row_.stamp_ns))),
      next_((session.prepare << "SELECT vehicle_id FROM places WHERE vehicle_id > :v AND "
                                "typeof(vehicle_id) = 'text' AND length(CAST(vehicle_id AS BLOB)) "
                                "<= 64 ORDER BY vehicle_id LIMIT 1",
             soci::use(row_.after), soci::into(row_.vehicle_id))),
      prune_((
          session.prepare << "DELETE FROM places WHERE vehicle_id = :v AND " << kSoundPlace
                          << " AND stamp_ns < max(min(:st, (SELECT max(stamp_ns) FROM places WHERE "
                             "vehicle_id = :v AND "
                          << kSoundPlace
                          << ")), coalesce((SELECT stamp_ns FROM places WHERE vehicle_id = :v AND "
                          << kSoundPlace << " ORDER BY stamp_ns DESC LIMIT 1 OFFSET :l), 0))",
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
        (session_.prepare << "SELECT vehicle_id, stamp_ns, latitude, longitude, sigma_m, messages "
                             "FROM places WHERE "
                          << kSoundPlace << " ORDER BY vehicle_id DESC, stamp_ns DESC",
         soci::into(row.vehicle_id), soci::into(row.stamp_ns), soci::into(row.latitude),
         soci::into(row.longitude), soci::into(row.sigma_m), soci::into(row.count));
    return LoadRows(session_, "places", query, [&] {
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
    find_.execute();
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
    write_.execute(true);
  });
}

void PlaceTable::Drop(const std::string& vehicle_id, std::int64_t stamp_ns) {
  ExplainStore("dropping a place of a vehicle", [&] {
    row_.vehicle_id = vehicle_id;
    row_.stamp_ns = stamp_ns;
    drop_.execute(true);
  });
}

std::optional<std::string> PlaceTable::Prune(const std::string& after, std::int64_t before_ns,
                                             std::size_t max_places) {
  return ExplainStore("dropping old places of a vehicle", [&]() -> std::optional<std::string> {
    row_.after = after;
    if (!FetchOne(next_)) return std::nullopt;
    row_.stamp_ns = before_ns;
    row_.limit = static_cast<long long>(max_places) - 1;
    prune_.execute(true);
    return row_.vehicle_id;
  });
}

}  // namespace livemap::zone
