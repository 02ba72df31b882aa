#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/rgbd_frame.h"
#include "odometry/se3.h"

namespace livemap::odometry {

/// Points of a keyframe's surfaces, spread over its image whether or not there are edges: where a
/// motion is true, a later frame measures the same surfaces.
///
/// A point has the direction in which its surface faces, so that a distance is one to the surface
/// (Chen and Medioni 1992): along it a pixel beside the right one says the same.
class SurfacePoints {
 public:
  /// At most this many are kept.
  static constexpr std::size_t kMost = 1200;

  /// Distances as parts of what depth cameras err by: 1.5 % of the depth, and 0.4 % more for each
  /// metre of it. NaN: nothing is measured there.
  class Distances {
   public:
    void Clear() { count_ = 0; }
    void Add(float distance) { values_[count_++] = distance; }
    std::size_t size() const { return count_; }
    float operator[](std::size_t i) const { return values_[i]; }
    std::size_t CountMeasured() const;
    /// Robust standard deviation, by their median; infinite where nothing is measured.
    double Sigma() const;
    /// Of those that are measured.
    double ShareWithin(double bound) const;

   private:
    std::array<float, kMost> values_;
    std::size_t count_ = 0;
  };

  /// Memory for kMost points.
  void Reserve() { points_.reserve(kMost); }
  void Clear() { points_.clear(); }
  std::size_t size() const { return points_.size(); }

  /// Takes points of a depth image (CV_32FC1, m, 0 unknown) of this camera, evenly spread, where
  /// the surface is even.
  void Take(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera);

  /// The distance from each `every`-th point to what the frame measures there, nearer to the
  /// keyframe's camera positive; camera is the frame's.
  void Measure(const RgbdFrame& frame, const geo::CameraIntrinsics& camera,
               const Eigen::Isometry3d& new_from_reference, std::size_t every,
               Distances& distances) const;

  /// Derivative of a point's distance by the twist delta of new_from_reference * Exp(-delta).
  Eigen::Matrix<float, 6, 1> Jacobian(std::size_t point) const;

  /// The share of the points in view of `frame` that lie on what it measures there, within
  /// `bound` as a part of what depth cameras err by. None when too few points meet a measurement:
  /// the frame has no depth, or looks elsewhere.
  std::optional<double> Agreement(const RgbdFrame& frame, const geo::CameraIntrinsics& camera,
                                  const Eigen::Isometry3d& new_from_reference,
                                  double bound = 1) const;

  /// The motion near `start` for which the frame's surfaces lie on these; what no surface shows (a
  /// slide along a wall) stays as it was. None where nothing is measured.
  std::optional<Eigen::Isometry3d> NewFromReference(const RgbdFrame& frame,
                                                    const geo::CameraIntrinsics& camera,
                                                    const Eigen::Isometry3d& start) const;

 private:
  struct SurfacePoint {
    Eigen::Vector3f place;   // In the keyframe's optical frame, m.
    Eigen::Vector3f facing;  // Of length 1.
    float per_error;         // One by what depth cameras err by there, 1/m.
  };

  std::vector<SurfacePoint> points_;
};

/// The surfaces of a keyframe and the depth of a new frame, which take part in an alignment where
/// both are measured.
struct SurfaceConstraint {
  const SurfacePoints* points = nullptr;  ///< None: edges alone.
  const RgbdFrame* frame = nullptr;
  const geo::CameraIntrinsics* camera = nullptr;  ///< The frame's.

  /// See SurfacePoints; none without points.
  std::optional<double> Agreement(const Eigen::Isometry3d& new_from_reference, double bound) const;
  /// Robust standard deviation of the distances, see Distances; infinite where none is measured.
  double Sigma(const Eigen::Isometry3d& new_from_reference) const;
};

/// How near surfaces must lie to agree where the best of some motions has distances of this sigma:
/// this depth camera may err by less than others.
double SurfaceBound(double least_sigma);

/// Distances beyond this part of what depth cameras err by are those to another surface.
constexpr float kOtherSurface = 3;

}  // namespace livemap::odometry
