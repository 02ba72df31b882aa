#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "recording.h"

namespace livemap::bench {

/// Every kind of edges, source of edges and rule for keyframes, and OpenCV's two methods, side by
/// side: each frame is given to one after the other, in an order that rotates, so that what else
/// the machine does meets all of them. Kind structured only with its model's file. The paths of the
/// default, of OpenCV's RgbdOdometry and of the truth are there to be drawn.
nlohmann::ordered_json MeasureTables(const Recording& recording, const std::string& edge_model);

/// The thesis's ablation (section 5.3.3): a share of the edge pixels against as many pixels from
/// anywhere in the image, `runs` draws of each; adaptive keyframes, no constant motion, no limit on
/// the number of points.
nlohmann::ordered_json MeasureAblation(const Recording& recording, std::size_t runs);

/// Time per tracked frame and per keyframe against the number of pixels, from a few hundred edge
/// pixels to every pixel of the image.
nlohmann::ordered_json MeasurePixels(const Recording& recording);

/// The default alone on every `step`th frame: errors, frames lost, the largest error of a step, and
/// the mean normalised squared errors of its steps per degree of freedom, which are 1 where the
/// stated covariance is true; null where no step had one.
nlohmann::ordered_json MeasureWorld(const Recording& recording, std::size_t step);

struct BasinOptions {
  std::size_t pairs = 30;  ///< Of neighbouring frames, spread over the recording.
  std::uint32_t seed = 1;
  double bound_m = 0.01;  ///< Within this of the truth an alignment has converged,
  double bound_deg = 0.5;
};

/// How far from the truth an alignment of two frames may start: the share of pairs that end within
/// the bounds when the guess is off by growing translations or rotations in random directions, the
/// same ones for our method and OpenCV's. OpenCV's own limits on the motion are lifted.
nlohmann::ordered_json MeasureBasin(const Recording& recording, const BasinOptions& options);

}  // namespace livemap::bench
