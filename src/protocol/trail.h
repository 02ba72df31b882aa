#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::protocol {

/// How a vehicle passed a hazard: places of its way in driving order, from before the hazard to
/// behind it, as far as it is known. Nobody is told whose way it was.
using Trail = std::vector<geo::GeoPoint>;

constexpr std::size_t kMaxTrails = 2;        ///< Of one hazard.
constexpr std::size_t kMaxTrailPlaces = 20;  ///< Of one trail; two at least.
constexpr double kMaxTrailOffsetM = 600;     ///< From the hazard to any place of a trail.

/// Those of these trails that can be trails of a hazard at this place, at most kMaxTrails of them:
/// of 2 to kMaxTrailPlaces valid places that are at most kMaxTrailOffsetM away.
std::vector<Trail> ValidTrails(const std::vector<Trail>& trails, const geo::GeoPoint& hazard);

/// The same way by as many of its places as it needs, at most kMaxTrailPlaces: all others lie
/// within 1.5 m of the lines between these, or more where those are too many. At least two places.
Trail SimplifiedTrail(const Trail& trail);

/// Whether they have the same places.
bool AreSame(const Trail& a, const Trail& b);
bool AreSame(const std::vector<Trail>& a, const std::vector<Trail>& b);

/// For messages: east and north of the hazard by turns, in decimetres. Empty for a trail that
/// ValidTrails leaves out.
std::vector<std::int16_t> ToTrailOffsets(const Trail& trail, const geo::GeoPoint& hazard);
/// Throws Error for what is no such list: an odd number, fewer than two places or too many.
Trail FromTrailOffsets(const std::vector<std::int16_t>& offsets, const geo::GeoPoint& hazard);

/// For stores: numbers with a space between. Empty for no trails.
std::string TrailsText(const std::vector<Trail>& trails);
/// Of such a text of at most kMaxTrails trails. Throws Error for any other text.
std::vector<Trail> ParseTrails(const std::string& text);

}  // namespace livemap::protocol
