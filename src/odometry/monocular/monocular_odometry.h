#pragma once

#include <cstdint>
#include <deque>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "odometry/edge/edge_odometry.h"
#include "odometry/monocular/inverse_depth_map.h"
#include "odometry/monocular/metric_scale.h"
#include "odometry/monocular/two_view_start.h"

namespace livemap::odometry {

/// One image of a single camera, with what is known in metres.
struct MonocularFrame {
  std::int64_t stamp_ns = 0;
  cv::Mat grey;  ///< CV_8UC1, rectified.
  /// Speed over ground, m/s, for instance of the satellite receiver.
  std::optional<double> speed_mps;
};

/// What tells metres from the units of a monocular map.
enum class ScaleSource {
  kSpeed,         ///< MonocularFrame::speed_mps
  kCameraHeight,  ///< The camera's height over the road.
};
/// "speed", "height"; Error names what is accepted.
ScaleSource ParseScaleSource(const std::string& name);

/// Edge-direct visual odometry with one camera: EdgeOdometry over an inverse-depth map on the edges
/// that it builds by itself (thesis, section 5.2.1), and a metric scale. Not thread-safe.
class MonocularOdometry {
 public:
  struct Config {
    EdgeOdometry::Config odometry;
    InverseDepthMap::Config depth;
    TwoViewStart::Config start;
    MetricScale::Config scale;
    ScaleSource scale_source = ScaleSource::kSpeed;
    double speed_sigma_mps = 0.2;  ///< Standard deviation of MonocularFrame::speed_mps.
    double min_speed_mps = 1.0;    ///< Slower than that, a speed says nothing about the scale.
    double camera_height_m = 1.6;  ///< Of kCameraHeight: over the road.
    double camera_pitch_rad = 0;   ///< Of kCameraHeight: positive looks down.
    /// Keyframes that a new one's depths are measured against.
    int views_kept = 4;
    /// Without a motion at the start, and lost: the two-view start begins anew after this, s.
    double give_up_s = 1.0;
    Config();
  };

  /// Throws Error naming what is wrong with the intrinsics or the configuration.
  MonocularOdometry(const Config& config, const geo::CameraIntrinsics& intrinsics);

  /// Works off the next frame: poses in metres. Initialising, with a pose that says nothing, until
  /// the camera has moved far enough to see depth. Throws as EdgeOdometry::Track().
  VoResult Track(const MonocularFrame& frame);

  void Reset();

  /// Of the frame that the last two-view start began with. With the first pose: of the frame that
  /// stands at the origin, which the first frame need not be.
  std::int64_t start_stamp_ns() const { return start_stamp_ns_; }
  const InverseDepthMap& depths() const { return map_; }
  double metres_per_unit() const { return scale_.metres_per_unit(); }

 private:
  /// An earlier keyframe, in units of the map.
  struct View {
    cv::Mat grey;
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  };

  VoResult Start(const MonocularFrame& frame);
  VoResult Continue(const MonocularFrame& frame);
  void BeginStart(const MonocularFrame& frame);
  void LearnDepths(const Eigen::Isometry3d& world_from_camera);
  void AddWay(const MonocularFrame& frame);
  void MeasureScale(const Eigen::Isometry3d& world_from_camera);
  VoResult InMetres(const VoResult& unscaled);

  Config config_;
  geo::CameraIntrinsics camera_;
  EdgeOdometry odometry_;
  EdgeExtractor extractor_;
  InverseDepthMap map_;
  TwoViewStart start_;
  MetricScale scale_;

  std::deque<View> views_;  // Newest last: the present keyframe.
  ImagePyramid start_images_;
  bool started_ = false;
  double way_m_ = 0;      // By the speed, since the last measurement of the scale.
  double way_s_ = 0;      // Duration of it.
  double way_units_ = 0;  // By visual odometry, since then.
  std::int64_t start_stamp_ns_ = 0;
  std::int64_t lost_since_ns_ = 0;
  std::optional<MonocularFrame> last_frame_;
  Eigen::Isometry3d start_pose_ = Eigen::Isometry3d::Identity();
  Matrix6d start_covariance_ = Matrix6d::Zero();
  Eigen::Isometry3d last_unscaled_ = Eigen::Isometry3d::Identity();
  VoResult last_;
};

}  // namespace livemap::odometry
