#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "zone/store/store_connection.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {

/// The tables `decisions` and `withdrawals`: what officials decided, and what was before.
class DecisionTable {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit DecisionTable(StoreConnection& connection);
  DecisionTable(const DecisionTable&) = delete;
  DecisionTable& operator=(const DecisionTable&) = delete;

  /// See the functions of ZoneStore with these names.
  std::vector<DecisionRecord> LoadDecisions(const std::string& subject, std::size_t limit);
  std::vector<DecisionRecord> LoadAllDecisions(std::uint64_t before, std::size_t limit);
  std::vector<DecisionRecord> LoadDecisionsAfter(std::uint64_t after, std::size_t limit);
  std::optional<DecisionRecord> FindNewestDecision(const std::string& subject);
  std::optional<DecisionRecord> FindStandingDistrust(const std::string& vehicle_id,
                                                     std::uint64_t before);
  std::uint64_t WriteDecision(const DecisionRecord& decision);
  void MarkUndone(std::uint64_t decision, std::uint64_t undone_by);
  void AddHazards(std::uint64_t decision, std::uint64_t hazards);
  std::vector<Withdrawal> LoadWithdrawals(std::uint64_t decision, std::size_t limit);
  StoreDamage CheckWithdrawals();
  void WriteWithdrawal(std::uint64_t decision, const Withdrawal& withdrawal);
  void DropWithdrawal(std::uint64_t decision, const Uuid& hazard);

 private:
  /// SOCI binds to places, not to values.
  struct Row {
    std::string subject, hazard_uuid, official, reason, before, effects, detail;
    long long id = 0, at_ns = 0, hazards = 0, undone_by = 0, limit = 0, below = 0;
    int kind = 0, wanted_kind = 0;
  };

  DecisionRecord ToDecision() const;
  std::vector<DecisionRecord> LoadRange(const char* which, std::uint64_t id, std::size_t limit);
  std::optional<DecisionRecord> FindBelow(soci::statement& find, const std::string& subject,
                                          std::uint64_t before);

  StoreConnection& connection_;
  Row row_;
  soci::statement find_;
  soci::statement find_newest_;
  soci::statement find_distrust_;
  WriteStatement write_;
  WriteStatement undo_;
  WriteStatement add_;
  soci::statement find_withdrawals_;
  WriteStatement write_withdrawal_;
  WriteStatement drop_withdrawal_;
};

}  // namespace livemap::zone
