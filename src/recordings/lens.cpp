#include "recordings/lens.h"

#include <algorithm>
#include <cmath>

#include "common/checks.h"
#include "common/error.h"
#include "geo/wgs84.h"

namespace livemap::recordings {
namespace {

/// Wider rectified frames are mostly stretched edges.
constexpr double kMaxRectifiedDeg = 100;
/// How far the ratios of two sizes' sides may differ.
constexpr double kRatioTolerance = 0.01;

/// Pixels from the middle that an angle off the axis is, per focal length.
double Reach(Lens::Projection projection, double angle_rad) {
  return projection == Lens::Projection::kPinhole ? std::tan(angle_rad) : angle_rad;
}

cv::Matx33d CameraMatrix(double focal, int width, int height) {
  return {focal, 0, (width - 1) / 2.0, 0, focal, (height - 1) / 2.0, 0, 0, 1};
}

}  // namespace

const std::vector<Lens>& LensPresets() {
  using Projection = Lens::Projection;
  using Side = Lens::Side;
  static const std::vector<Lens> presets = {
      {"phone", Projection::kPinhole, Side::kHorizontal, 66, "main camera of a phone, filming"},
      {"phone-wide", Projection::kPinhole, Side::kHorizontal, 100, "its wide camera, corrected"},
      {"dashcam-90", Projection::kPinhole, Side::kDiagonal, 90, "recorder with a narrow lens"},
      {"dashcam-120", Projection::kEquidistant, Side::kDiagonal, 120, "recorder, 120 degrees"},
      {"dashcam-140", Projection::kEquidistant, Side::kDiagonal, 140, "recorder, 140 degrees"},
      {"dashcam-160", Projection::kEquidistant, Side::kDiagonal, 160, "recorder, 155 to 170"},
      {"action-linear", Projection::kPinhole, Side::kHorizontal, 87, "action camera, linear"},
      {"action-wide", Projection::kEquidistant, Side::kHorizontal, 118, "action camera, wide"},
  };
  return presets;
}

const Lens& FindLens(const std::string& name) {
  std::string accepted;
  for (const Lens& lens : LensPresets()) {
    if (lens.name == name) return lens;
    accepted += (accepted.empty() ? "" : ", ") + lens.name;
  }
  throw Error("--lens is '" + name + "', accepted are " + accepted);
}

Lens PinholeLens(double field_of_view_deg) {
  CheckRange("the field of view", field_of_view_deg, 20, 150);
  return {"pinhole", Lens::Projection::kPinhole, Lens::Side::kHorizontal, field_of_view_deg, ""};
}

imaging::CameraCalibration CalibrationOf(const Lens& lens, int width, int height) {
  const double side =
      lens.side == Lens::Side::kHorizontal ? std::max(width, height) : std::hypot(width, height);
  const double half_rad = lens.field_of_view_deg / 2 * geo::kRadiansPerDegree;
  const double focal = side / 2 / Reach(lens.projection, half_rad);
  imaging::CameraCalibration calibration;
  calibration.width = width;
  calibration.height = height;
  calibration.k = CameraMatrix(focal, width, height);
  if (lens.projection == Lens::Projection::kPinhole) {
    calibration.distortion_model = "plumb_bob";
    calibration.distortion.assign(5, 0.0);
  } else {
    calibration.distortion_model = "equidistant";
    calibration.distortion.assign(4, 0.0);
  }
  // What the lens sees across, or as much of it as a flat picture shows well.
  const double across_rad = lens.projection == Lens::Projection::kPinhole
                                ? std::atan(width / 2.0 / focal)
                                : width / 2.0 / focal;
  const double limit_rad = kMaxRectifiedDeg / 2 * geo::kRadiansPerDegree;
  double rectified = focal;
  if (lens.projection == Lens::Projection::kEquidistant) {
    rectified = width / 2.0 / std::tan(std::min(across_rad, limit_rad));
  }
  const cv::Matx33d flat = CameraMatrix(rectified, width, height);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) calibration.p(row, column) = flat(row, column);
  }
  return calibration;
}

imaging::CameraCalibration CalibrationOf(const datasets::CameraFile& camera, int width,
                                         int height) {
  const geo::CameraIntrinsics& k = camera.intrinsics;
  const double x_scale = static_cast<double>(width) / k.width;
  const double y_scale = static_cast<double>(height) / k.height;
  if (std::abs(x_scale / y_scale - 1) > kRatioTolerance) {
    throw Error("the camera file '" + camera.name + "' is of pictures of " +
                std::to_string(k.width) + "x" + std::to_string(k.height) +
                " pixels, and the recording has " + std::to_string(width) + "x" +
                std::to_string(height) + ": accepted is the same ratio of the sides");
  }
  imaging::CameraCalibration calibration;
  calibration.width = width;
  calibration.height = height;
  calibration.distortion_model = "plumb_bob";
  calibration.distortion.assign(5, 0.0);
  // Pixel centres lie at integers.
  calibration.k = {k.fx * x_scale,
                   0,
                   (k.cx + 0.5) * x_scale - 0.5,
                   0,
                   k.fy * y_scale,
                   (k.cy + 0.5) * y_scale - 0.5,
                   0,
                   0,
                   1};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      calibration.p(row, column) = calibration.k(row, column);
    }
  }
  return calibration;
}

}  // namespace livemap::recordings
