#pragma once

#include <cstdint>
#include <deque>
#include <opencv2/core.hpp>
#include <optional>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/image_pyramid.h"
#include "odometry/mounting/mounting_estimator.h"
#include "odometry/mounting/road_plane.h"

namespace livemap::odometry {

/// One image and where odometry says it was taken.
struct CalibrationFrame {
  std::int64_t stamp_ns = 0;
  cv::Mat grey;                                                         ///< CV_8UC1, rectified.
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();  ///< Optical frame, metres.
  cv::Mat depth_m{};      ///< CV_32FC1, m, 0 unknown; empty: the road is measured by two images.
  bool tracking = false;  ///< Else the pose says nothing: what came before is left alone.
  /// Of the poses' metres, a share of them; infinite where they come from the camera's height,
  /// which then cannot be told.
  double metres_sigma = 0;
};

/// Feeds a MountingEstimator from the images of a driving vehicle and any odometry's poses: the
/// direction of travel from every half metre that is nearly straight, and the road's plane from
/// every metre. Not thread-safe; deterministic.
class MountingCalibrator {
 public:
  struct Config {
    MountingEstimator::Config estimator;
    RoadPlaneSearch::Config road;
    /// The mounting as it was said to be: where the camera lies in base_link, which is not
    /// estimated (m ahead and left of it), and what stands for what is not known yet.
    double forward_m = 1.5;
    double left_m = 0;
    Mounting assumed{0, 0, 0, 1.5};
    double travel_step_m = 0.5;
    /// Steps with more curvature than this say nothing, rad/m.
    double max_curvature = 0.02;
    /// Between the two images that tell the road's plane,
    double road_step_m = 1.0;
    /// and between two such measurements.
    double road_every_m = 1.0;
    /// So many planes in a row that were not found, and the plane is searched widely.
    int max_failures = 5;
  };

  /// Throws Error naming what is wrong with the configuration.
  MountingCalibrator(const Config& config, const geo::CameraIntrinsics& camera);

  /// The next frame; grey must have the camera's size.
  void Add(const CalibrationFrame& frame);

  /// None before the vehicle has driven far enough.
  std::optional<MountingEstimate> Estimate() const { return estimator_.Estimate(config_.assumed); }
  std::optional<MountingKnock> TakeKnock() { return estimator_.TakeKnock(); }

  struct Figures {
    std::size_t travel_steps = 0;    ///< That counted.
    std::size_t curved_steps = 0;    ///< That did not.
    std::size_t planes = 0;          ///< That were measured.
    std::size_t planes_refused = 0;  ///< Without texture, or where nothing looked like a plane.
    std::size_t searches = 0;        ///< Of them wide ones.
  };
  const Figures& figures() const { return figures_; }

 private:
  struct Kept {
    ImagePyramid images;
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  };

  void AddTravel(const Eigen::Isometry3d& world_from_camera);
  void MeasureRoad(const Kept& now, const CalibrationFrame& frame);
  std::optional<Mounting> Guess() const;

  Config config_;
  geo::CameraIntrinsics camera_;
  RoadPlaneSearch road_;
  MountingEstimator estimator_;
  std::optional<Eigen::Isometry3d> travel_from_;
  std::deque<Kept> kept_;  ///< The last road_step_m and a little more, newest last.
  std::optional<Eigen::Isometry3d> road_at_;
  std::optional<Mounting> road_guess_;  ///< The last plane's roll, pitch and height.
  int failures_ = 0;
  Figures figures_;
};

}  // namespace livemap::odometry
