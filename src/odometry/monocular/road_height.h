#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "odometry/monocular/inverse_depth_map.h"
#include "odometry/mounting/road_plane.h"

namespace livemap::odometry {

/// The camera's height over the road, in the unit of the depths: that of the plane, near the one
/// that a level car's wheels stand on, which most edges ahead lie on. `pitch_rad`: the camera's,
/// positive looks down. None when too few edges lie on one plane.
std::optional<double> RoadHeightOfEdges(const std::vector<EdgeDepth>& edges,
                                        const geo::CameraIntrinsics& camera, double pitch_rad);

/// A camera's height over the road in units of a map.
struct RoadHeight {
  double units = 0;
  double relative_sigma = 0;  ///< Standard deviation of this one, a share of it.
};

/// A smooth grey image, CV_8UC1, and where it was taken, in units of a map.
struct PosedImage {
  cv::Mat smooth;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
};

/// Measures the camera's height over the road by the grey values of the lane ahead in two images:
/// asphalt has hardly an edge, but enough texture for a plane. Where that has not been found yet,
/// by edges. Keeps its buffers; not thread-safe.
class RoadHeightMeter {
 public:
  struct Config {
    RoadPlaneSearch::Config plane;
    /// About how high the camera is, m: which part of the image is the lane.
    double camera_height_m = 1.6;
    /// For the edges, positive looks down; none: that at which it sees the direction of travel, by
    /// which the lane's plane is found in any case.
    std::optional<double> camera_pitch_rad{};
    /// So many planes in a row that were not found, and the plane is searched widely; twice as
    /// many, and anew from the edges.
    int max_failures = 5;
  };

  RoadHeightMeter(const Config& config, const geo::CameraIntrinsics& camera);

  /// Forgets the road: the unit is another one.
  void Reset();

  /// The height from `now`, a keyframe with these edges, and an image from before. None when the
  /// camera has not moved ahead by about its height in between, or no road is seen.
  std::optional<RoadHeight> Measure(const PosedImage& now, const PosedImage& before,
                                    const std::vector<EdgeDepth>& edges);

 private:
  std::optional<RoadPlane> FindPlane(const RoadView& view, const Eigen::Vector3d& forward);

  Config config_;
  geo::CameraIntrinsics camera_;
  RoadPlaneSearch near_, wide_;
  std::optional<double> units_;  ///< The last plane's distance.
  double roll_rad_ = 0;
  int failures_ = 0;
  ImagePyramid now_, before_;
};

}  // namespace livemap::odometry
