#include "simulation/world/skyline.h"

#include <cmath>

#include "simulation/world/block_builder.h"

namespace livemap::simulation {
namespace {

constexpr double kFrontHeightM = 10;
constexpr double kSkylineReachM = 20;
constexpr double kHillStepM = 5;
/// House fronts end this far from a side road.
constexpr double kCornerGapM = 3.4;

/// A row of house fronts: its place behind the pavement and the part of the road it fills.
struct Row {
  double setback_m = 0;
  double filled = 0;
};

Row SkylineRowAt(const Street& street, double along_m) {
  const int index = static_cast<int>(std::floor(along_m / kBlockM));
  const double side_road_m = static_cast<double>(kSideRoadHalfM) + kCornerGapM;
  for (int near = index - 1; near <= index + 1; ++near) {
    for (const double at : street.Crossings(near)) {
      if (std::abs(along_m - at) < side_road_m) return {};
    }
  }
  switch (BlockBuilder::DistrictOf(street, index)) {
    case BlockBuilder::District::kShops:
      return {0, 0.96};
    case BlockBuilder::District::kHouses:
      return {0.3, 0.96};
    case BlockBuilder::District::kGardens:
      return {3.5, 0.78};
    default:
      return {};
  }
}

}  // namespace

datasets::SkyVisibility SkyOver(const Street& street, double along_m, double left_m) {
  datasets::SkyVisibility sky;
  if (!street.description().buildings) return sky;
  const double pavement_m = static_cast<double>(street.profile().half_road_m() + kKerbWidthM) +
                            street.description().pavement_width_m;
  int count = 0;
  for (double off = -kSkylineReachM; off <= kSkylineReachM; off += kHillStepM, ++count) {
    const Row row = SkylineRowAt(street, along_m + off);
    const double front_m = pavement_m + row.setback_m;
    const double rise_m = kFrontHeightM - kAntennaHeightM;
    sky.left_rad += row.filled * std::atan2(rise_m, front_m - left_m);
    sky.right_rad += row.filled * std::atan2(rise_m, front_m + left_m);
  }
  sky.left_rad /= count;
  sky.right_rad /= count;
  return sky;
}

}  // namespace livemap::simulation
