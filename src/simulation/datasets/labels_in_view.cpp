#include "simulation/datasets/labels_in_view.h"

#include <algorithm>
#include <map>

namespace livemap::simulation {
namespace {

struct Extent {
  int left;
  int top;
  int right;
  int bottom;
  int pixels;
};

bool IsDifficultLabel(const HazardInView& hazard, const OutlinePixels& outlines,
                      const LabelLimits& limits) {
  if (std::min(hazard.box.width, hazard.box.height) < limits.clear_side) return true;
  const auto outline = outlines.find(hazard.instance);
  return outline != outlines.end() && hazard.visible_pixels < limits.clear_share * outline->second;
}

}  // namespace

std::vector<HazardInView> FindHazards(const cv::Mat& instances, const OutlinePixels& outlines,
                                      const LabelLimits& limits) {
  std::map<std::uint32_t, Extent> extents;
  for (int row = 0; row < instances.rows; ++row) {
    const auto* line = instances.ptr<int>(row);
    for (int column = 0; column < instances.cols; ++column) {
      const auto instance = static_cast<std::uint32_t>(line[column]);
      if (!IsHazard(ClassOfInstance(instance))) continue;
      const auto [found, is_new] =
          extents.try_emplace(instance, Extent{column, row, column, row, 0});
      Extent& extent = found->second;
      extent.left = std::min(extent.left, column);
      extent.right = std::max(extent.right, column);
      extent.bottom = row;
      ++extent.pixels;
    }
  }
  std::vector<HazardInView> hazards;
  for (const auto& [instance, extent] : extents) {
    HazardInView hazard;
    hazard.object_class = ClassOfInstance(instance);
    hazard.instance = instance;
    hazard.box = cv::Rect(extent.left, extent.top, extent.right - extent.left + 1,
                          extent.bottom - extent.top + 1);
    hazard.visible_pixels = extent.pixels;
    if (extent.pixels >= limits.min_pixels && hazard.box.width >= limits.min_width &&
        hazard.box.height >= limits.min_height) {
      hazard.difficult = IsDifficultLabel(hazard, outlines, limits);
      hazards.push_back(hazard);
    }
  }
  return hazards;
}

}  // namespace livemap::simulation
