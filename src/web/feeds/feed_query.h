#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "geo/geo_box.h"
#include "web/http/request_target.h"
#include "zone/model/hazard_state.h"

namespace livemap::web {

/// What a feed is asked for.
struct FeedQuery {
  std::optional<geo::GeoBox> box;      ///< Only hazards inside.
  std::set<std::string> classes;       ///< Only hazards of these; empty: of all.
  std::optional<std::uint64_t> since;  ///< Only what changed after this sequence.
  zone::HazardStates states;           ///< Only these; empty: as the feed says.
};

/// Which parameters a feed takes beside bbox and class.
struct FeedParameters {
  bool state = false;
  bool since = false;
};

/// Reads `bbox`, `class=NAME,...` and what `accepted` names: `state=candidate,active,verifying`,
/// `since=SEQUENCE`. Throws BadRequest naming the parameter, its value and what is accepted;
/// unknown and repeated parameters are refused too.
FeedQuery ParseFeedQuery(const RequestTarget& target, const FeedParameters& accepted);

}  // namespace livemap::web
