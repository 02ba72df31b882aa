#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/image_pyramid.h"
#include "odometry/mounting/mounting.h"

namespace livemap::odometry {

/// The road's plane in a camera's optical frame.
struct RoadPlane {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();  ///< Its normal away from the camera, length 1.
  double distance = 0;                              ///< From the camera, in the unit of the poses.
};

/// The part of the road that is measured: the vehicle's own lane, because the road's crown tilts
/// the other one.
struct RoadPatch {
  double nearest_m = 3.0;  ///< Ahead of the camera.
  double farthest_m = 14.0;
  double half_width_m = 1.7;
};

/// Two images of one moving camera and the motion between them.
struct RoadView {
  const ImagePyramid& first;
  const ImagePyramid& second;
  Eigen::Isometry3d second_from_first;
};

/// Finds the plane on which the road of the first image must lie to look as it does in the second:
/// the plane's three numbers, gain and bias of the light by robust Gauss-Newton over the grey
/// values of the patch (a plane moves an image by R + t n^T / d).
class RoadPlaneSearch {
 public:
  struct Config {
    RoadPatch patch;
    int max_points = 4000;
    /// Least gradient of a point, grey levels per pixel.
    float min_gradient = 1.5F;
    std::size_t min_points = 150;
    /// At least this share of the points must be explained, as EdgeOdometry's are.
    double min_agreement = 0.6;
    /// Nor may a result lie further from where it began: tilt, and height as a share of it.
    double max_tilt_rad = 0.05;
    double max_height_change = 0.2;
    /// Of the wide search, around its guess.
    double search_pitch_rad = 0.026;
    double search_roll_rad = 0.06;
    double lowest_m = 0.6;
    double highest_m = 3.2;
  };

  RoadPlaneSearch(const Config& config, const geo::CameraIntrinsics& camera);

  /// The plane near a known one. None when the road has too little texture, or does not look like
  /// a plane.
  std::optional<RoadPlane> Refine(const RoadView& view, const Mounting& guess) const;

  /// As Refine, but only yaw and pitch of the guess are nearly known.
  std::optional<RoadPlane> Search(const RoadView& view, const Mounting& guess) const;

 private:
  struct Point;
  struct Fit;
  std::vector<Point> PointsOf(const ImagePyramid& image, int level, const Mounting& guess,
                              int max_points) const;
  double Cost(const std::vector<Point>& points, const RoadView& view, int level,
              const Eigen::Vector3d& plane) const;
  std::optional<Fit> Align(const RoadView& view, int level, const std::vector<Point>& points,
                           const Eigen::Vector3d& start) const;
  geo::CameraIntrinsics CameraOf(int level) const;

  Config config_;
  geo::CameraIntrinsics camera_;
};

/// The plane of a depth image (CV_32FC1, m, 0 unknown), of which yaw and pitch are nearly known:
/// that on which most of the patch's depths lie. None when too few do.
std::optional<RoadPlane> FitRoadPlane(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera,
                                      const RoadPatch& patch, const Mounting& guess);

}  // namespace livemap::odometry
