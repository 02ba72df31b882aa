#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/camera_file.h"
#include "imaging/rectifier.h"

namespace livemap::recordings {

/// What is known of a camera that nobody calibrated.
struct Lens {
  enum class Projection {
    kPinhole,     ///< Straight lines stay straight: phones, narrow recorders, "linear" modes.
    kEquidistant  ///< The angle grows with the distance from the middle: wide lenses.
  };
  enum class Side { kHorizontal, kDiagonal };

  std::string name;
  Projection projection = Projection::kPinhole;
  Side side = Side::kHorizontal;  ///< Along which the field of view is stated.
  double field_of_view_deg = 0;
  std::string about;  ///< Which cameras, for the help.
};

/// The lenses that --lens takes. Their fields of view are what makers of such cameras state; an
/// error of 10 % moves a hazard about as much along the road.
const std::vector<Lens>& LensPresets();

/// The preset of that name. Throws Error that lists them.
const Lens& FindLens(const std::string& name);

/// An ideal pinhole with this horizontal field of view, 20 to 150 degrees.
Lens PinholeLens(double field_of_view_deg);

/// The calibration of upright frames of `width` x `height` pixels through a lens. The principal
/// point is the middle. Of a frame that stands upright the field of view is that of the longer
/// side. Rectified, a frame keeps its size and shows at most 100 degrees across.
imaging::CameraCalibration CalibrationOf(const Lens& lens, int width, int height);

/// The calibration that a camera file states, for frames of that size. The file may be of another
/// size with the same ratio of its sides. Throws Error naming both sizes where it is not.
imaging::CameraCalibration CalibrationOf(const datasets::CameraFile& camera, int width, int height);

}  // namespace livemap::recordings
