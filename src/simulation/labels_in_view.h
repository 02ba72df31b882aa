#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "simulation/object_class.h"

namespace livemap {

/// A hazard as a picture shows it.
struct HazardInView {
  ObjectClass object_class = ObjectClass::kPothole;
  std::uint32_t instance = 0;
  cv::Rect box;  ///< Whole pixels; encloses every visible pixel of the instance, exactly.
  int visible_pixels = 0;
};

/// What must be seen of a hazard before it is labelled.
struct LabelLimits {
  int least_pixels = 24;  ///< Visible.
  int least_width = 6;    ///< Of the box, pixels.
  int least_height = 3;
};

/// Hazards of an instance image (CV_32SC1, see MakeInstance), by instance.
std::vector<HazardInView> FindHazards(const cv::Mat& instances, const LabelLimits& limits);

}  // namespace livemap
