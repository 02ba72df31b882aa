#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "odometry/edge/edge_odometry.h"
#include "odometry/monocular/depth_learner.h"
#include "odometry/monocular/fix_baseline.h"
#include "odometry/monocular/keyframe_worker.h"
#include "odometry/monocular/metric_scale.h"
#include "odometry/monocular/travel_direction.h"
#include "odometry/monocular/two_view_start.h"
#include "odometry/monocular/vehicle_speed.h"

namespace livemap::odometry {

/// One image of a single camera, with what is known in metres.
struct MonocularFrame {
  std::int64_t stamp_ns = 0;
  cv::Mat grey;  ///< CV_8UC1, rectified.
  /// Speed over ground, m/s, for instance of the satellite receiver.
  std::optional<double> speed_mps;
  /// Standard deviation of it, m/s; none: Config::speed_sigma_mps.
  std::optional<double> speed_sigma_mps;
  /// Whose speed it is. That of fixes serves the start alone: AddFix measures better.
  MetresSource speed_source = MetresSource::kReceiver;
};

/// What tells metres from the units of a monocular map.
enum class ScaleSource {
  kSpeed,         ///< MonocularFrame::speed_mps
  kCameraHeight,  ///< The camera's height over the road.
  /// The best of what there is: MonocularFrame::speed_mps, then AddFix(), then the camera's height.
  /// Until one of them has told, the pose is held.
  kBest,
};
/// "speed", "height"; Error names what is accepted.
ScaleSource ParseScaleSource(const std::string& name);

/// Edge-direct visual odometry with one camera: EdgeOdometry over an inverse-depth map on the edges
/// that it builds by itself (thesis, section 5.2.1), and a metric scale. Not thread-safe: its
/// thread for keyframes is its own affair.
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
    /// Of kCameraHeight: positive looks down; none: as it sees the direction of travel.
    std::optional<double> camera_pitch_rad{};
    /// A source of metres counts for so long after it has told, s; fixes, which tell more rarely,
    /// for FixBaseline::Config::longest_s more.
    double source_age_s = 5.0;
    FixBaseline::Config fixes;
    /// Of kBest, which is a car's: a path that slides is given up, and the start begins anew.
    TravelDirection::Config travel;
    /// Keyframes that a new one's depths are measured against.
    int views_kept = 4;
    /// The depths of a keyframe, which take longer than many frames, are learnt beside the frames,
    /// on a thread, and taken over when they are ready. False: within the frame's time.
    bool background = false;
    /// Without a thread, but handed over so many frames later: a run that can be repeated; 0: at
    /// once.
    int keyframe_delay = 0;
    /// A keyframe that is not ready after this time is waited for, s: frames that go on by the one
    /// before see too little of it, and their path runs away.
    double longest_keyframe_s = 0.35;
    /// But no frame waits longer than this, s of the steady clock: it goes on by the keyframe
    /// before, and the next frame waits again. Less than the time between two frames of a slow
    /// camera: on a busy machine the frames do not fall behind.
    double longest_wait_s = 0.08;
    /// Without a motion at the start, and lost: the two-view start begins anew after this, s.
    double give_up_s = 1.0;
    Config();
  };

  /// Throws Error naming what is wrong with the intrinsics or the configuration.
  MonocularOdometry(const Config& config, const geo::CameraIntrinsics& intrinsics);

  /// Works off the next frame: poses in metres. Initialising, with a pose that says nothing, until
  /// the camera has moved far enough to see depth. The frames after a start by a short way verify
  /// it; where it is made anew, the pose corrects those since then. Throws as
  /// EdgeOdometry::Track().
  VoResult Track(const MonocularFrame& frame);

  /// A fix of kBest; it may come before the frame of its moment or after it.
  void AddFix(const geo::Fix& fix) { fixes_.AddFix(fix); }

  void Reset();

  /// Of the frame that the last two-view start began with. With the first pose: of the frame that
  /// stands at the origin, which the first frame need not be.
  std::int64_t start_stamp_ns() const { return start_stamp_ns_; }
  /// Not while a keyframe is made in the background.
  const InverseDepthMap& depths() const { return learner_.map(); }
  /// The keyframe that the last frame was aligned with, in units of the map; none before the first.
  const Keyframe* keyframe() const { return started_ ? odometry_.keyframe() : nullptr; }
  /// From that keyframe to the last frame's camera, in units of the map.
  Eigen::Isometry3d CameraFromKeyframe() const {
    return last_unscaled_.inverse() * odometry_.keyframe()->world_from_camera;
  }
  double metres_per_unit() const { return scale_.metres_per_unit(); }
  /// Standard deviation of the metres, a share of them; none while they are not known.
  std::optional<double> metres_sigma() const;
  /// What has told the metres lately; kNone: nothing has, and they are held as they were.
  MetresSource metres_source() const { return source_; }

 private:
  /// A distance by the speed.
  struct Way {
    double m = 0, s = 0;
    double sigma_m = 0;    ///< Standard deviation of it.
    bool has_gap = false;  ///< A frame since it began came without a speed.
    void Add(const MonocularFrame& from, const MonocularFrame& to, double default_sigma_mps);
    void FillGap(double elapsed_s);
  };

  VoResult Start(const MonocularFrame& frame);
  VoResult Continue(const MonocularFrame& frame);
  VoResult Held(const MonocularFrame& frame) const;
  void BeginStart(const MonocularFrame& frame);
  bool MakeFirstKeyframe(const Eigen::Isometry3d& first_from_new,
                         const std::optional<Vector6d>& twist);
  bool MakeKeyframe(const MonocularFrame& frame, VoResult& unscaled);
  bool TakeKeyframe();
  void OnLearnt(const LearntDepths& learnt);
  void Remember(const Eigen::Isometry3d& world_from_camera);
  void AddWay(const MonocularFrame& frame);
  void ForgetWay();
  std::optional<double> WayOfStart(const MonocularFrame& frame);
  std::optional<VoResult> CheckStart(const MonocularFrame& frame, const VoResult& unscaled);
  std::optional<VoResult> RemakeStart(const MonocularFrame& frame, const VoResult& unscaled);
  VoResult GiveUp(const MonocularFrame& frame);
  void MeasureScale(const Eigen::Isometry3d& world_from_camera);
  void MeasureByFixes(std::int64_t stamp_ns, const Eigen::Isometry3d& step);
  void MeasureByHeight(const RoadHeight& height);
  void TeachHeight(double log_metres_error, double variance);
  void HasTold(MetresSource source, double shared_sigma);
  void ForgetOldSource();
  bool KnowsMetres() const;
  bool Slides(const Eigen::Isometry3d& step);
  VoResult InMetres(const MonocularFrame& frame, const VoResult& unscaled);
  VoResult WithoutMetres(const MonocularFrame& frame, const VoResult& unscaled);

  Config config_;
  geo::CameraIntrinsics camera_;
  EdgeOdometry odometry_;
  DepthLearner learner_;
  TwoViewStart start_;
  MetricScale scale_;
  FixBaseline fixes_;
  TravelDirection travel_;

  ImagePyramid start_images_;
  bool started_ = false;
  bool lost_ = false;
  Way way_;                 // Since the last measurement of the scale.
  double way_units_ = 0;    // By visual odometry, since then.
  Way start_way_;           // Since the start's first frame.
  double start_units_ = 0;  // By visual odometry, since then.
  // Of the start's first frame: in the map, and on the path where metres were known.
  Eigen::Isometry3d map_from_first_ = Eigen::Isometry3d::Identity();
  std::optional<Eigen::Isometry3d> world_from_first_;
  // Of the frame that the start was last checked by, in units of the start's motion.
  Eigen::Isometry3d checked_from_first_ = Eigen::Isometry3d::Identity();
  MetresSource source_ = MetresSource::kNone;
  std::int64_t now_ns_ = 0;           // Of the present frame.
  std::int64_t told_ns_ = 0;          // Of the last frame for which source_ told metres.
  double shared_sigma_ = 0;           // Of source_: what no mean of it lessens, a share.
  std::optional<double> log_height_;  // Of the camera, as a better source has it, log m.
  Eigen::Isometry3d path_ = Eigen::Isometry3d::Identity();  // For fixes_; metres once known.
  double height_variance_ = 0;                              // Of log_height_ by fixes.
  std::int64_t height_told_ns_ = 0;  // Of the last frame whose road told metres.
  std::int64_t ordered_ns_ = 0;      // Of the keyframe in work.
  std::int64_t start_stamp_ns_ = 0;
  std::int64_t first_stamp_ns_ = 0;  // Of the start's first frame.
  std::int64_t lost_since_ns_ = 0;
  std::optional<MonocularFrame> last_frame_;
  std::deque<PosedImage> recent_;  // Of the last step of the road's, in units of the map.
  Eigen::Isometry3d start_pose_ = Eigen::Isometry3d::Identity();
  Matrix6d start_covariance_ = Matrix6d::Zero();
  Eigen::Isometry3d last_unscaled_ = Eigen::Isometry3d::Identity();
  VoResult last_;
  std::unique_ptr<KeyframeWorker> worker_;  // None: keyframes are made within the frame's time.
};

}  // namespace livemap::odometry
