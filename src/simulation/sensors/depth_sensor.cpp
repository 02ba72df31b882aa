#include "simulation/sensors/depth_sensor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "simulation/objects/noise.h"

namespace livemap::simulation {
namespace {

/// What both kinds measure is disparity; its errors make those of depth grow with the square.
struct Model {
  float focal_px;
  float baseline_m;
  float sigma_px;
  float step_px;  ///< 0: none.
  float nearest_m;
  float farthest_m;
  float edge;  ///< Neighbours whose depth differs by this share leave a hole.
};

Model SensorModelOf(const geo::CameraIntrinsics& camera, DepthSensor sensor, double baseline_m) {
  const auto focal = static_cast<float>(camera.fx);
  if (sensor == DepthSensor::kKinect) {
    return {focal, 0.075F, 0.06F, 0.125F, 0.5F, 10, 0.06F};
  }
  if (sensor == DepthSensor::kRough) return {focal, 0.075F, 0.08F, 0.125F, 0.4F, 40, 10};
  return {focal, static_cast<float>(baseline_m), 0.12F, 0, 0.8F, 80, 0.25F};
}

/// The sum of three uniform numbers, standard deviation 1.
float SensorNoise(int row, int column, std::uint32_t seed) {
  std::uint32_t bits = HashLattice(column, row, seed);
  float sum = 0;
  for (int i = 0; i < 3; ++i) {
    bits = HashBits(bits + 0x9e3779b9U);
    sum += UnitFloat(bits);
  }
  return (sum - 1.5F) * 2;
}

bool IsDepthAtEdge(const cv::Mat& depth, int row, int column, float share) {
  const float here = depth.at<float>(row, column);
  for (const int step : {-1, 1}) {
    const int beside = std::min(std::max(column + step, 0), depth.cols - 1);
    const float there = depth.at<float>(row, beside);
    if (there <= 0 || std::abs(there - here) > share * here) return true;
  }
  return false;
}

/// For each column of the other camera the nearest surface's disparity.
std::vector<float> DepthOfOtherEye(const cv::Mat& depth, int row, const Model& model) {
  std::vector<float> seen(static_cast<std::size_t>(depth.cols), 0.0F);
  for (int column = 0; column < depth.cols; ++column) {
    const float metres = depth.at<float>(row, column);
    if (metres <= 0) continue;
    const float disparity = model.focal_px * model.baseline_m / metres;
    const auto other = static_cast<int>(std::lround(static_cast<float>(column) - disparity));
    if (other < 0 || other >= depth.cols) continue;
    float& nearest = seen[static_cast<std::size_t>(other)];
    nearest = std::max(nearest, disparity);
  }
  return seen;
}

/// Depths of the neighbourhood carried over edges, and patches of nothing.
cv::Mat RoughenDepth(const cv::Mat& depth, std::uint32_t seed) {
  constexpr int kBleedPx = 3;
  constexpr float kPatchPx = 14, kHole = 0.62F;
  cv::Mat rough(depth.size(), CV_32FC1);
  for (int row = 0; row < depth.rows; ++row) {
    for (int column = 0; column < depth.cols; ++column) {
      const auto x = static_cast<float>(column), y = static_cast<float>(row);
      const float shift = kBleedPx * Noise(x / kPatchPx, y / kPatchPx, seed);
      const auto from = static_cast<int>(std::lround(x + shift));
      const bool hole = Noise(x / kPatchPx + 500, y / kPatchPx, seed + 1) > kHole;
      rough.at<float>(row, column) =
          hole ? 0 : depth.at<float>(row, std::clamp(from, 0, depth.cols - 1));
    }
  }
  return rough;
}

}  // namespace

std::optional<DepthSensor> ParseDepthSensor(const std::string& name) {
  if (name == "exact") return DepthSensor::kExact;
  if (name == "kinect") return DepthSensor::kKinect;
  if (name == "stereo") return DepthSensor::kStereo;
  if (name == "rough") return DepthSensor::kRough;
  return std::nullopt;
}

cv::Mat SenseDepth(const cv::Mat& exact, const geo::CameraIntrinsics& camera, DepthSensor sensor,
                   double baseline_m, std::uint32_t seed) {
  if (sensor == DepthSensor::kExact) return exact;
  const cv::Mat depth = sensor == DepthSensor::kRough ? RoughenDepth(exact, seed) : exact;
  const Model model = SensorModelOf(camera, sensor, baseline_m);
  cv::Mat sensed(depth.size(), CV_32FC1, cv::Scalar(0));
  for (int row = 0; row < depth.rows; ++row) {
    const std::vector<float> other = DepthOfOtherEye(depth, row, model);
    for (int column = 0; column < depth.cols; ++column) {
      const float metres = depth.at<float>(row, column);
      if (metres < model.nearest_m || metres > model.farthest_m) continue;
      if (IsDepthAtEdge(depth, row, column, model.edge)) continue;
      float disparity = model.focal_px * model.baseline_m / metres;
      const auto there = static_cast<int>(std::lround(static_cast<float>(column) - disparity));
      if (there < 0 || there >= depth.cols) continue;
      if (other[static_cast<std::size_t>(there)] > disparity + 1.5F) continue;
      disparity += model.sigma_px * SensorNoise(row, column, seed);
      if (model.step_px > 0) disparity = std::round(disparity / model.step_px) * model.step_px;
      if (disparity <= 0) continue;
      sensed.at<float>(row, column) = model.focal_px * model.baseline_m / disparity;
    }
  }
  return sensed;
}

}  // namespace livemap::simulation
