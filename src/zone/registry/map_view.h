#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "geo/geo_box.h"
#include "zone/model/presence_record.h"

namespace livemap::zone {

/// A hazard on the map, as far as it says where a map should be opened.
struct ViewHazard {
  geo::GeoPoint position;
  /// VehicleKeys of those that speak for it and count; 0: nobody.
  std::array<std::uint64_t, kMaxEvidencePerHazard> supporters{};
};

/// The part of the earth where most of the hazards are; none without hazards. It may cross the
/// antimeridian (west > east), and is never smaller than a kilometre.
///
/// No vehicle decides it alone: one that supports n hazards has log(1 + n) votes, which it shares
/// out evenly among them; hazards that nobody supports count as those of one more vehicle. The view
/// lies around the place
/// with the most votes, as far as 50 km from it, and leaves out the outermost hundredth of the
/// votes on each side. Distances are taken on the earth, so that neither the antimeridian nor a
/// pole is a border.
std::optional<geo::GeoBox> ViewOf(const std::vector<ViewHazard>& hazards);

}  // namespace livemap::zone
