// What ZoneStore reads: nothing in the file is taken for granted, since something else may have
// written into it. Types and sizes are checked by the database before a value is fetched.
#include <soci/soci.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/log_odds.h"
#include "common/time.h"
#include "zone/admission/report_validation.h"
#include "zone/store/event_walk.h"
#include "zone/store/store_validation.h"
#include "zone/store/zone_store_state.h"

namespace livemap::zone {
namespace {

constexpr std::int16_t kReporterWeight1000 = 1000;  // A voice of which only a report is known.
constexpr double kMaxEnded = 1e6;                   // SurvivalModel's largest memory.
constexpr double kMaxStoodS = 1e15;
constexpr std::size_t kActions = 3;

constexpr char kSoundHazard[] =
    "typeof(uuid) = 'text' AND length(CAST(uuid AS BLOB)) = 36 AND "
    "typeof(class_name) = 'text' AND length(CAST(class_name AS BLOB)) <= 64 AND "
    "typeof(confidence) IN ('real', 'integer') AND typeof(latitude) IN ('real', 'integer') AND "
    "typeof(longitude) IN ('real', 'integer') AND typeof(covariance_ee) IN ('real', 'integer') "
    "AND typeof(covariance_en) IN ('real', 'integer') AND "
    "typeof(covariance_nn) IN ('real', 'integer') AND typeof(presence) IN ('real', 'integer') AND "
    "typeof(sightings) = 'integer' AND typeof(first_seen_ns) = 'integer' AND "
    "typeof(last_seen_ns) = 'integer' AND typeof(updated_ns) = 'integer' AND "
    "typeof(sequence) = 'integer' AND typeof(announced_sequence) = 'integer' AND "
    "typeof(state) = 'integer' AND typeof(vehicles) = 'integer' AND "
    "typeof(image_sha256) = 'text' AND length(CAST(image_sha256 AS BLOB)) <= 64 AND "
    "typeof(image_format) = 'text' AND length(CAST(image_format AS BLOB)) <= 8 AND "
    "typeof(life) = 'text' AND length(CAST(life AS BLOB)) <= 500";
constexpr char kSoundLife[] =
    "typeof(class_name) = 'text' AND length(CAST(class_name AS BLOB)) <= 64 AND "
    "typeof(ended) IN ('real', 'integer') AND typeof(stood_s) IN ('real', 'integer')";
constexpr char kSoundTrust[] =
    "typeof(vehicle_key) = 'integer' AND typeof(suspicion) IN ('real', 'integer') AND "
    "typeof(at_ns) = 'integer' AND typeof(vouchers) = 'text' AND "
    "length(CAST(vouchers AS BLOB)) <= 200";
constexpr char kSoundLastReport[] =
    "typeof(stamp_ns) = 'integer' AND typeof(latitude) IN ('real', 'integer') AND "
    "typeof(longitude) IN ('real', 'integer') AND typeof(sigma_m) IN ('real', 'integer')";
constexpr char kSoundEvent[] =
    "typeof(previous_sequence) = 'integer' AND typeof(action) = 'integer' AND "
    "typeof(from_state) IN ('integer', 'null') AND typeof(to_state) = 'integer' AND "
    "typeof(reason) = 'text' AND length(CAST(reason AS BLOB)) <= 200 AND typeof(at_ns) = 'integer'";

bool IsShare(double value) { return value >= 0 && value <= 1; }

bool IsPicture(const std::string& sha256, const std::string& format) {
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
  if (!IsPrintableText(hazard.class_name, kMaxStoredTextBytes)) return "no printable class";
  if (!IsShare(row.confidence) || !IsShare(row.presence)) return "no probability";
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
  return IsPicture(row.image_sha256, row.image_format) ? nullptr : "no picture's name";
}

/// What schema 1 knew of a life: drivers were told, nobody asked. LoadHazards adds who reported.
PresenceRecord LifeOf(const Hazard& hazard) {
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

ZoneStore::HazardRow ZoneStore::Implementation::ToHazard(const Row& row) {
  HazardRow result;
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
  const auto life = row.life.empty() ? LifeOf(hazard) : UnpackPresence(row.life);
  if (!life || life->state != hazard.state) throw Error(name + " has no life that can be read");
  result.life = *life;
  return result;
}

void ZoneStore::Implementation::PrepareReads() {
  using soci::into;
  using soci::use;
  // A report whose hazard is broken is known all the same: its uuid is taken.
  find_report_.emplace(
      (session_.prepare << "SELECT CASE WHEN typeof(h.uuid) = 'text' THEN substr(h.uuid, 1, 37) "
                           "ELSE '' END, CASE WHEN typeof(r.vehicle_id) = 'text' THEN "
                           "substr(r.vehicle_id, 1, 65) ELSE '' END FROM reports r LEFT JOIN "
                           "hazards h ON h.id = r.hazard_id WHERE r.uuid = :uuid",
       use(row_.reason), into(row_.uuid), into(row_.vehicle_id)));
  find_last_report_.emplace((session_.prepare << "SELECT stamp_ns, latitude, longitude, sigma_m "
                                                 "FROM last_reports WHERE vehicle_id = :v AND "
                                              << kSoundLastReport,
                             use(row_.vehicle_id), into(row_.stamp_ns), into(row_.latitude),
                             into(row_.longitude), into(row_.sigma_m)));
  find_event_.emplace((session_.prepare
                           << "SELECT previous_sequence, action, from_state, to_state, "
                              "announced <> 0, reason, at_ns FROM events WHERE sequence = :s AND "
                           << kSoundEvent,
                       use(row_.sequence), into(row_.previous_sequence), into(row_.action),
                       into(row_.from_state, row_.has_from), into(row_.state), into(row_.announced),
                       into(row_.reason), into(row_.updated_ns)));
  PrepareMapChangeReads();
}

StoreDamage ZoneStore::Implementation::LoadRows(const std::string& table, soci::statement& query,
                                                const std::function<void()>& take_row) {
  StoreDamage damage;
  long long rows = 0;
  session_ << "SELECT count(*) FROM " << table, soci::into(rows);
  query.execute();
  while (query.fetch()) {
    --rows;
    try {
      take_row();
    } catch (const StoreError&) {
      throw;
    } catch (const Error& error) {
      damage.Note(error.what());
    }
  }
  for (; rows > 0; --rows) damage.Note("a row of " + table + " has values of a wrong type or size");
  return damage;
}

/// Who reported the hazards on the map that schema 1 left without a life, by hazard. No index leads
/// from a hazard to its reports, so this is one walk over all, as long as there are such hazards.
std::map<long long, std::vector<VehicleEvidence>> ZoneStore::Implementation::VoicesOfReports() {
  constexpr char kLifeless[] = "FROM hazards WHERE life = '' AND state IN (1, 2)";
  std::map<long long, std::vector<VehicleEvidence>> voices;
  long long lifeless = 0;
  session_ << "SELECT count(*) " << kLifeless, soci::into(lifeless);
  if (lifeless == 0) return voices;
  Row row;
  soci::statement query =
      (session_.prepare << "SELECT hazard_id, vehicle_id, max(stamp_ns) AS newest FROM reports "
                           "WHERE typeof(hazard_id) = 'integer' AND typeof(stamp_ns) = 'integer' "
                           "AND typeof(vehicle_id) = 'text' AND length(vehicle_id) <= 64 "
                           "AND hazard_id IN (SELECT id "
                        << kLifeless << ") GROUP BY hazard_id, vehicle_id ORDER BY newest DESC",
       soci::into(row.id), soci::into(row.vehicle_id), soci::into(row.stamp_ns));
  query.execute();
  while (query.fetch()) {
    std::vector<VehicleEvidence>& of_hazard = voices[row.id];
    if (of_hazard.size() == kMaxEvidencePerHazard || !IsStamp(row.stamp_ns)) continue;
    VehicleEvidence voice;
    voice.vehicle = VehicleKey(row.vehicle_id);
    voice.at_s = static_cast<std::uint32_t>(Seconds(row.stamp_ns));
    voice.weight_1000 = kReporterWeight1000;
    of_hazard.push_back(voice);
  }
  return voices;
}

StoreDamage ZoneStore::LoadHazards(const std::function<void(HazardRow)>& take) {
  return ExplainStore("loading hazards", [&] {
    using soci::into;
    const auto voices = implementation_->VoicesOfReports();
    Implementation::Row row;
    soci::statement query =
        (implementation_->session_.prepare
             << "SELECT id, uuid, class_name, confidence, latitude, longitude, covariance_ee, "
                "covariance_en, covariance_nn, sightings, first_seen_ns, last_seen_ns, "
                "updated_ns, sequence, announced_sequence, image_sha256, image_format, state, "
                "presence, vehicles, life FROM hazards WHERE "
             << kSoundHazard << " ORDER BY sequence, id",
         into(row.id), into(row.uuid), into(row.class_name), into(row.confidence),
         into(row.latitude), into(row.longitude), into(row.covariance_ee), into(row.covariance_en),
         into(row.covariance_nn), into(row.sightings), into(row.first_seen_ns),
         into(row.last_seen_ns), into(row.updated_ns), into(row.sequence),
         into(row.announced_sequence), into(row.image_sha256), into(row.image_format),
         into(row.state), into(row.presence), into(row.vehicles), into(row.life));
    return implementation_->LoadRows("hazards", query, [&] {
      HazardRow hazard = Implementation::ToHazard(row);
      const auto of_hazard = voices.find(row.id);
      if (row.life.empty() && of_hazard != voices.end()) {
        std::copy(of_hazard->second.begin(), of_hazard->second.end(), hazard.life.voices.begin());
      }
      take(std::move(hazard));
    });
  });
}

StoreDamage ZoneStore::LoadLives(
    const std::function<void(const std::string&, LearnedLifetime)>& take) {
  return ExplainStore("loading what was learned of classes", [&] {
    Implementation::Row row;
    soci::statement query =
        (implementation_->session_.prepare << "SELECT class_name, ended, stood_s FROM lives WHERE "
                                           << kSoundLife,
         soci::into(row.class_name), soci::into(row.ended), soci::into(row.stood_s));
    return implementation_->LoadRows("lives", query, [&] {
      const bool sound = IsPrintableText(row.class_name, kMaxStoredTextBytes) && row.ended >= 0 &&
                         row.ended <= kMaxEnded && row.stood_s >= 0 && row.stood_s <= kMaxStoodS;
      if (!sound) throw Error("what was learned of a class is no such thing");
      take(row.class_name, {row.ended, row.stood_s});
    });
  });
}

StoreDamage ZoneStore::LoadTrust(
    const std::function<void(std::uint64_t, const TrustRecord&)>& take) {
  return ExplainStore("loading what is held against vehicles", [&] {
    Implementation::Row row;
    soci::statement query =
        (implementation_->session_.prepare
             << "SELECT vehicle_key, suspicion, at_ns, vouchers FROM trust WHERE " << kSoundTrust,
         soci::into(row.vehicle_key), soci::into(row.suspicion), soci::into(row.updated_ns),
         soci::into(row.vouchers));
    return implementation_->LoadRows("trust", query, [&] {
      TrustRecord record;
      record.suspicion = row.suspicion;
      record.at_ns = row.updated_ns;
      if (!IsStamp(record.at_ns) || !UnpackVouchers(row.vouchers, record)) {
        throw Error("what is held against a vehicle is no such record");
      }
      take(static_cast<std::uint64_t>(row.vehicle_key), record);
    });
  });
}

std::uint64_t ZoneStore::LastHazardId() {
  return ExplainStore("reading the newest hazard", [&] {
    long long id = 0;
    implementation_->session_ << "SELECT coalesce(max(id), 0) FROM hazards WHERE id <= :most",
        soci::use(kMaxRowId), soci::into(id);
    return static_cast<std::uint64_t>(std::max(id, 0LL));
  });
}

std::uint64_t ZoneStore::LastSequence() {
  return ExplainStore("reading the newest sequence", [&] {
    long long sequence = 0;
    implementation_->session_
        << "SELECT max((SELECT coalesce(max(sequence), 0) FROM events WHERE sequence < :most), "
           "(SELECT coalesce(max(sequence), 0) FROM map_change_events WHERE sequence < :most))",
        soci::use(kMaxSequence, "most"), soci::into(sequence);
    return static_cast<std::uint64_t>(std::max(sequence, 0LL));
  });
}

std::optional<ZoneStore::KnownReport> ZoneStore::FindReport(const Uuid& report_uuid) {
  return ExplainStore("looking up a report", [&]() -> std::optional<KnownReport> {
    Implementation::Row& row = implementation_->row_;
    row.reason = report_uuid.ToString();
    if (!FetchOne(*implementation_->find_report_)) return std::nullopt;
    return KnownReport{Uuid::Parse(row.uuid).value_or(Uuid{}), row.vehicle_id};
  });
}

std::optional<ReportedFix> ZoneStore::FindLastReport(const std::string& vehicle_id) {
  return ExplainStore("looking up a vehicle", [&]() -> std::optional<ReportedFix> {
    Implementation::Row& row = implementation_->row_;
    row.vehicle_id = vehicle_id;
    if (!FetchOne(*implementation_->find_last_report_)) return std::nullopt;
    const ReportedFix fix{row.stamp_ns, {row.latitude, row.longitude}, row.sigma_m};
    const bool sound = IsStamp(fix.stamp_ns) && geo::IsValid(fix.position) && fix.sigma_m >= 0 &&
                       fix.sigma_m <= std::sqrt(2 * kMaxVarianceM2);
    return sound ? std::optional<ReportedFix>(fix) : std::nullopt;
  });
}

std::vector<StoredEvent> ZoneStore::LoadEvents(const Uuid& hazard, std::uint64_t sequence,
                                               std::size_t limit) {
  return ExplainStore("reading events", [&] {
    Implementation::Row& row = implementation_->row_;
    return WalkEvents(sequence, limit, *implementation_->find_event_, row, [&](const auto& read) {
      auto event = EventOf<StoredEvent>(read, kHazardStates);
      if (!event || !IsIndex(read.action, kActions)) return std::optional<StoredEvent>();
      event->hazard = hazard;
      event->action = static_cast<HazardAction>(read.action);
      event->announced = read.announced != 0;
      return event;
    });
  });
}

}  // namespace livemap::zone
