#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "odometry/edge/point_selector.h"

namespace livemap::odometry {

// The loops over all points of an alignment, in the widest vectors that the processor has. On every
// processor they give the same numbers: sums are taken in eight lanes wherever they run.

/// A motion of the points, the camera that sees them, and its light.
struct PointProjection {
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();
  Eigen::Vector3f translation = Eigen::Vector3f::Zero();  ///< m
  float fx = 0, fy = 0, cx = 0, cy = 0;                   ///< px
  float gain = 1;  ///< Grey value in the image = gain * the point's + bias.
  float bias = 0;
};

/// One value per point.
struct PointResiduals {
  std::vector<float> value;    ///< Times the point's factor; 0 where it is not visible.
  std::vector<float> visible;  ///< 1 or 0.
  std::size_t count = 0;       ///< Visible ones.
};

/// What an image (CV_8UC1) shows where the points fall, less what they let expect, times a factor
/// for each of them: equation (2) of docs/explanation/odometry.md. A point is visible where it lies
/// before the camera and between four pixels.
void EvaluateResiduals(const EdgePoints& points, const std::vector<float>& factor,
                       const cv::Mat& grey, const PointProjection& projection,
                       PointResiduals& residuals);

/// Unknowns of the normal equations: twist, gain, bias.
inline constexpr int kAlignmentUnknowns = 8;

/// Equation (7) of docs/explanation/odometry.md.
struct NormalSums {
  using Normal = Eigen::Matrix<double, kAlignmentUnknowns, kAlignmentUnknowns>;
  using Step = Eigen::Matrix<double, kAlignmentUnknowns, 1>;

  Normal normal = Normal::Zero();   ///< The lower triangle.
  Normal scatter = Normal::Zero();  ///< Sum over parts of the gradient's square.
  Step gradient = Step::Zero();
};

/// Sums over all points, weighted by Huber's rule with the limit `huber`, in residuals times
/// `factor`. A part of the scatter is `part_size` points that follow each other; a multiple of 8,
/// at most 256.
NormalSums SumNormalEquations(const EdgePoints& points, const std::vector<float>& factor,
                              const PointResiduals& residuals, float huber, std::size_t part_size);

}  // namespace livemap::odometry
