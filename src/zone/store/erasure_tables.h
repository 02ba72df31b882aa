#pragma once

// Part of ZoneStore; nobody else includes this.
#include <string>

#include "zone/model/erasure.h"
#include "zone/store/store_connection.h"

namespace livemap::zone {

/// What all tables say of one vehicle, but the two that memory mirrors, `hazards` and
/// `map_changes`.
class ErasureTables {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit ErasureTables(StoreConnection& connection) : connection_(connection) {}
  ErasureTables(const ErasureTables&) = delete;
  ErasureTables& operator=(const ErasureTables&) = delete;

  /// See ZoneStore::EraseStep.
  void Step(const Pseudonyms& names, ErasureWalk& walk);

 private:
  void FindAnswers(const Pseudonyms& names, ErasureWalk& walk);
  void EraseReports(const Pseudonyms& names, ErasureWalk& walk);
  void EraseAnswers(const Pseudonyms& names, ErasureWalk& walk);
  void EraseAnswerPicture(const std::string& poll_uuid, ErasureWalk& walk);
  void EraseMapChangeReports(const Pseudonyms& names, ErasureWalk& walk);
  void EraseReasons(const char* table, const Pseudonyms& names, ErasureWalk& walk);
  void EraseDecisions(const Pseudonyms& names, ErasureWalk& walk);
  void EraseWithdrawals(const Pseudonyms& names, ErasureWalk& walk);
  void EraseTrust(const Pseudonyms& names, ErasureWalk& walk);
  void ErasePlaces(const Pseudonyms& names, ErasureWalk& walk);
  /// The UUID of the hazard of this row; "no hazard" where there is none.
  std::string HazardOf(long long hazard_id);
  /// `rows` were looked at: whether the part is done, then the next one begins.
  static void TurnPage(ErasureWalk& walk, std::size_t rows);

  StoreConnection& connection_;
};

}  // namespace livemap::zone
