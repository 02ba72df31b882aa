#include "odometry/edge/picture_points.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>

#include "common/median.h"
#include "odometry/bilinear.h"

namespace livemap::odometry {
namespace {

/// Fewer than this in view, if all points are asked for, say nothing.
constexpr std::size_t kLeastInView = 60;
/// Grey levels at which a difference has half of its weight in the fit of the light.
constexpr double kLightNoise = 4;
constexpr int kLightSteps = 3;
/// Of PictureBound: a picture's own rounding at least, any camera's noise at most.
constexpr double kGreyNoiseSigmas = 2;
constexpr double kLeastGreyNoise = 1, kMostGreyNoise = 8;
/// Light that changed by more than this factor is no light of this camera.
constexpr double kMostGain = 3;
/// What holds the light where the points say nothing of it: so much of a point's weight, and for
/// the gain as much at a hundred grey levels, so that of one shade the bias changes.
constexpr double kLightPrior = 0.05;
constexpr double kPriorGrey = 100;

/// What is compared at the points.
struct Greys {
  std::array<float, PicturePoints::kMost> before, now;  // By the keyframe, by the frame.
  std::array<float, PicturePoints::kMost> right, down;  // Where in the frame, -1 to 1.
  std::size_t count = 0;
};

/// What brings the values before to those now: gain, bias, and how the bias grows to the right and
/// down, since light falls off across a picture.
using Light = Eigen::Vector4d;

Eigen::Vector4d LightRow(const Greys& greys, std::size_t i) {
  return {static_cast<double>(greys.before[i]), 1, static_cast<double>(greys.right[i]),
          static_cast<double>(greys.down[i])};
}

double DifferenceAt(const Greys& greys, const Light& light, std::size_t i) {
  return static_cast<double>(greys.now[i]) - light.dot(LightRow(greys, i));
}

double MedianChange(const Greys& greys) {
  std::array<float, PicturePoints::kMost> changes{};
  for (std::size_t i = 0; i < greys.count; ++i) changes[i] = greys.now[i] - greys.before[i];
  float* const middle = changes.data() + greys.count / 2;
  std::nth_element(changes.data(), middle, changes.data() + greys.count);
  return static_cast<double>(*middle);
}

/// With Cauchy weights.
Light FitLight(const Greys& greys) {
  Light light(1, MedianChange(greys), 0, 0);
  for (int step = 0; step < kLightSteps; ++step) {
    Eigen::Matrix4d normal = kLightPrior * Eigen::Matrix4d::Identity();
    normal(0, 0) *= kPriorGrey * kPriorGrey;
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < greys.count; ++i) {
      const Eigen::Vector4d row = LightRow(greys, i);
      const double difference = static_cast<double>(greys.now[i]) - light.dot(row);
      const double ratio = difference / kLightNoise;
      const double weight = 1 / (1 + ratio * ratio);
      normal += weight * row * row.transpose();
      right += weight * difference * row;
    }
    light += normal.ldlt().solve(right);
    light[0] = std::clamp(light[0], 1 / kMostGain, kMostGain);
  }
  return light;
}

/// Of the pixels of a cell with a known depth the one whose neighbours differ least, so that the
/// motion's own error changes nothing there; any where none has a depth.
cv::Point FlattestPixel(const cv::Mat& grey, const cv::Mat& depth_m, const cv::Rect& cell) {
  cv::Point flattest = cell.tl();
  int least = std::numeric_limits<int>::max();
  for (int y = cell.y; y < cell.y + cell.height; ++y) {
    const std::uint8_t* const above = grey.ptr(y - 1);
    const std::uint8_t* const here = grey.ptr(y);
    const std::uint8_t* const below = grey.ptr(y + 1);
    const float* const depth = depth_m.ptr<float>(y);
    for (int x = cell.x; x < cell.x + cell.width; ++x) {
      const int slope = std::abs(here[x + 1] - here[x - 1]) + std::abs(below[x] - above[x]);
      if (slope >= least || !(depth[x] > 0)) continue;
      least = slope;
      flattest = {x, y};
    }
  }
  return flattest;
}

}  // namespace

double PictureBound(double least_sigma) {
  return std::clamp(kGreyNoiseSigmas * least_sigma, kLeastGreyNoise, kMostGreyNoise);
}

double PicturePoints::Differences::Sigma() const {
  if (count == 0) return std::numeric_limits<double>::infinity();
  std::array<float, kMost> magnitudes{};
  for (std::size_t i = 0; i < count; ++i) magnitudes[i] = std::abs(value[i]);
  float* const middle = magnitudes.data() + count / 2;
  std::nth_element(magnitudes.data(), middle, magnitudes.data() + count);
  return kMedianToSigma * static_cast<double>(*middle);
}

double PicturePoints::Differences::ShareWithin(double bound) const {
  if (count == 0) return 0;
  const auto within =
      std::count_if(value.begin(), value.begin() + static_cast<std::ptrdiff_t>(count),
                    [bound](float each) { return std::abs(each) < bound; });
  return static_cast<double>(within) / static_cast<double>(count);
}

void PicturePoints::Take(const cv::Mat& grey, const cv::Mat& depth_m,
                         const geo::CameraIntrinsics& camera) {
  points_.clear();
  const int step = std::max(
      2, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(grey.total()) / kMost))));
  for (int top = 1; top + step < grey.rows; top += step) {
    for (int left = 1; left + step < grey.cols && points_.size() < kMost; left += step) {
      const cv::Point flattest = FlattestPixel(grey, depth_m, cv::Rect(left, top, step, step));
      const float depth = depth_m.at<float>(flattest);
      if (!(depth > 0)) continue;
      PicturePoint point;
      point.place =
          depth * Eigen::Vector3f(static_cast<float>((flattest.x - camera.cx) / camera.fx),
                                  static_cast<float>((flattest.y - camera.cy) / camera.fy), 1);
      point.grey = static_cast<float>(grey.at<std::uint8_t>(flattest));
      points_.push_back(point);
    }
  }
}

void PicturePoints::Compare(const cv::Mat& grey, const geo::CameraIntrinsics& camera,
                            const Eigen::Isometry3d& new_from_reference, std::size_t every,
                            Differences& differences) const {
  differences.count = 0;
  const Eigen::Isometry3f motion(new_from_reference.cast<float>());
  const auto fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  const auto right = static_cast<float>(grey.cols - 1), lower = static_cast<float>(grey.rows - 1);
  Greys greys;
  for (std::size_t i = 0; i < points_.size(); i += every) {
    const Eigen::Vector3f place = motion * points_[i].place;
    if (!(place.z() > 0)) continue;
    const float u = fx * place.x() / place.z() + cx, v = fy * place.y() / place.z() + cy;
    if (!(u >= 0 && u < right && v >= 0 && v < lower)) continue;
    greys.before[greys.count] = points_[i].grey;
    greys.right[greys.count] = 2 * u / right - 1;
    greys.down[greys.count] = 2 * v / lower - 1;
    greys.now[greys.count++] = Interpolate(grey, u, v);
  }
  if (greys.count * every < kLeastInView) return;
  const Light light = FitLight(greys);
  for (std::size_t i = 0; i < greys.count; ++i) {
    differences.value[i] = static_cast<float>(DifferenceAt(greys, light, i));
  }
  differences.count = greys.count;
}

}  // namespace livemap::odometry
