#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "simulation/objects/object_class.h"
#include "simulation/render/hazard_outline.h"

namespace livemap::simulation {

/// A hazard as a picture shows it.
struct HazardInView {
  ObjectClass object_class = ObjectClass::kPothole;
  std::uint32_t instance = 0;
  cv::Rect box;  ///< Whole pixels; encloses every visible pixel of the instance, exactly.
  int visible_pixels = 0;
  /// Too small or too hidden to be named without doubt: a detector need not find it, and is not
  /// wrong where it does (Everingham et al. 2010, "The PASCAL VOC challenge", section 3.3).
  bool difficult = false;
};

/// What must be seen of a hazard before it is labelled.
struct LabelLimits {
  int min_pixels = 24;  ///< Visible.
  int min_width = 6;    ///< Of the box, pixels.
  int min_height = 3;

  /// Of the box, pixels each way; below, a label is difficult. Of the boxes that people drew into
  /// the survey drives 95 % are as large (at 640x400).
  int clear_side = 8;
  /// Of the outline's pixels, visible; below, a label is difficult.
  double clear_share = 0.4;
};

/// Hazards of an instance image (CV_32SC1, see MakeInstance), by instance; those without an entry
/// in `outlines` count as hidden by nothing.
std::vector<HazardInView> FindHazards(const cv::Mat& instances, const OutlinePixels& outlines,
                                      const LabelLimits& limits = LabelLimits());

}  // namespace livemap::simulation
