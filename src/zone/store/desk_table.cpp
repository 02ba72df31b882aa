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

std::string IsSoundRedirect(const Dialect& dialect) {
  return dialect.AreIntegers({"kind"}) + " AND " + dialect.AreNumbers({"latitude", "longitude"}) +
         " AND " + dialect.AreTexts({{"class_name", 64}, {"from_uuid", 36}, {"hazard_uuid", 36}});
}
std::string IsSoundAssignment(const Dialect& dialect) {
  return dialect.AreTexts({{"hazard_uuid", 36}, {"team", 64}}) + " AND " +
         dialect.AreIntegers({"due_ns", "since_ns", "decision_id"});
}
std::string IsSoundSighting(const Dialect& dialect) {
  return dialect.AreIntegers({"stamp_ns"}) + " AND " +
         dialect.AreNumbers({"confidence", "latitude", "longitude"}) + " AND " +
         dialect.AreTexts({{"image_sha256", 64}});
}

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
        (connection_.session().prepare
             << "SELECT decision_id, kind, class_name, latitude, longitude, "
                "from_uuid, hazard_uuid FROM redirects WHERE "
             << IsSoundRedirect(connection_.dialect()) << " ORDER BY decision_id",
         soci::into(id), soci::into(kind), soci::into(class_name),
         soci::into(redirect.position.latitude_deg), soci::into(redirect.position.longitude_deg),
         soci::into(from), soci::into(hazard));
    return LoadRows(connection_, "redirects", find, [&] {
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
    connection_.session()
        << "INSERT INTO redirects (decision_id, kind, class_name, latitude, longitude, "
           "from_uuid, hazard_uuid) VALUES (:i, :k, :c, :la, :lo, :f, :h)",
        soci::use(id), soci::use(kind), soci::use(redirect.class_name),
        soci::use(redirect.position.latitude_deg), soci::use(redirect.position.longitude_deg),
        soci::use(from), soci::use(hazard);
  });
}

void DeskTable::DropRedirect(std::uint64_t decision) {
  ExplainStore("dropping a redirect", [&] {
    const auto id = static_cast<long long>(decision);
    connection_.session() << "DELETE FROM redirects WHERE decision_id = :i", soci::use(id);
  });
}

std::vector<Assignment> DeskTable::LoadAssignments() {
  return ExplainStore("reading assignments", [&] {
    std::vector<Assignment> assignments;
    std::string hazard, team;
    long long due_ns = 0, since_ns = 0, decision = 0;
    soci::statement find = (connection_.session().prepare
                                << "SELECT hazard_uuid, team, due_ns, since_ns, decision_id FROM "
                                   "assignments WHERE "
                                << IsSoundAssignment(connection_.dialect())
                                << " ORDER BY due_ns = 0, due_ns, decision_id",
                            soci::into(hazard), soci::into(team), soci::into(due_ns),
                            soci::into(since_ns), soci::into(decision));
    connection_.Run(find);
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
    connection_.session()
        << "INSERT INTO assignments (hazard_uuid, team, due_ns, since_ns, decision_id) "
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
    connection_.session() << "DELETE FROM assignments WHERE hazard_uuid = :h", soci::use(uuid);
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
        (connection_.session().prepare
             << "SELECT stamp_ns, confidence, latitude, longitude, image_sha256 FROM "
                "reports WHERE hazard_id = :h AND "
             << IsSoundSighting(connection_.dialect()) << " ORDER BY rowid DESC LIMIT :l",
         soci::use(id), soci::use(most), soci::into(stamp_ns), soci::into(sighting.confidence),
         soci::into(sighting.position.latitude_deg), soci::into(sighting.position.longitude_deg),
         soci::into(sighting.image_sha256));
    connection_.Run(find);
    while (find.fetch()) {
      if (!IsStamp(stamp_ns) || !geo::IsValid(sighting.position)) continue;
      sighting.stamp_ns = stamp_ns;
      sightings.push_back(sighting);
    }
    return sightings;
  });
}

}  // namespace livemap::zone
