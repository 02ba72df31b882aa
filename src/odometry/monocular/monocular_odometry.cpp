#include "odometry/monocular/monocular_odometry.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/time.h"
#include "odometry/monocular/road_height.h"

namespace livemap::odometry {
namespace {

/// The shortest way that tells the scale: over less, errors of both sides do not average out, m.
constexpr double kScaleWayM = 1.0;
constexpr double kFastestMps = 200;
/// Of the camera's height: the load, the road's crown.
constexpr double kHeightSigmaM = 0.05;

/// A motion with its translation times `factor`.
Eigen::Isometry3d StretchedMonocularMotion(Eigen::Isometry3d motion, double factor) {
  motion.translation() *= factor;
  return motion;
}

}  // namespace

ScaleSource ParseScaleSource(const std::string& name) {
  if (name == "speed") return ScaleSource::kSpeed;
  if (name == "height") return ScaleSource::kCameraHeight;
  throw Error("the scale's source is '" + name + "'; accepted are speed, height");
}

MonocularOdometry::Config::Config() {
  // The map says itself what is far, and neighbours of different depths are no occlusion: most of
  // that is noise.
  odometry.depth_range = {0.01F, 10000.0F};
  odometry.points.occlusion_ratio = 2.0F;
}

MonocularOdometry::MonocularOdometry(const Config& config, const geo::CameraIntrinsics& intrinsics)
    : config_(config),
      camera_(intrinsics),
      odometry_(config.odometry, intrinsics),
      extractor_(config.odometry.edges),
      map_(config.depth, intrinsics),
      start_(config.start, intrinsics),
      scale_(config.scale) {
  if (config.views_kept < 1 || config.views_kept > 100) {
    throw Error("views_kept is " + std::to_string(config.views_kept) + "; 1 to 100 is accepted");
  }
}

void MonocularOdometry::Reset() {
  odometry_.Reset();
  start_ = TwoViewStart(config_.start, camera_);
  scale_.Reset();
  views_.clear();
  started_ = false;
  last_frame_.reset();
  last_ = {};
}

VoResult MonocularOdometry::Track(const MonocularFrame& frame) {
  odometry_.Check({frame.stamp_ns, frame.grey, {}, 1});
  // Written so that NaN is refused.
  if (frame.speed_mps && !(*frame.speed_mps >= 0 && *frame.speed_mps < kFastestMps)) {
    throw Error("a speed of " + std::to_string(*frame.speed_mps) + " m/s came with a frame; 0 to " +
                std::to_string(kFastestMps) + " is accepted");
  }
  AddWay(frame);
  last_ = started_ ? Continue(frame) : Start(frame);
  last_frame_ = frame;
  last_frame_->grey.release();
  return last_;
}

/// The way since the last frame, by the mean of the speeds at its ends.
void MonocularOdometry::AddWay(const MonocularFrame& frame) {
  if (!last_frame_ || !last_frame_->speed_mps || !frame.speed_mps) return;
  const double step_s = Seconds(frame.stamp_ns - last_frame_->stamp_ns);
  way_m_ += 0.5 * (*last_frame_->speed_mps + *frame.speed_mps) * step_s;
  way_s_ += step_s;
}

void MonocularOdometry::BeginStart(const MonocularFrame& frame) {
  started_ = false;
  start_images_.Build(frame.grey);
  start_.Begin(start_images_[0]);
  start_stamp_ns_ = frame.stamp_ns;
  way_m_ = way_s_ = way_units_ = 0;
}

VoResult MonocularOdometry::Start(const MonocularFrame& frame) {
  VoResult result = last_;
  result.new_keyframe = false;
  if (result.state == VoState::kLost) {
    GrowWhileLost(config_.odometry, Seconds(last_frame_->stamp_ns - lost_since_ns_),
                  Seconds(frame.stamp_ns - lost_since_ns_), result.covariance);
  }
  odometry_.Reset();
  odometry_.Track({frame.stamp_ns, frame.grey, {}, 1});
  const cv::Mat& smooth = odometry_.images()[0];
  if (!start_.HasBegun()) {
    BeginStart(frame);
    return result;
  }
  const std::optional<Eigen::Isometry3d> direction = start_.Follow(smooth);
  if (!direction) {
    if (start_.HasJustBegun()) BeginStart(frame);
    return result;
  }
  // The units of the map: metres, if the speed tells them.
  const bool knows_way = config_.scale_source == ScaleSource::kSpeed && way_m_ > 0;
  scale_.Reset();
  const double units = knows_way ? way_m_ : 1.0;
  if (knows_way) scale_.Measure(way_m_, config_.speed_sigma_mps * way_s_, units);
  const Eigen::Isometry3d first_from_new = StretchedMonocularMotion(direction->inverse(), units);

  views_.clear();
  views_.push_back({start_.first().clone(), first_from_new.inverse()});
  map_.Clear();
  LearnDepths(Eigen::Isometry3d::Identity());
  const double step_s = Seconds(frame.stamp_ns - start_stamp_ns_);
  if (!odometry_.AddKeyframe(map_.DepthImage(), map_.SigmaImage(),
                             Se3Log(first_from_new) / step_s)) {
    BeginStart(frame);
    return result;
  }
  started_ = true;
  start_pose_ = result.world_from_camera;
  start_covariance_ = result.covariance;
  last_unscaled_ = Eigen::Isometry3d::Identity();
  way_m_ = way_s_ = way_units_ = 0;
  result.world_from_camera = result.world_from_camera * first_from_new;
  result.state = VoState::kTracking;
  result.new_keyframe = true;
  result.keyframe_stamp_ns = frame.stamp_ns;
  return result;
}

VoResult MonocularOdometry::Continue(const MonocularFrame& frame) {
  VoResult unscaled = odometry_.Track({frame.stamp_ns, frame.grey, {}, 1});
  if (unscaled.state != VoState::kTracking) {
    if (last_.state == VoState::kTracking) lost_since_ns_ = frame.stamp_ns;
    way_m_ = way_s_ = way_units_ = 0;
    VoResult held = InMetres(unscaled);
    if (Seconds(frame.stamp_ns - lost_since_ns_) >= config_.give_up_s) BeginStart(frame);
    return held;
  }
  MeasureScale(unscaled.world_from_camera);
  if (unscaled.keyframe_due) {
    LearnDepths(unscaled.world_from_camera);
    unscaled.new_keyframe =
        odometry_.AddKeyframe(map_.DepthImage(), map_.SigmaImage(), unscaled.twist);
  }
  return InMetres(unscaled);
}

/// Depths of the present frame's edges, from the last keyframes' and from where the earlier
/// keyframes see them: the newest view, which is the nearest, first.
void MonocularOdometry::LearnDepths(const Eigen::Isometry3d& world_from_camera) {
  const cv::Mat& smooth = odometry_.images()[0];
  const View& last = views_.back();
  map_.SetRange(config_.depth.min_depth_m / scale_.metres_per_unit(),
                config_.depth.max_depth_m / scale_.metres_per_unit());
  map_.MoveTo(extractor_.Extract(smooth), world_from_camera.inverse() * last.world_from_camera);
  for (auto view = views_.rbegin(); view != views_.rend(); ++view) {
    map_.Measure(smooth, view->grey, view->world_from_camera.inverse() * world_from_camera,
                 view == views_.rbegin());
  }
  map_.Regularise();
  scale_.Drift();
  if (config_.scale_source == ScaleSource::kCameraHeight) {
    const std::optional<double> height =
        RoadHeight(map_.edges(), camera_, config_.camera_pitch_rad);
    if (height) scale_.Measure(config_.camera_height_m, kHeightSigmaM, *height);
  }
  if (views_.size() >= static_cast<std::size_t>(config_.views_kept)) {
    views_.push_back(std::move(views_.front()));  // Its memory serves again.
    views_.pop_front();
  } else {
    views_.emplace_back();
  }
  smooth.copyTo(views_.back().grey);
  views_.back().world_from_camera = world_from_camera;
}

void MonocularOdometry::MeasureScale(const Eigen::Isometry3d& world_from_camera) {
  way_units_ += (last_unscaled_.inverse() * world_from_camera).translation().norm();
  if (config_.scale_source != ScaleSource::kSpeed || way_m_ < kScaleWayM) return;
  if (way_m_ >= config_.min_speed_mps * way_s_) {
    scale_.Measure(way_m_, config_.speed_sigma_mps * way_s_, way_units_);
  }
  way_m_ = way_s_ = way_units_ = 0;
}

/// The step since the last frame, added to the path in metres.
VoResult MonocularOdometry::InMetres(const VoResult& unscaled) {
  const double scale = scale_.metres_per_unit();
  VoResult result = unscaled;
  const Eigen::Isometry3d step = last_unscaled_.inverse() * unscaled.world_from_camera;
  result.world_from_camera =
      Renormalised(last_.world_from_camera * StretchedMonocularMotion(step, scale));
  last_unscaled_ = unscaled.world_from_camera;
  Vector6d stretch = Vector6d::Ones();
  stretch.head<3>().setConstant(scale);
  result.covariance = stretch.asDiagonal() * unscaled.covariance * stretch.asDiagonal();
  // What was not known of the pose at the start moves along.
  const Matrix6d to_now = Se3Adjoint(result.world_from_camera.inverse() * start_pose_);
  result.covariance += to_now * start_covariance_ * to_now.transpose();
  // A wrong scale moves the camera along the whole way from its start.
  const double log_sigma = scale_.log_sigma().value_or(1.0);
  const Eigen::Vector3d back =
      (result.world_from_camera.inverse() * start_pose_).translation() * log_sigma;
  result.covariance.topLeftCorner<3, 3>() += back * back.transpose();
  if (result.twist) {
    *result.twist = stretch.asDiagonal() * *unscaled.twist;
    result.twist_covariance =
        stretch.asDiagonal() * unscaled.twist_covariance * stretch.asDiagonal();
    const Eigen::Vector3d along = result.twist->head<3>() * log_sigma;
    result.twist_covariance.topLeftCorner<3, 3>() += along * along.transpose();
  }
  return result;
}

}  // namespace livemap::odometry
