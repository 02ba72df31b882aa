#include "zone/store/desk_table.h"

#include <string>
#include <utility>

#include "common/error.h"
#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {
namespace {

constexpr char kSoundRedirect[] =
    "typeof(kind) = 'integer' AND typeof(class_name) = 'text' AND "
    "length(CAST(class_name AS BLOB)) <= 64 AND typeof(latitude) = 'real' AND "
    "typeof(longitude) = 'real' AND typeof(from_uuid) = 'text' AND "
    "length(CAST(from_uuid AS BLOB)) = 36 AND typeof(hazard_uuid) = 'text' AND "
    "length(CAST(hazard_uuid AS BLOB)) = 36";
constexpr char kSoundAssignment[] =
    "typeof(hazard_uuid) = 'text' AND length(CAST(hazard_uuid AS BLOB)) = 36 AND "
    "typeof(team) = 'text' AND length(CAST(team AS BLOB)) <= 64 AND typeof(due_ns) = 'integer' AND "
    "typeof(since_ns) = 'integer' AND typeof(decision_id) = 'integer'";
constexpr char kSoundSighting[] =
    "typeof(stamp_ns) = 'integer' AND typeof(confidence) = 'real' AND typeof(latitude) = 'real' "
    "AND typeof(longitude) = 'real' AND typeof(image_sha256) = 'text' AND "
    "length(CAST(image_sha256 AS BLOB)) <= 64";

bool IsOfEdit(int kind) {
  return kind == static_cast<int>(DecisionKind::kReclassHazard) ||
         kind == static_cast<int>(DecisionKind::kMoveHazard) ||
         kind == static_cast<int>(DecisionKind::kMergeHazard);
}

bool IsDecisionId(long long id) { return id >= 1 && id < kMaxSequence; }

}  // namespace

StoreDamage DeskTable::LoadRedirects(const std::function<void(Redirect)>& take) {
  return ExplainStore("reading redirects", [&] {
    std::string class_name, from, hazard;
    long long id = 0;
    int kind = 0;
    Redirect redirect;
    soci::statement find =
        (session_.prepare << "SELECT decision_id, kind, class_name, latitude, longitude, "
                             "from_uuid, hazard_uuid FROM redirects WHERE "
                          << kSoundRedirect << " ORDER BY decision_id",
         soci::into(id), soci::into(kind), soci::into(class_name),
         soci::into(redirect.position.latitude_deg), soci::into(redirect.position.longitude_deg),
         soci::into(from), soci::into(hazard));
    return LoadRows(session_, "redirects", find, [&] {
      const auto from_uuid = Uuid::Parse(from);
      const auto hazard_uuid = Uuid::Parse(hazard);
      const bool is_sound = IsDecisionId(id) && IsOfEdit(kind) && from_uuid && hazard_uuid &&
                            geo::IsValid(redirect.position);
      if (!is_sound) throw Error("redirect " + std::to_string(id) + " is none");
      redirect.decision = static_cast<std::uint64_t>(id);
      redirect.kind = static_cast<DecisionKind>(kind);
      redirect.class_name = class_name;
      redirect.from = *from_uuid;
      redirect.hazard = *hazard_uuid;
      take(redirect);
    });
  });
}

void DeskTable::WriteRedirect(const Redirect& redirect) {
  ExplainStore("writing a redirect", [&] {
    const auto id = static_cast<long long>(redirect.decision);
    const int kind = static_cast<int>(redirect.kind);
    const std::string from = redirect.from.ToString();
    const std::string hazard = redirect.hazard.ToString();
    session_ << "INSERT INTO redirects (decision_id, kind, class_name, latitude, longitude, "
                "from_uuid, hazard_uuid) VALUES (:i, :k, :c, :la, :lo, :f, :h)",
        soci::use(id), soci::use(kind), soci::use(redirect.class_name),
        soci::use(redirect.position.latitude_deg), soci::use(redirect.position.longitude_deg),
        soci::use(from), soci::use(hazard);
  });
}

void DeskTable::DropRedirect(std::uint64_t decision) {
  ExplainStore("dropping a redirect", [&] {
    const auto id = static_cast<long long>(decision);
    session_ << "DELETE FROM redirects WHERE decision_id = :i", soci::use(id);
  });
}

std::vector<Assignment> DeskTable::LoadAssignments() {
  return ExplainStore("reading assignments", [&] {
    std::vector<Assignment> assignments;
    std::string hazard, team;
    long long due_ns = 0, since_ns = 0, decision = 0;
    soci::statement find =
        (session_.prepare << "SELECT hazard_uuid, team, due_ns, since_ns, decision_id FROM "
                             "assignments WHERE "
                          << kSoundAssignment << " ORDER BY due_ns = 0, due_ns, decision_id",
         soci::into(hazard), soci::into(team), soci::into(due_ns), soci::into(since_ns),
         soci::into(decision));
    find.execute();
    while (find.fetch()) {
      const auto uuid = Uuid::Parse(hazard);
      const bool is_sound = uuid && protocol::IsPrintableText(team, kMaxTeamBytes) &&
                            IsStamp(due_ns) && IsStamp(since_ns) && IsDecisionId(decision);
      if (!is_sound) continue;
      assignments.push_back({*uuid, team, due_ns, since_ns, static_cast<std::uint64_t>(decision)});
    }
    return assignments;
  });
}

void DeskTable::WriteAssignment(const Assignment& assignment) {
  ExplainStore("writing an assignment", [&] {
    const std::string hazard = assignment.hazard.ToString();
    const long long due_ns = assignment.due_ns;
    const long long since_ns = assignment.since_ns;
    const auto decision = static_cast<long long>(assignment.decision);
    session_ << "INSERT INTO assignments (hazard_uuid, team, due_ns, since_ns, decision_id) "
                "VALUES (:h, :t, :d, :s, :i) ON CONFLICT (hazard_uuid) DO UPDATE SET "
                "team = excluded.team, due_ns = excluded.due_ns, since_ns = excluded.since_ns, "
                "decision_id = excluded.decision_id",
        soci::use(hazard), soci::use(assignment.team), soci::use(due_ns), soci::use(since_ns),
        soci::use(decision);
  });
}

void DeskTable::DropAssignment(const Uuid& hazard) {
  ExplainStore("dropping an assignment", [&] {
    const std::string uuid = hazard.ToString();
    session_ << "DELETE FROM assignments WHERE hazard_uuid = :h", soci::use(uuid);
  });
}

std::vector<SightingRecord> DeskTable::LoadSightings(std::uint64_t hazard_id, const Uuid& hazard,
                                                     std::size_t limit) {
  return ExplainStore("reading sightings", [&] {
    std::vector<SightingRecord> sightings;
    const auto id = static_cast<long long>(hazard_id);
    const auto most = static_cast<long long>(limit);
    long long stamp_ns = 0;
    SightingRecord sighting;
    sighting.hazard = hazard;
    // The newest first: the search ends when as many are found as there are.
    soci::statement find =
        (session_.prepare << "SELECT stamp_ns, confidence, latitude, longitude, image_sha256 FROM "
                             "reports WHERE hazard_id = :h AND "
                          << kSoundSighting << " ORDER BY rowid DESC LIMIT :l",
         soci::use(id), soci::use(most), soci::into(stamp_ns), soci::into(sighting.confidence),
         soci::into(sighting.position.latitude_deg), soci::into(sighting.position.longitude_deg),
         soci::into(sighting.image_sha256));
    find.execute();
    while (find.fetch()) {
      if (!IsStamp(stamp_ns) || !geo::IsValid(sighting.position)) continue;
      sighting.stamp_ns = stamp_ns;
      sightings.push_back(sighting);
    }
    return sightings;
  });
}

}  // namespace livemap::zone
