#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "web/json/json.h"

namespace livemap::region {

/// The region's address of a zone's picture: "/images/SHA256?zone=ID".
std::string RegionPictureAddress(const std::string& zone_address, const std::string& zone);

/// Puts the region's ids (RegionHazardId) in place of the zone's own wherever the answer names a
/// hazard, and the region's addresses in place of those of the zone's pictures. Decisions keep the
/// numbers that their zone gave them.
void NameByRegion(const std::string& zone, nlohmann::json& answer);

/// What one zone answered of a list that is asked of all.
struct ZonePart {
  std::string zone;
  nlohmann::json answer;  ///< As the zone has written it.
};

/// A zone's hazard that an answer names.
struct NamedHazard {
  std::string zone;
  Uuid hazard;
};

/// The audit trails of many zones as one (docs/reference/http-api.md): the newest `limit`
/// decisions, the newest first, each with its `zone`. Appends the hazards that they are about to
/// `named`. Entries that no zone writes are left out.
web::Json MergedDecisions(const std::vector<ZonePart>& parts, std::size_t limit,
                          std::vector<NamedHazard>& named);

/// The assignments of many zones as one list of at most kMaxMergedAssignments, each with its
/// `zone`.
constexpr std::size_t kMaxMergedAssignments = 5000;
web::Json MergedAssignments(const std::vector<ZonePart>& parts, std::vector<NamedHazard>& named);

/// The statistics of many zones summed per class, street and week. No median is told: of medians
/// nobody can make one.
web::Json MergedStatistics(const std::vector<ZonePart>& parts);

}  // namespace livemap::region
