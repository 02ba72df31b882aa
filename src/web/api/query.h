#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/uuid.h"
#include "geo/geo_box.h"
#include "orders/order.h"
#include "web/http/request_target.h"
#include "zone/model/hazard.h"
#include "zone/model/map_change.h"

namespace livemap::web {

/// What `GET /api/v1/hazards` asks for.
struct HazardQuery {
  std::optional<geo::GeoBox> box;      ///< May cross the antimeridian (west > east).
  std::optional<std::uint64_t> since;  ///< Only what changed after this sequence.
  std::size_t limit = 20000;
  zone::HazardStates states;  ///< Only these; empty: all that are on the map.

  bool Selects(zone::HazardState state) const {
    return states.empty() ? zone::IsOnMap(state) : states.count(state) != 0;
  }
};

/// The most hazards that one answer may hold.
constexpr std::size_t kMaxHazardsPerAnswer = 50000;

/// Reads `bbox=minLon,minLat,maxLon,maxLat` (degrees, RFC 7946 section 5), `since`, `limit` and
/// `state`, one or more of candidate, active, verifying, gone and rejected with commas between.
/// Throws BadRequest naming the parameter, its value and what is accepted; unknown and repeated
/// parameters are refused, so that a misspelt filter never answers with everything.
HazardQuery ParseHazardQuery(const RequestTarget& target);

/// What `GET /api/v1/hazards/points` asks for.
struct PointsQuery {
  zone::HazardStates states;  ///< Only these; empty: all that are on the map.
};

/// Reads `state` as ParseHazardQuery does; refuses every other parameter.
PointsQuery ParsePointsQuery(const RequestTarget& target);

/// What `GET /api/v1/changes` asks for; as HazardQuery.
struct MapChangeQuery {
  std::optional<geo::GeoBox> box;
  std::optional<std::uint64_t> since;
  std::size_t limit = 20000;
  zone::MapChangeStates states;  ///< Only these; empty: proposed and confirmed.

  bool Selects(zone::MapChangeState state) const {
    return states.empty() ? zone::IsOpen(state) : states.count(state) != 0;
  }
};

/// As ParseHazardQuery; states are proposed, confirmed, undone and dismissed.
MapChangeQuery ParseMapChangeQuery(const RequestTarget& target);

/// What `GET /api/v1/streets` asks for.
struct StreetQuery {
  geo::GeoBox box;  ///< West <= east.
  int zoom = 0;     ///< Of web maps: the world is 256 * 2^zoom pixels wide.
};

/// Reads `bbox` and `zoom` (0 to 22), both of which must be given. Throws BadRequest, too, for a
/// box across the antimeridian and for one of more than 2048 pixels of that zoom in width or
/// height.
StreetQuery ParseStreetQuery(const RequestTarget& target);

/// The most events of a hazard that one answer may hold.
constexpr std::size_t kMaxEventsPerAnswer = 1000;

/// The `limit` parameter of a hazard's history, 100 by default; refuses every other parameter.
std::size_t ParseEventsQuery(const RequestTarget& target);

/// What `GET /api/v1/decisions` asks for.
struct DecisionsQuery {
  std::uint64_t before = UINT64_MAX;  ///< Only decisions with a lower id.
  std::size_t limit = 100;            ///< At most kMaxEventsPerAnswer.
  std::optional<Uuid> hazard;         ///< Only about this one, the newest; not with `before`.
};

/// Reads `before`, `limit` and `hazard`; refuses every other parameter.
DecisionsQuery ParseDecisionsQuery(const RequestTarget& target);

/// What `GET /api/v1/orders` asks for: reads `before`, `limit` (at most kMaxEventsPerAnswer),
/// `state`, `recipient` and `hazard`; refuses every other parameter.
orders::OrderFilter ParseOrdersQuery(const RequestTarget& target);

/// The `since` parameter of `/ws`, which is optional; refuses every other parameter.
std::optional<std::uint64_t> ParseStreamQuery(const RequestTarget& target);

}  // namespace livemap::web
