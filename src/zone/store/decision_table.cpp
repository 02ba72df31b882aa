#include "zone/store/decision_table.h"

#include <algorithm>

#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/model/hazard.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {
namespace {

std::string IsSoundDecision(const Dialect& dialect) {
  return dialect.AreIntegers({"kind", "at_ns", "hazards", "undone_by"}) + " AND " +
         dialect.AreTexts({{"official", 64}, {"reason", 500}, {"before", 5000}, {"effects", 500}});
}
std::string DetailOfDecision(const Dialect& dialect) {
  return "coalesce((SELECT substr(detail, 1, 200) FROM decision_details WHERE decision_id = "
         "decisions.id AND " +
         dialect.AreTexts({{"detail", 100'000}}) + "), '')";
}
constexpr char kDecisionColumns[] =
    "SELECT id, kind, official, reason, at_ns, hazards, undone_by, before, effects, ";
constexpr char kOfSubject[] = " FROM decisions WHERE subject = :s AND ";
/// Those that say whether a hazard is there (or what becomes of a map change or a vehicle): no undo
/// and none of IsOfDesk.
constexpr char kJudges[] = " AND kind NOT IN (5, 7, 8, 10, 11, 12, 13, 15, 16)";
/// As this program writes a uuid: one that no row may have could never be dropped by it.
std::string IsSoundWithdrawal(const Dialect& dialect) {
  return dialect.IsUuid("hazard_uuid") + " AND " + dialect.AreTexts({{"before", 500}});
}

template <typename Row>
bool IsSound(const Row& row) {
  return row.id >= 1 && row.id < kMaxSequence && IsIndex(row.kind, kDecisionKinds) &&
         protocol::IsPrintableText(row.official, kMaxStoredTextBytes) &&
         (row.reason.empty() || protocol::IsPrintableText(row.reason, kMaxDecisionTextBytes)) &&
         IsStamp(row.at_ns) && row.hazards >= 0 && row.undone_by >= 0 &&
         row.undone_by < kMaxSequence;
}

}  // namespace

DecisionTable::DecisionTable(StoreConnection& connection)
    : connection_(connection),
      find_((connection.session().prepare
                 << kDecisionColumns << DetailOfDecision(connection.dialect()) << kOfSubject
                 << IsSoundDecision(connection.dialect()) << " ORDER BY id DESC LIMIT :l",
             soci::use(row_.subject), soci::use(row_.limit), soci::into(row_.id),
             soci::into(row_.kind), soci::into(row_.official), soci::into(row_.reason),
             soci::into(row_.at_ns), soci::into(row_.hazards), soci::into(row_.undone_by),
             soci::into(row_.before), soci::into(row_.effects), soci::into(row_.detail))),
      find_newest_((connection.session().prepare
                        << kDecisionColumns << DetailOfDecision(connection.dialect()) << kOfSubject
                        << IsSoundDecision(connection.dialect()) << kJudges
                        << " AND id < :b ORDER BY id DESC LIMIT 1",
                    soci::use(row_.subject), soci::use(row_.below), soci::into(row_.id),
                    soci::into(row_.kind), soci::into(row_.official), soci::into(row_.reason),
                    soci::into(row_.at_ns), soci::into(row_.hazards), soci::into(row_.undone_by),
                    soci::into(row_.before), soci::into(row_.effects), soci::into(row_.detail))),
      find_distrust_((connection.session().prepare
                          << kDecisionColumns << DetailOfDecision(connection.dialect())
                          << kOfSubject << IsSoundDecision(connection.dialect())
                          << " AND kind = :k AND undone_by = 0 AND id < :b "
                             "ORDER BY id DESC LIMIT 1",
                      soci::use(row_.subject), soci::use(row_.wanted_kind), soci::use(row_.below),
                      soci::into(row_.id), soci::into(row_.kind), soci::into(row_.official),
                      soci::into(row_.reason), soci::into(row_.at_ns), soci::into(row_.hazards),
                      soci::into(row_.undone_by), soci::into(row_.before), soci::into(row_.effects),
                      soci::into(row_.detail))),
      write_(connection,
             "INSERT INTO decisions (kind, subject, official, reason, at_ns, hazards, "
             "undone_by, before, effects) VALUES (:k, :s, :o, :r, :a, :h, :u, :b, :e)",
             {row_.kind, row_.subject, row_.official, row_.reason, row_.at_ns, row_.hazards,
              row_.undone_by, row_.before, row_.effects}),
      undo_(connection, "UPDATE decisions SET undone_by = :u WHERE id = :i",
            {row_.undone_by, row_.id}),
      add_(connection, "UPDATE decisions SET hazards = hazards + :h WHERE id = :i",
           {row_.hazards, row_.id}),
      find_withdrawals_(
          (connection.session().prepare
               << "SELECT hazard_uuid, before FROM withdrawals WHERE decision_id = :d "
                  "AND "
               << IsSoundWithdrawal(connection.dialect()) << " ORDER BY hazard_uuid LIMIT :l",
           soci::use(row_.id), soci::use(row_.limit), soci::into(row_.hazard_uuid),
           soci::into(row_.before))),
      write_withdrawal_(connection,
                        "INSERT INTO withdrawals (decision_id, hazard_uuid, "
                        "before) VALUES (:d, :h, :b) ON CONFLICT "
                        "(decision_id, hazard_uuid) DO NOTHING",
                        {row_.id, row_.hazard_uuid, row_.before}),
      drop_withdrawal_(connection,
                       "DELETE FROM withdrawals WHERE decision_id = :d AND "
                       "hazard_uuid = :h",
                       {row_.id, row_.hazard_uuid}) {}

DecisionRecord DecisionTable::ToDecision() const {
  DecisionRecord decision;
  decision.id = static_cast<std::uint64_t>(row_.id);
  decision.kind = static_cast<DecisionKind>(row_.kind);
  decision.subject = row_.subject;
  decision.official = row_.official;
  decision.reason = row_.reason;
  decision.at_ns = row_.at_ns;
  decision.hazards = static_cast<std::uint64_t>(row_.hazards);
  decision.undone_by = static_cast<std::uint64_t>(row_.undone_by);
  decision.before = row_.before;
  decision.effects = row_.effects;
  decision.detail = row_.detail;
  return decision;
}

std::vector<DecisionRecord> DecisionTable::LoadDecisions(const std::string& subject,
                                                         std::size_t limit) {
  return ExplainStore("reading decisions", [&] {
    std::vector<DecisionRecord> decisions;
    row_.subject = subject;
    row_.limit = static_cast<long long>(limit);
    connection_.Run(find_);
    while (find_.fetch()) {
      if (IsSound(row_)) decisions.push_back(ToDecision());
    }
    return decisions;
  });
}

std::vector<DecisionRecord> DecisionTable::LoadAllDecisions(std::uint64_t before,
                                                            std::size_t limit) {
  return LoadRange("id < :i ORDER BY id DESC", before, limit);
}

std::vector<DecisionRecord> DecisionTable::LoadDecisionsAfter(std::uint64_t after,
                                                              std::size_t limit) {
  return LoadRange("id > :i ORDER BY id", after, limit);
}

/// The first `limit` sound rows; `which` says which ones there are, by their id, and their order.
std::vector<DecisionRecord> DecisionTable::LoadRange(const char* which, std::uint64_t id,
                                                     std::size_t limit) {
  return ExplainStore("reading decisions", [&] {
    std::vector<DecisionRecord> decisions;
    row_.below = static_cast<long long>(std::min<std::uint64_t>(id, kMaxSequence));
    soci::statement find =
        (connection_.session().prepare
             << "SELECT id, kind, subject, official, reason, at_ns, hazards, "
                "undone_by, before, effects, "
             << DetailOfDecision(connection_.dialect()) << " FROM decisions WHERE "
             << connection_.dialect().AreTexts({{"subject", 64}}) << " AND "
             << IsSoundDecision(connection_.dialect()) << " AND " << which << " LIMIT :l",
         soci::use(row_.below), soci::use(row_.limit), soci::into(row_.id), soci::into(row_.kind),
         soci::into(row_.subject), soci::into(row_.official), soci::into(row_.reason),
         soci::into(row_.at_ns), soci::into(row_.hazards), soci::into(row_.undone_by),
         soci::into(row_.before), soci::into(row_.effects), soci::into(row_.detail));
    // Broken rows make a page shorter than it was asked to be: another one follows.
    for (bool is_end = false; !is_end && decisions.size() < limit;) {
      row_.limit = static_cast<long long>(limit - decisions.size());
      long long rows = 0;
      connection_.Run(find);
      for (; find.fetch(); ++rows) {
        row_.below = row_.id;
        if (IsSound(row_) && protocol::IsPrintableText(row_.subject, kMaxStoredTextBytes)) {
          decisions.push_back(ToDecision());
        }
      }
      is_end = rows < row_.limit;
    }
    return decisions;
  });
}

/// The newest sound row that `find` finds below `before`; it fetches one at a time.
std::optional<DecisionRecord> DecisionTable::FindBelow(soci::statement& find,
                                                       const std::string& subject,
                                                       std::uint64_t before) {
  return ExplainStore("reading decisions", [&]() -> std::optional<DecisionRecord> {
    row_.subject = subject;
    row_.below = static_cast<long long>(std::min<std::uint64_t>(before, kMaxSequence));
    while (FetchOne(connection_, find)) {
      if (IsSound(row_)) return ToDecision();
      row_.below = row_.id;
    }
    return std::nullopt;
  });
}

std::optional<DecisionRecord> DecisionTable::FindNewestDecision(const std::string& subject) {
  return FindBelow(find_newest_, subject, UINT64_MAX);
}

std::optional<DecisionRecord> DecisionTable::FindStandingDistrust(const std::string& vehicle_id,
                                                                  std::uint64_t before) {
  row_.wanted_kind = static_cast<int>(DecisionKind::kDistrustVehicle);
  return FindBelow(find_distrust_, vehicle_id, before);
}

std::uint64_t DecisionTable::WriteDecision(const DecisionRecord& decision) {
  return ExplainStore("writing a decision", [&] {
    row_.kind = static_cast<int>(decision.kind);
    row_.subject = decision.subject;
    row_.official = decision.official;
    row_.reason = decision.reason;
    row_.at_ns = decision.at_ns;
    row_.hazards = static_cast<long long>(decision.hazards);
    row_.undone_by = static_cast<long long>(decision.undone_by);
    row_.before = decision.before;
    row_.effects = decision.effects;
    write_.Execute();
    long long id = 0;
    connection_.session() << "SELECT max(id) FROM decisions", soci::into(id);
    if (!decision.detail.empty()) {
      connection_.session() << "INSERT INTO decision_details (decision_id, detail) VALUES (:i, :d)",
          soci::use(id), soci::use(decision.detail);
    }
    return static_cast<std::uint64_t>(std::max(id, 0LL));
  });
}

void DecisionTable::MarkUndone(std::uint64_t decision, std::uint64_t undone_by) {
  ExplainStore("marking a decision as undone", [&] {
    row_.id = static_cast<long long>(decision);
    row_.undone_by = static_cast<long long>(undone_by);
    undo_.Execute();
  });
}

void DecisionTable::AddHazards(std::uint64_t decision, std::uint64_t hazards) {
  ExplainStore("counting what a decision changed", [&] {
    row_.id = static_cast<long long>(decision);
    row_.hazards = static_cast<long long>(hazards);
    add_.Execute();
  });
}

std::vector<Withdrawal> DecisionTable::LoadWithdrawals(std::uint64_t decision, std::size_t limit) {
  return ExplainStore("reading what was withdrawn", [&] {
    std::vector<Withdrawal> withdrawals;
    row_.id = static_cast<long long>(decision);
    row_.limit = static_cast<long long>(limit);
    connection_.Run(find_withdrawals_);
    while (find_withdrawals_.fetch()) {
      const auto hazard = Uuid::Parse(row_.hazard_uuid);
      if (hazard) withdrawals.push_back({*hazard, row_.before});
    }
    return withdrawals;
  });
}

StoreDamage DecisionTable::CheckWithdrawals() {
  return ExplainStore("reading what was withdrawn", [&] {
    StoreDamage damage;
    long long broken = 0;
    connection_.session() << "SELECT count(*) FROM withdrawals WHERE NOT ("
                          << IsSoundWithdrawal(connection_.dialect()) << ")",
        soci::into(broken);
    for (; broken > 0; --broken) damage.Note("a row of withdrawals has no uuid or no lifecycle");
    return damage;
  });
}

void DecisionTable::WriteWithdrawal(std::uint64_t decision, const Withdrawal& withdrawal) {
  ExplainStore("writing what was withdrawn", [&] {
    row_.id = static_cast<long long>(decision);
    row_.hazard_uuid = withdrawal.hazard.ToString();
    row_.before = withdrawal.before;
    write_withdrawal_.Execute();
  });
}

void DecisionTable::DropWithdrawal(std::uint64_t decision, const Uuid& hazard) {
  ExplainStore("dropping what was withdrawn", [&] {
    row_.id = static_cast<long long>(decision);
    row_.hazard_uuid = hazard.ToString();
    drop_withdrawal_.Execute();
  });
}

}  // namespace livemap::zone
