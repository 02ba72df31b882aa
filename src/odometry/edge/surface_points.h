#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/image_pyramid.h"
#include "odometry/edge/rgbd_frame.h"

namespace livemap::odometry {

/// What a frame's depth image measures; its camera and the range in which it is believed.
struct MeasuredDepth {
  const RgbdFrame* frame = nullptr;
  const geo::CameraIntrinsics* camera = nullptr;
  DepthPyramid::Range range;
};

/// Distances from points of surfaces to what a frame measures there. Their unit is what depth
/// cameras err by at a point: 1.5 % of its depth, and 0.4 % more for each metre of it.
class SurfaceDistances {
 public:
  static constexpr std::size_t kMost = 1200;

  void Clear() { size_ = measured_ = 0; }
  /// NaN: nothing is measured there.
  void Add(float distance);
  /// Of all points that were asked for.
  std::size_t size() const { return size_; }
  float operator[](std::size_t i) const { return values_[i]; }
  std::size_t measured() const { return measured_; }
  /// Robust standard deviation, by the median; infinite where nothing is measured.
  double Sigma() const;
  /// Of those that are measured; 0 where nothing is.
  double ShareWithin(double bound) const;

 private:
  std::array<float, kMost> values_;
  std::size_t size_ = 0, measured_ = 0;
};

/// Points of a keyframe's surfaces, spread over its image whether or not there are edges: where a
/// motion is true, a later frame measures the same surfaces.
///
/// A point has the direction in which its surface faces, so that a distance is one to the surface
/// (Chen and Medioni 1992): along it a pixel beside the right one says the same.
class SurfacePoints {
 public:
  using Row = Eigen::Matrix<float, 6, 1>;

  /// Memory for SurfaceDistances::kMost points, which is the most that are taken.
  void Reserve() { points_.reserve(SurfaceDistances::kMost); }
  void Clear() { points_.clear(); }
  std::size_t size() const { return points_.size(); }

  /// Takes points of a depth image (CV_32FC1, m, 0 unknown) of this camera, evenly spread, where
  /// the surface is even.
  void Take(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera);

  /// The distance from each `every`-th point (1: from all) to what the frame measures there, nearer
  /// to the keyframe's camera positive. None at all when too few points meet a measurement to say
  /// anything: the frame has no depth, or looks elsewhere.
  void Measure(const MeasuredDepth& depth, const Eigen::Isometry3d& new_from_reference,
               std::size_t every, SurfaceDistances& distances) const;

  /// Derivative of a point's distance by the twist delta of new_from_reference * Exp(-delta).
  const Row& Jacobian(std::size_t point) const { return points_[point].row; }

  /// The share of the points in view of the frame that lie on what it measures there, within
  /// `bound` in the unit of SurfaceDistances; none where too little is measured.
  std::optional<double> Agreement(const MeasuredDepth& depth,
                                  const Eigen::Isometry3d& new_from_reference, double bound) const;

  /// The motion near `start` for which the frame's surfaces lie on these; what no surface shows (a
  /// slide along a wall) stays as it was. None where too little is measured.
  std::optional<Eigen::Isometry3d> NewFromReference(const MeasuredDepth& depth,
                                                    const Eigen::Isometry3d& start) const;

 private:
  struct SurfacePoint {
    Eigen::Vector3f place;  // In the keyframe's optical frame, m.
    Row row;  // The direction that the surface faces, and place x that, by what cameras err by.
  };

  std::vector<SurfacePoint> points_;
};

/// The surfaces of a keyframe, which take part in an alignment with a frame that measures depth.
struct SurfaceConstraint {
  const SurfacePoints* points = nullptr;  ///< None: edges alone.
  MeasuredDepth depth;

  /// See SurfacePoints; none without points.
  std::optional<double> Agreement(const Eigen::Isometry3d& new_from_reference, double bound) const;
};

/// Of the points every so many take part in an alignment, on the finest level and on others.
inline constexpr std::size_t SurfacesEvery(bool is_finest) { return is_finest ? 2 : 4; }

/// How near surfaces must lie to agree where the best of some motions leaves distances of this
/// sigma: this depth camera may err by less than others.
double SurfaceBound(double least_sigma);

/// Distances beyond this are those to another surface.
inline constexpr float kOtherSurface = 3;

}  // namespace livemap::odometry
