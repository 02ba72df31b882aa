#include "zone/store/hazard_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/log_odds.h"
#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {
namespace {

constexpr std::int16_t kReporterWeight1000 = 1000;  // A voice of which only a report is known.

constexpr double kFullTurnRad = 2 * M_PI;

std::string IsSoundHazard(const Dialect& dialect) {
  return dialect.AreTexts({{"uuid", 36},
                           {"class_name", 64},
                           {"image_sha256", 64},
                           {"image_format", 8},
                           {"life", 500}}) +
         " AND " +
         dialect.AreNumbers({"confidence", "latitude", "longitude", "covariance_ee",
                             "covariance_en", "covariance_nn", "presence"}) +
         " AND " +
         dialect.AreIntegers({"sightings", "first_seen_ns", "last_seen_ns", "updated_ns",
                              "sequence", "announced_sequence", "state", "vehicles"});
}

bool IsHazardShare(double value) { return value >= 0 && value <= 1; }

bool IsHazardPicture(const std::string& sha256, const std::string& format) {
  if (sha256.empty() && format.empty()) return true;
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  return sha256.size() == 64 && std::all_of(sha256.begin(), sha256.end(), is_digit) &&
         (format == "jpeg" || format == "png");
}

/// Why these are no values of a hazard; nullptr when they are.
template <typename Row>
const char* WhyNoHazard(const Row& row, const Hazard& hazard) {
  const bool counts = row.id >= 1 && row.id <= kMaxRowId && row.sightings >= 1 &&
                      row.sightings <= UINT32_MAX && row.vehicles >= 0;
  if (!counts) return "counts out of range";
  if (hazard.uuid.IsNil()) return "no uuid";
  if (!protocol::IsPrintableText(hazard.class_name, kMaxStoredTextBytes))
    return "no printable class";
  if (!IsHazardShare(row.confidence) || !IsHazardShare(row.presence)) return "no probability";
  if (!geo::IsValid(hazard.position)) return "no position on Earth";
  if (!IsCovariance(hazard.covariance_m2)) return "no covariance";
  if (!IsStamp(row.first_seen_ns) || !IsStamp(row.last_seen_ns) || !IsStamp(row.updated_ns) ||
      row.first_seen_ns > row.last_seen_ns) {
    return "no times";
  }
  const bool in_order = row.sequence >= 1 && row.sequence < kMaxSequence &&
                        row.announced_sequence >= 0 && row.announced_sequence <= row.sequence;
  if (!in_order) return "no sequence";
  if (!IsIndex(row.state, kHazardStates)) return "no state";
  return IsHazardPicture(row.image_sha256, row.image_format) ? nullptr : "no picture's name";
}

/// What schema 1 knew of a life: drivers were told, nobody asked. LoadHazards adds who reported.
PresenceRecord HazardLifeOf(const Hazard& hazard) {
  PresenceRecord life;
  life.state = hazard.state;
  life.since_ns = hazard.updated_ns;
  life.first_seen_ns = hazard.first_seen_ns;
  life.last_yes_ns = hazard.last_seen_ns;
  life.at_ns = hazard.last_seen_ns;
  const double presence = std::clamp(static_cast<double>(hazard.presence), 0.01, 0.99);
  life.log_odds = static_cast<float>(LogOddsOf(presence));
  life.undenied_log_odds = life.log_odds;
  return life;
}

}  // namespace

HazardTable::HazardTable(StoreConnection& connection)
    : connection_(connection),
      write_(connection,
             "INSERT INTO hazards (id, uuid, class_name, confidence, latitude, longitude, "
             "covariance_ee, covariance_en, covariance_nn, sightings, first_seen_ns, "
             "last_seen_ns, updated_ns, sequence, announced_sequence, image_sha256, "
             "image_format, state, presence, vehicles, life) VALUES (:i, :u, :c, :co, :la, "
             ":lo, "
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
             {row_.id,
              row_.uuid,
              row_.class_name,
              row_.confidence,
              row_.latitude,
              row_.longitude,
              row_.covariance_ee,
              row_.covariance_en,
              row_.covariance_nn,
              row_.sightings,
              row_.first_seen_ns,
              row_.last_seen_ns,
              row_.updated_ns,
              row_.sequence,
              row_.announced_sequence,
              row_.image_sha256,
              row_.image_format,
              row_.state,
              row_.presence,
              row_.vehicles,
              row_.life}),
      write_course_(connection,
                    "INSERT INTO hazard_courses (hazard_id, course_rad) VALUES (:i, :c) "
                    "ON CONFLICT (hazard_id) DO UPDATE SET "
                    "course_rad = excluded.course_rad",
                    {row_.id, row_.course_rad}),
      write_trails_(connection,
                    "INSERT INTO hazard_trails (hazard_id, trails) VALUES (:i, :t) "
                    "ON CONFLICT (hazard_id) DO UPDATE SET trails = excluded.trails",
                    {row_.id, row_.trails}) {}

ZoneStore::HazardRow HazardTable::ToHazard(const Row& row) {
  ZoneStore::HazardRow result;
  result.id = static_cast<std::uint64_t>(row.id);
  Hazard& hazard = result.hazard;
  hazard.uuid = Uuid::Parse(row.uuid).value_or(Uuid{});
  hazard.class_name = row.class_name;
  hazard.confidence = static_cast<float>(row.confidence);
  hazard.position = {row.latitude, row.longitude};
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
  hazard.presence = static_cast<float>(row.presence);
  hazard.vehicles = static_cast<std::uint32_t>(row.vehicles);
  const std::string name = "hazard " + std::to_string(row.id);
  if (const char* why = WhyNoHazard(row, hazard)) throw Error(name + " has " + why);
  hazard.state = static_cast<HazardState>(row.state);
  const auto life = row.life.empty() ? HazardLifeOf(hazard) : UnpackPresence(row.life);
  if (!life || life->state != hazard.state) throw Error(name + " has no life that can be read");
  result.life = *life;
  return result;
}

/// Who reported the hazards on the map that schema 1 left without a life, by hazard. No index leads
/// from a hazard to its reports, so this is one walk over all, as long as there are such hazards.
std::map<long long, std::vector<VehicleEvidence>> HazardTable::VoicesOfReports() {
  constexpr char kLifeless[] = "FROM hazards WHERE life = '' AND state IN (1, 2)";
  std::map<long long, std::vector<VehicleEvidence>> voices;
  long long lifeless = 0;
  connection_.session() << "SELECT count(*) " << kLifeless, soci::into(lifeless);
  if (lifeless == 0) return voices;
  std::string vehicle_id;
  long long hazard_id = 0, stamp_ns = 0;
  soci::statement query =
      (connection_.session().prepare
           << "SELECT hazard_id, vehicle_id, max(stamp_ns) AS newest FROM reports "
              "WHERE "
           << connection_.dialect().AreIntegers({"hazard_id", "stamp_ns"}) << " AND "
           << connection_.dialect().AreTexts({{"vehicle_id", 64}})
           << " AND hazard_id IN (SELECT id " << kLifeless
           << ") GROUP BY hazard_id, vehicle_id ORDER BY newest DESC",
       soci::into(hazard_id), soci::into(vehicle_id), soci::into(stamp_ns));
  connection_.Run(query);
  while (query.fetch()) {
    std::vector<VehicleEvidence>& of_hazard = voices[hazard_id];
    if (of_hazard.size() == kMaxEvidencePerHazard || !IsStamp(stamp_ns)) continue;
    VehicleEvidence voice;
    voice.vehicle = VehicleKey(vehicle_id);
    voice.at_s = static_cast<std::uint32_t>(Seconds(stamp_ns));
    voice.weight_1000 = kReporterWeight1000;
    of_hazard.push_back(voice);
  }
  return voices;
}

StoreDamage HazardTable::Load(const std::function<void(ZoneStore::HazardRow)>& take) {
  return ExplainStore("loading hazards", [&] {
    using soci::into;
    const auto voices = VoicesOfReports();
    Row row;
    soci::statement query =
        (connection_.session().prepare
             << "SELECT id, uuid, class_name, confidence, latitude, longitude, covariance_ee, "
                "covariance_en, covariance_nn, sightings, first_seen_ns, last_seen_ns, "
                "updated_ns, sequence, announced_sequence, image_sha256, image_format, state, "
                "presence, vehicles, life FROM hazards WHERE "
             << IsSoundHazard(connection_.dialect()) << " ORDER BY sequence, id",
         into(row.id), into(row.uuid), into(row.class_name), into(row.confidence),
         into(row.latitude), into(row.longitude), into(row.covariance_ee), into(row.covariance_en),
         into(row.covariance_nn), into(row.sightings), into(row.first_seen_ns),
         into(row.last_seen_ns), into(row.updated_ns), into(row.sequence),
         into(row.announced_sequence), into(row.image_sha256), into(row.image_format),
         into(row.state), into(row.presence), into(row.vehicles), into(row.life));
    return LoadRows(connection_, "hazards", query, [&] {
      ZoneStore::HazardRow hazard = ToHazard(row);
      const auto of_hazard = voices.find(row.id);
      if (row.life.empty() && of_hazard != voices.end()) {
        std::copy(of_hazard->second.begin(), of_hazard->second.end(), hazard.life.voices.begin());
      }
      take(std::move(hazard));
    });
  });
}

StoreDamage HazardTable::LoadCourses(const std::function<void(std::uint64_t, double)>& take) {
  return ExplainStore("loading the courses of hazards", [&] {
    long long id = 0;
    double course_rad = 0;
    soci::statement query =
        (connection_.session().prepare << "SELECT hazard_id, course_rad FROM hazard_courses WHERE "
                                       << connection_.dialect().AreNumbers({"course_rad"}),
         soci::into(id), soci::into(course_rad));
    return LoadRows(connection_, "hazard_courses", query, [&] {
      const bool sound = id >= 1 && id <= kMaxRowId && std::abs(course_rad) <= kFullTurnRad;
      if (!sound) throw Error("hazard " + std::to_string(id) + " has a course that is none");
      take(static_cast<std::uint64_t>(id), course_rad);
    });
  });
}

StoreDamage HazardTable::LoadTrails(
    const std::function<void(std::uint64_t, std::vector<protocol::Trail>)>& take) {
  return ExplainStore("loading the trails of hazards", [&] {
    long long id = 0;
    std::string trails;
    soci::statement query =
        (connection_.session().prepare << "SELECT hazard_id, trails FROM hazard_trails",
         soci::into(id), soci::into(trails));
    return LoadRows(connection_, "hazard_trails", query, [&] {
      if (id < 1 || id > kMaxRowId) throw Error("hazard " + std::to_string(id) + " has trails");
      take(static_cast<std::uint64_t>(id), protocol::ParseTrails(trails));
    });
  });
}

void HazardTable::WriteClass(std::uint64_t hazard_id, const std::string& class_name) {
  ExplainStore("writing a hazard's class", [&] {
    const auto id = static_cast<long long>(hazard_id);
    connection_.session() << "UPDATE hazards SET class_name = :c WHERE id = :i",
        soci::use(class_name), soci::use(id);
  });
}

void HazardTable::WriteCourse(std::uint64_t hazard_id, double course_rad) {
  ExplainStore("writing the course of a hazard", [&] {
    row_.id = static_cast<long long>(hazard_id);
    row_.course_rad = std::remainder(course_rad, kFullTurnRad);
    write_course_.Execute();
  });
}

void HazardTable::WriteTrails(std::uint64_t hazard_id, const std::vector<protocol::Trail>& trails) {
  ExplainStore("writing the trails of a hazard", [&] {
    row_.id = static_cast<long long>(hazard_id);
    row_.trails = protocol::TrailsText(trails);
    write_trails_.Execute();
  });
}

std::uint64_t HazardTable::LastId() {
  return ExplainStore("reading the newest hazard", [&] {
    long long id = 0;
    connection_.session() << "SELECT coalesce(max(id), 0) FROM hazards WHERE id <= :most",
        soci::use(kMaxRowId), soci::into(id);
    return static_cast<std::uint64_t>(std::max(id, 0LL));
  });
}

void HazardTable::Write(const ZoneStore::HazardRow& written) {
  ExplainStore("writing a hazard", [&] {
    const Hazard& hazard = written.hazard;
    row_.id = static_cast<long long>(written.id);
    row_.uuid = hazard.uuid.ToString();
    row_.class_name = hazard.class_name;
    row_.confidence = static_cast<double>(hazard.confidence);
    row_.latitude = hazard.position.latitude_deg;
    row_.longitude = hazard.position.longitude_deg;
    row_.covariance_ee = hazard.covariance_m2(0, 0);
    row_.covariance_en = hazard.covariance_m2(0, 1);
    row_.covariance_nn = hazard.covariance_m2(1, 1);
    row_.sightings = hazard.sightings;
    row_.first_seen_ns = hazard.first_seen_ns;
    row_.last_seen_ns = hazard.last_seen_ns;
    row_.updated_ns = hazard.updated_ns;
    row_.sequence = static_cast<long long>(hazard.sequence);
    row_.announced_sequence = static_cast<long long>(hazard.announced_sequence);
    row_.image_sha256 = hazard.image_sha256;
    row_.image_format = hazard.image_format;
    row_.state = static_cast<int>(hazard.state);
    row_.presence = static_cast<double>(hazard.presence);
    row_.vehicles = static_cast<int>(hazard.vehicles);
    row_.life = PackPresence(written.life);
    write_.Execute();
  });
}

}  // namespace livemap::zone
