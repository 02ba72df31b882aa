#pragma once

// Part of ZoneStore; nobody else includes this.
#include <soci/soci.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "common/uuid.h"
#include "zone/desk/desk_action.h"
#include "zone/desk/redirects.h"
#include "zone/model/store_damage.h"
#include "zone/store/store_connection.h"

namespace livemap::zone {

/// The tables of what officials do with hazards beside judging them. Every function throws
/// StoreError. Few rows change, one at a time, so that no statement is kept ready.
class DeskTable {
 public:
  /// Keeps the connection.
  explicit DeskTable(StoreConnection& connection) : connection_(connection) {}

  /// As ZoneStore's functions of these names.
  StoreDamage LoadRedirects(const std::function<void(Redirect)>& take);
  void WriteRedirect(const Redirect& redirect);
  void DropRedirect(std::uint64_t decision);
  std::vector<Assignment> LoadAssignments();
  void WriteAssignment(const Assignment& assignment);
  void DropAssignment(const Uuid& hazard);
  std::vector<SightingRecord> LoadSightings(std::uint64_t hazard_id, const Uuid& hazard,
                                            std::size_t limit);

 private:
  StoreConnection& connection_;
};

}  // namespace livemap::zone
