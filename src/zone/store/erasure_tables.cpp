#include "zone/store/erasure_tables.h"

#include <climits>
#include <vector>

#include "zone/model/decision.h"
#include "zone/model/hazard.h"
#include "zone/store/queries.h"

namespace livemap::zone {
namespace {

/// Rows looked at in one step: some milliseconds of the writer's time.
constexpr long long kRowsAtOnce = 2000;
constexpr std::size_t kMaxDetailBytes = 200;

/// Rows of a page, with values that SOCI can bind to.
struct ErasureRow {
  std::string id, vehicle_id, image_sha256, reason, subject, before, effects, detail;
  long long number = 0, other = 0;
};

}  // namespace

void ErasureTables::Step(const Pseudonyms& names, ErasureWalk& walk) {
  walk.pictures.clear();
  ExplainStore("erasing what a vehicle said", [&] {
    switch (walk.part) {
      case ErasureWalk::Part::kFindAnswers:
        return FindAnswers(names, walk);
      case ErasureWalk::Part::kReports:
        return EraseReports(names, walk);
      case ErasureWalk::Part::kAnswers:
        return EraseAnswers(names, walk);
      case ErasureWalk::Part::kMapChangeReports:
        return EraseMapChangeReports(names, walk);
      case ErasureWalk::Part::kEvents:
        return EraseReasons("events", names, walk);
      case ErasureWalk::Part::kMapChangeEvents:
        return EraseReasons("map_change_events", names, walk);
      case ErasureWalk::Part::kDecisions:
        return EraseDecisions(names, walk);
      case ErasureWalk::Part::kWithdrawals:
        return EraseWithdrawals(names, walk);
      case ErasureWalk::Part::kTrust:
        return EraseTrust(names, walk);
      case ErasureWalk::Part::kPlaces:
        return ErasePlaces(names, walk);
      case ErasureWalk::Part::kDone:
        return;
    }
  });
}

void ErasureTables::TurnPage(ErasureWalk& walk, std::size_t rows) {
  if (rows == static_cast<std::size_t>(kRowsAtOnce)) return;
  walk.part = static_cast<ErasureWalk::Part>(static_cast<int>(walk.part) + 1);
  walk.after_text.clear();
  walk.after_number = LLONG_MIN;
}

std::string ErasureTables::HazardOf(long long hazard_id) {
  std::string uuid;
  soci::session& session = connection_.session();
  session << "SELECT uuid FROM hazards WHERE id = :id", soci::use(hazard_id), soci::into(uuid);
  return session.got_data() ? uuid : "no hazard";
}

void ErasureTables::FindAnswers(const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  soci::statement page =
      (connection_.session().prepare
           << "SELECT poll_uuid, hazard_id, vehicle_id FROM answers WHERE poll_uuid > "
              ":after ORDER BY poll_uuid LIMIT :most",
       soci::use(walk.after_text), soci::use(kRowsAtOnce), soci::into(row.id),
       soci::into(row.number), soci::into(row.vehicle_id));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    if (row.vehicle_id == names.vehicle_id()) walk.answered.insert(row.number);
  }
  walk.after_text = row.id;
  TurnPage(walk, rows);
}

/// Also the drive's name: it may say whose it was.
void ErasureTables::EraseReports(const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  std::vector<ErasureRow> found;
  soci::statement page =
      (connection_.session().prepare
           << "SELECT uuid, hazard_id, vehicle_id, image_sha256 FROM reports WHERE "
              "uuid > :after ORDER BY uuid LIMIT :most",
       soci::use(walk.after_text), soci::use(kRowsAtOnce), soci::into(row.id),
       soci::into(row.number), soci::into(row.vehicle_id), soci::into(row.image_sha256));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    if (row.vehicle_id == names.vehicle_id()) {
      found.push_back(row);
    } else if (walk.answered.count(row.number) != 0) {
      walk.reported_pictures.insert(row.image_sha256);
    }
  }
  walk.after_text = row.id;
  for (const ErasureRow& report : found) {
    const std::string pseudonym = names.IdFor(HazardOf(report.number));
    connection_.session()
        << "UPDATE reports SET vehicle_id = :v, drive_id = :d, image_sha256 = '' WHERE uuid = "
           ":u",
        soci::use(pseudonym, "v"), soci::use(pseudonym, "d"), soci::use(report.id, "u");
    if (!report.image_sha256.empty()) walk.pictures.push_back(report.image_sha256);
  }
  walk.counts.reports += found.size();
  TurnPage(walk, rows);
}

void ErasureTables::EraseAnswers(const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  std::vector<ErasureRow> found;
  soci::statement page =
      (connection_.session().prepare
           << "SELECT poll_uuid, hazard_id, vehicle_id FROM answers WHERE poll_uuid > "
              ":after ORDER BY poll_uuid LIMIT :most",
       soci::use(walk.after_text), soci::use(kRowsAtOnce), soci::into(row.id),
       soci::into(row.number), soci::into(row.vehicle_id));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    if (row.vehicle_id == names.vehicle_id()) found.push_back(row);
  }
  walk.after_text = row.id;
  for (const ErasureRow& answer : found) {
    const std::string pseudonym = names.IdFor(HazardOf(answer.number));
    connection_.session() << "UPDATE answers SET vehicle_id = :v WHERE poll_uuid = :u",
        soci::use(pseudonym, "v"), soci::use(answer.id, "u");
    EraseAnswerPicture(answer.id, walk);
  }
  walk.counts.answers += found.size();
  TurnPage(walk, rows);
}

void ErasureTables::EraseAnswerPicture(const std::string& poll_uuid, ErasureWalk& walk) {
  std::string image_sha256;
  soci::session& session = connection_.session();
  session << "SELECT image_sha256 FROM answer_pictures WHERE poll_uuid = :u", soci::use(poll_uuid),
      soci::into(image_sha256);
  if (!session.got_data()) return;
  session << "DELETE FROM answer_pictures WHERE poll_uuid = :u", soci::use(poll_uuid);
  walk.pictures.push_back(image_sha256);
}

void ErasureTables::EraseMapChangeReports(const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  std::vector<ErasureRow> found;
  soci::statement page =
      (connection_.session().prepare
           << "SELECT uuid, change_uuid, vehicle_id FROM map_change_reports WHERE "
              "uuid > :after ORDER BY uuid LIMIT :most",
       soci::use(walk.after_text), soci::use(kRowsAtOnce), soci::into(row.id),
       soci::into(row.subject), soci::into(row.vehicle_id));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    if (row.vehicle_id == names.vehicle_id()) found.push_back(row);
  }
  walk.after_text = row.id;
  for (const ErasureRow& report : found) {
    const std::string pseudonym = names.IdFor(report.subject);
    connection_.session()
        << "UPDATE map_change_reports SET vehicle_id = :v, drive_id = :d WHERE uuid = :u",
        soci::use(pseudonym, "v"), soci::use(pseudonym, "d"), soci::use(report.id, "u");
  }
  walk.counts.reports += found.size();
  TurnPage(walk, rows);
}

/// A distrust's events name the vehicle.
void ErasureTables::EraseReasons(const char* table, const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  std::vector<ErasureRow> found;
  soci::statement page =
      (connection_.session().prepare << "SELECT sequence, reason FROM " << table
                                     << " WHERE sequence > :after ORDER BY sequence LIMIT :most",
       soci::use(walk.after_number), soci::use(kRowsAtOnce), soci::into(row.number),
       soci::into(row.reason));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    if (!names.ReplaceName(row.reason, "events", kMaxEventReasonBytes)) continue;
    found.push_back(row);
  }
  walk.after_number = row.number;
  for (const ErasureRow& event : found) {
    connection_.session() << "UPDATE " << table << " SET reason = :r WHERE sequence = :s",
        soci::use(event.reason, "r"), soci::use(event.number, "s");
  }
  TurnPage(walk, rows);
}

/// What was decided about the vehicle can no longer be taken back: nothing is known of it.
void ErasureTables::EraseDecisions(const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  std::vector<ErasureRow> found;
  std::vector<ErasureRow> about_it;
  soci::statement page =
      (connection_.session().prepare
           << "SELECT id, subject, reason, before, effects, coalesce((SELECT detail FROM "
              "decision_details WHERE decision_id = decisions.id), '') FROM decisions WHERE id > "
              ":after ORDER BY id LIMIT :most",
       soci::use(walk.after_number), soci::use(kRowsAtOnce), soci::into(row.number),
       soci::into(row.subject), soci::into(row.reason), soci::into(row.before),
       soci::into(row.effects), soci::into(row.detail));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    const std::string about = row.subject;
    bool changes = names.ReplaceName(row.reason, about, kMaxDecisionTextBytes);
    changes |= names.ReplaceName(row.detail, about, kMaxDetailBytes);
    changes |= names.ReplaceKey(row.before, about);
    changes |= names.ReplaceKey(row.effects, about);
    if (row.subject == names.vehicle_id()) {
      row.subject = names.IdFor("decisions");
      row.before.clear();
      about_it.push_back(row);
      changes = true;
    }
    if (changes) found.push_back(row);
  }
  walk.after_number = row.number;
  for (const ErasureRow& decision : found) {
    connection_.session()
        << "UPDATE decisions SET subject = :s, reason = :r, before = :b, effects = :e WHERE "
           "id = :i",
        soci::use(decision.subject, "s"), soci::use(decision.reason, "r"),
        soci::use(decision.before, "b"), soci::use(decision.effects, "e"),
        soci::use(decision.number, "i");
    connection_.session() << "UPDATE decision_details SET detail = :d WHERE decision_id = :i",
        soci::use(decision.detail, "d"), soci::use(decision.number, "i");
  }
  for (const ErasureRow& decision : about_it) {
    connection_.session() << "DELETE FROM withdrawals WHERE decision_id = :i",
        soci::use(decision.number, "i");
  }
  TurnPage(walk, rows);
}

void ErasureTables::EraseWithdrawals(const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  std::vector<ErasureRow> found;
  soci::statement page =
      (connection_.session().prepare
           << "SELECT decision_id, hazard_uuid, before FROM withdrawals WHERE "
              "decision_id > :after OR (decision_id = :after AND hazard_uuid > :text) "
              "ORDER BY decision_id, hazard_uuid LIMIT :most",
       soci::use(walk.after_number, "after"), soci::use(walk.after_text, "text"),
       soci::use(kRowsAtOnce, "most"), soci::into(row.number), soci::into(row.subject),
       soci::into(row.before));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    if (names.ReplaceKey(row.before, row.subject)) found.push_back(row);
  }
  walk.after_number = row.number;
  walk.after_text = row.subject;
  for (const ErasureRow& withdrawal : found) {
    connection_.session()
        << "UPDATE withdrawals SET before = :b WHERE decision_id = :i AND hazard_uuid = :u",
        soci::use(withdrawal.before, "b"), soci::use(withdrawal.number, "i"),
        soci::use(withdrawal.subject, "u");
  }
  TurnPage(walk, rows);
}

void ErasureTables::EraseTrust(const Pseudonyms& names, ErasureWalk& walk) {
  ErasureRow row;
  std::size_t rows = 0;
  std::vector<ErasureRow> found;
  soci::statement page =
      (connection_.session().prepare
           << "SELECT vehicle_key, vouchers FROM trust WHERE vehicle_key > :after "
              "ORDER BY vehicle_key LIMIT :most",
       soci::use(walk.after_number), soci::use(kRowsAtOnce), soci::into(row.number),
       soci::into(row.reason));
  connection_.Run(page);
  while (page.fetch()) {
    ++rows;
    if (names.ReplaceKey(row.reason, "trust")) found.push_back(row);
  }
  walk.after_number = row.number;
  for (const ErasureRow& record : found) {
    connection_.session() << "UPDATE trust SET vouchers = :o WHERE vehicle_key = :k",
        soci::use(record.reason, "o"), soci::use(record.number, "k");
  }
  // The same bits: databases have no unsigned numbers.
  const auto key = static_cast<long long>(names.key());
  connection_.session() << "DELETE FROM trust WHERE vehicle_key = :k", soci::use(key, "k");
  TurnPage(walk, rows);
}

/// Few: the rule of speed remembers no more of one vehicle.
void ErasureTables::ErasePlaces(const Pseudonyms& names, ErasureWalk& walk) {
  long long places = 0;
  connection_.session() << "SELECT count(*) FROM places WHERE vehicle_id = :v",
      soci::use(names.vehicle_id(), "v"), soci::into(places);
  connection_.session() << "DELETE FROM places WHERE vehicle_id = :v",
      soci::use(names.vehicle_id(), "v");
  walk.counts.places += static_cast<std::uint64_t>(places);
  TurnPage(walk, 0);
}

}  // namespace livemap::zone
