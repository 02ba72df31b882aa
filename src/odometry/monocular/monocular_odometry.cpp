#include "odometry/monocular/monocular_odometry.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/time.h"

namespace livemap::odometry {
namespace {

/// The shortest way that tells the scale: over less, errors of both sides do not average out, m.
constexpr double kScaleWayM = 1.0;
constexpr double kFastestMps = 200;
/// Of the camera's height: the load, the road's crown.
constexpr double kHeightSigmaM = 0.05;
/// Between two images that tell the road's plane, and from one that is kept to the next.
constexpr double kRoadStepM = 1.0;
constexpr double kRoadSpacingM = 0.25;
/// What all heights of one drive have in common, and no mean of them lessens: pitch, the road's
/// crown. A share of the height, and of one that a better source has taught.
constexpr double kSharedHeightSigma = 0.03;
constexpr double kSharedTaughtSigma = 0.01;
/// A height that a better source of metres has taught: of the newest in the mean of the logarithms.
constexpr double kHeightShare = 0.1;
/// Metres less certain than this teach no height.
constexpr double kTeachingSigma = 0.05;
/// What a distance between fixes errs by beyond what they state, reflections above all: a share.
constexpr double kBaselineSigma = 0.05;
constexpr double kMostSigmas = 2.0;
/// A rough speed less certain than this gives the start no length.
constexpr double kWorstStartSigma = 0.5;
/// A start without speeds for more than half of its time has no length; for less, the speed may
/// have been another one by so much, m/s.
constexpr double kLeastShareOfStart = 0.5;
constexpr double kGapSigmaMps = 0.5;
/// A camera that has moved less since the last check, shares of the start's motion and rad, sees
/// nothing new of it.
constexpr double kCheckedMove = 0.1;
constexpr double kCheckedTurnRad = 0.01;
/// A path of which the distance from its beginning is a smaller share is no straight way.
constexpr double kLeastStraightness = 0.9;

/// A motion with its translation times `factor`.
Eigen::Isometry3d StretchedMonocularMotion(Eigen::Isometry3d motion, double factor) {
  motion.translation() *= factor;
  return motion;
}

DepthLearner::Config LearnerOfMonocular(const MonocularOdometry::Config& config) {
  DepthLearner::Config learner;
  learner.edges = config.odometry.edges;
  learner.depth = config.depth;
  learner.views_kept = config.views_kept;
  learner.finds_road = config.scale_source != ScaleSource::kSpeed;
  learner.road.camera_height_m = config.camera_height_m;
  learner.road.camera_pitch_rad = config.camera_pitch_rad;
  return learner;
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
      learner_(LearnerOfMonocular(config), intrinsics),
      start_(config.start, intrinsics),
      scale_(config.scale),
      fixes_(config.fixes),
      travel_(config.travel) {
  if (config.keyframe_delay < 0 || config.keyframe_delay > 1000) {
    throw Error("keyframe_delay is " + std::to_string(config.keyframe_delay) +
                "; 0 to 1000 is accepted");
  }
  if (config.background || config.keyframe_delay > 0) {
    worker_ =
        std::make_unique<KeyframeWorker>(learner_, config.background ? 0 : config.keyframe_delay);
  }
}

void MonocularOdometry::Reset() {
  if (worker_) worker_->Cancel();
  odometry_.Reset();
  start_ = TwoViewStart(config_.start, camera_);
  scale_.Reset();
  fixes_.Reset();
  travel_.Reset();
  learner_.Clear();
  started_ = lost_ = false;
  source_ = MetresSource::kNone;
  shared_sigma_ = 0;
  log_height_.reset();
  height_variance_ = 0;
  height_told_ns_ = ordered_ns_ = 0;
  path_.setIdentity();
  last_frame_.reset();
  last_ = {};
}

std::optional<double> MonocularOdometry::metres_sigma() const {
  const std::optional<double> sigma = scale_.log_sigma();
  if (!sigma) return sigma;
  return std::hypot(*sigma, shared_sigma_);
}

VoResult MonocularOdometry::Track(const MonocularFrame& frame) {
  odometry_.Check({frame.stamp_ns, frame.grey, {}, 1});
  // Written so that NaN is refused.
  if (frame.speed_mps && !(*frame.speed_mps >= 0 && *frame.speed_mps < kFastestMps)) {
    throw Error("a speed of " + std::to_string(*frame.speed_mps) + " m/s came with a frame; 0 to " +
                std::to_string(kFastestMps) + " is accepted");
  }
  now_ns_ = frame.stamp_ns;
  AddWay(frame);
  last_ = started_ ? Continue(frame) : Start(frame);
  last_frame_ = frame;
  last_frame_->grey.release();
  ForgetOldSource();
  return last_;
}

/// A source that is silent tells nothing: the metres stay as they are, less certain with every
/// keyframe, or a lesser source tells them.
void MonocularOdometry::ForgetOldSource() {
  const double age_s =
      config_.source_age_s + (source_ == MetresSource::kFixes ? config_.fixes.longest_s : 0);
  if (Seconds(now_ns_ - told_ns_) > age_s) source_ = MetresSource::kNone;
}

/// The way between two frames, by the mean of the speeds at its ends.
void MonocularOdometry::Way::Add(const MonocularFrame& from, const MonocularFrame& to,
                                 double default_sigma_mps) {
  if (!from.speed_mps || !to.speed_mps) {
    has_gap = true;
    return;
  }
  const double step_s = Seconds(to.stamp_ns - from.stamp_ns);
  m += 0.5 * (*from.speed_mps + *to.speed_mps) * step_s;
  s += step_s;
  // Speeds of neighbouring frames err alike.
  sigma_m += to.speed_sigma_mps.value_or(default_sigma_mps) * step_s;
}

/// Where some of the images came without a speed the vehicle went on as at the others.
void MonocularOdometry::Way::FillGap(double elapsed_s) {
  const double gap_s = elapsed_s - s;
  if (!has_gap || gap_s <= 0 || s < kLeastShareOfStart * elapsed_s) return;
  m *= elapsed_s / s;
  sigma_m += kGapSigmaMps * gap_s;
  has_gap = false;
}

void MonocularOdometry::AddWay(const MonocularFrame& frame) {
  if (!last_frame_) return;
  way_.Add(*last_frame_, frame, config_.speed_sigma_mps);
  start_way_.Add(*last_frame_, frame, config_.speed_sigma_mps);
}

void MonocularOdometry::BeginStart(const MonocularFrame& frame) {
  started_ = false;
  start_images_.Build(frame.grey);
  start_.Begin(start_images_[0]);
  start_stamp_ns_ = first_stamp_ns_ = frame.stamp_ns;
  start_way_ = {};
  ForgetWay();
}

void MonocularOdometry::ForgetWay() {
  way_ = {};
  way_units_ = 0;
}

/// The last pose once more, less certain if it is lost.
VoResult MonocularOdometry::Held(const MonocularFrame& frame) const {
  VoResult held = last_;
  held.new_keyframe = false;
  held.twist.reset();
  held.twist_covariance.setZero();
  if (held.state == VoState::kLost) {
    GrowWhileLost(config_.odometry, Seconds(last_frame_->stamp_ns - lost_since_ns_),
                  Seconds(frame.stamp_ns - lost_since_ns_), held.covariance);
  }
  return held;
}

VoResult MonocularOdometry::Start(const MonocularFrame& frame) {
  VoResult result = Held(frame);
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
  scale_.Reset();
  fixes_.Reset();
  const std::optional<double> way_m = WayOfStart(frame);
  const Eigen::Isometry3d first_from_new =
      StretchedMonocularMotion(direction->inverse(), way_m.value_or(1.0));
  const double step_s = Seconds(frame.stamp_ns - first_stamp_ns_);
  start_units_ = first_from_new.translation().norm();
  if (!MakeFirstKeyframe(first_from_new, Se3Log(first_from_new) / step_s)) {
    BeginStart(frame);
    return result;
  }
  path_.setIdentity();
  fixes_.AddPose(frame.stamp_ns, path_);
  started_ = true;
  lost_ = false;
  start_pose_ = result.world_from_camera;
  start_covariance_ = result.covariance;
  result.new_keyframe = true;
  result.keyframe_stamp_ns = frame.stamp_ns;
  world_from_first_.reset();
  // One height of so few depths is too rough for a step: the path begins here.
  if (!way_m) {
    start_stamp_ns_ = frame.stamp_ns;
    return result;
  }
  world_from_first_ = result.world_from_camera;
  result.world_from_camera =
      *world_from_first_ *
      StretchedMonocularMotion(map_from_first_.inverse(), scale_.metres_per_unit());
  result.state = VoState::kTracking;
  return result;
}

/// The length of a start's motion by the speed, which is the map's scale from now on; none where no
/// speed tells it.
std::optional<double> MonocularOdometry::WayOfStart(const MonocularFrame& frame) {
  if (config_.scale_source == ScaleSource::kCameraHeight) return std::nullopt;
  Way way = start_way_;
  way.FillGap(Seconds(frame.stamp_ns - first_stamp_ns_));
  if (!(way.m > 0) || way.has_gap || way.sigma_m > kWorstStartSigma * way.m) return std::nullopt;
  scale_.Reset();
  scale_.Measure(way.m, way.sigma_m, way.m);
  HasTold(frame.speed_source, 0);
  return way.m;
}

/// Compares a provisional start with the frame, and makes it anew where that says so: then what the
/// frame's pose is.
std::optional<VoResult> MonocularOdometry::CheckStart(const MonocularFrame& frame,
                                                      const VoResult& unscaled) {
  if (!start_.IsProvisional()) return std::nullopt;
  start_units_ += (last_unscaled_.inverse() * unscaled.world_from_camera).translation().norm();
  const double unit = map_from_first_.translation().norm();
  const Eigen::Isometry3d new_from_first =
      StretchedMonocularMotion(unscaled.world_from_camera.inverse() * map_from_first_, 1 / unit);
  // A camera that stands says nothing of the start.
  const Eigen::Isometry3d moved = new_from_first * checked_from_first_.inverse();
  if ((new_from_first.translation() - checked_from_first_.translation()).norm() < kCheckedMove &&
      Eigen::AngleAxisd(moved.linear()).angle() < kCheckedTurnRad) {
    return std::nullopt;
  }
  checked_from_first_ = new_from_first;
  switch (start_.Check(odometry_.images()[0], new_from_first)) {
    case TwoViewStart::Verdict::kRemake:
      // No frame waits for the thread that makes keyframes: a later one says so again.
      if (worker_ && worker_->busy()) break;
      return RemakeStart(frame, unscaled);
    case TwoViewStart::Verdict::kFails:
      return GiveUp(frame);
    case TwoViewStart::Verdict::kOpen:
    case TwoViewStart::Verdict::kHolds:
      break;
  }
  return std::nullopt;
}

/// The start anew, with the present frame as its second one: depths by the longer baseline, and the
/// path corrected once. None, and nothing changed, where the corners show no motion.
std::optional<VoResult> MonocularOdometry::RemakeStart(const MonocularFrame& frame,
                                                       const VoResult& unscaled) {
  const double depth_sigma = start_.DepthSigma();
  const std::optional<Eigen::Isometry3d> direction = start_.Remake();
  if (!direction) return std::nullopt;
  const double units =
      (map_from_first_.inverse() * unscaled.world_from_camera).translation().norm();
  const double scale = scale_.metres_per_unit();
  const std::optional<double> sigma = scale_.log_sigma();
  const Eigen::Isometry3d step = last_unscaled_.inverse() * unscaled.world_from_camera;
  VoResult result = InMetres(frame, unscaled);
  scale_.Reset();
  // The speed of a stop is noise, and a way there and back is longer than its distance.
  const bool is_straight_way = start_way_.m >= config_.min_speed_mps * start_way_.s &&
                               units >= kLeastStraightness * start_units_;
  const std::optional<double> way_m = is_straight_way ? WayOfStart(frame) : std::nullopt;
  if (!way_m && sigma) scale_.Measure(scale, scale * std::hypot(*sigma, depth_sigma), 1);
  // Where nobody knows metres, depths are looked for in units of the baseline.
  const double stretch = way_m.value_or(sigma ? units : 1.0) / units;
  std::optional<Vector6d> twist = unscaled.twist;
  if (twist) twist->head<3>() *= stretch;
  start_units_ *= stretch;
  odometry_.Reset();
  odometry_.Track({frame.stamp_ns, frame.grey, {}, 1});
  if (!MakeFirstKeyframe(StretchedMonocularMotion(direction->inverse(), units * stretch), twist)) {
    return GiveUp(frame);
  }
  if (way_m || !sigma) {
    path_.setIdentity();
    fixes_.Reset();
    fixes_.AddPose(frame.stamp_ns, path_);
  } else {
    MeasureByFixes(frame.stamp_ns, step);
  }
  if (way_m && world_from_first_) {
    result.world_from_camera =
        *world_from_first_ *
        StretchedMonocularMotion(map_from_first_.inverse(), scale_.metres_per_unit());
  }
  if (result.twist) {
    result.twist->head<3>() *= stretch * scale_.metres_per_unit() / scale;
  }
  if (result.state == VoState::kTracking) {
    start_pose_ = result.world_from_camera;
    start_covariance_ = result.covariance;
  }
  result.new_keyframe = true;
  result.keyframe_stamp_ns = frame.stamp_ns;
  return result;
}

/// The path goes no further: the start begins anew.
VoResult MonocularOdometry::GiveUp(const MonocularFrame& frame) {
  lost_ = true;
  lost_since_ns_ = frame.stamp_ns;
  fixes_.Reset();
  if (last_.state != VoState::kInitialising) last_.state = VoState::kLost;  // A path has begun.
  const VoResult held = Held(frame);
  BeginStart(frame);
  return held;
}

/// The depths of the start's second frame, by those that its first frame shows: a new map, whose
/// origin is the second frame's camera.
bool MonocularOdometry::MakeFirstKeyframe(const Eigen::Isometry3d& first_from_new,
                                          const std::optional<Vector6d>& twist) {
  if (worker_) worker_->Cancel();
  map_from_first_ = first_from_new.inverse();
  checked_from_first_ =
      StretchedMonocularMotion(map_from_first_, 1 / map_from_first_.translation().norm());
  last_unscaled_ = Eigen::Isometry3d::Identity();
  ForgetWay();
  learner_.Restart(start_.first(), map_from_first_);
  recent_.clear();
  const LearntDepths learnt =
      learner_.Learn({odometry_.images()[0], Eigen::Isometry3d::Identity()},
                     scale_.metres_per_unit(), {start_.first(), map_from_first_});
  OnLearnt(learnt);
  return odometry_.AddKeyframe(learnt.depth, learnt.inverse_depth_sigma, twist);
}

VoResult MonocularOdometry::Continue(const MonocularFrame& frame) {
  const bool took_keyframe = TakeKeyframe();
  VoResult unscaled = odometry_.Track({frame.stamp_ns, frame.grey, {}, 1});
  unscaled.new_keyframe = took_keyframe;
  if (unscaled.state != VoState::kTracking) {
    if (!lost_) lost_since_ns_ = frame.stamp_ns;
    lost_ = true;
    ForgetWay();
    fixes_.Reset();
    VoResult held = InMetres(frame, unscaled);
    if (Seconds(frame.stamp_ns - lost_since_ns_) >= config_.give_up_s) BeginStart(frame);
    return held;
  }
  lost_ = false;
  if (Slides(last_unscaled_.inverse() * unscaled.world_from_camera)) return GiveUp(frame);
  if (const auto remade = CheckStart(frame, unscaled)) return *remade;
  MeasureScale(unscaled.world_from_camera);
  Remember(unscaled.world_from_camera);
  if (unscaled.keyframe_due) {
    unscaled.new_keyframe = MakeKeyframe(frame, unscaled) || unscaled.new_keyframe;
  }
  MeasureByFixes(frame.stamp_ns, last_unscaled_.inverse() * unscaled.world_from_camera);
  return InMetres(frame, unscaled);
}

/// Makes the present frame a keyframe, or has it made.
bool MonocularOdometry::MakeKeyframe(const MonocularFrame& frame, VoResult& unscaled) {
  const double scale = scale_.metres_per_unit();
  PosedImage before = recent_.empty() ? PosedImage{} : recent_.front();
  if (!worker_) {
    const LearntDepths learnt =
        learner_.Learn({odometry_.images()[0], unscaled.world_from_camera}, scale, before);
    OnLearnt(learnt);
    if (learnt.said_from_true) {
      const double since_s = Seconds(frame.stamp_ns - odometry_.keyframe()->stamp_ns);
      odometry_.Correct(*learnt.said_from_true, since_s);
      unscaled.world_from_camera = unscaled.world_from_camera * *learnt.said_from_true;
      if (unscaled.twist) *unscaled.twist += Se3Log(*learnt.said_from_true) / since_s;
    }
    return odometry_.AddKeyframe(learnt.depth, learnt.inverse_depth_sigma, unscaled.twist);
  }
  if (worker_->busy()) return false;
  ordered_ns_ = frame.stamp_ns;
  before.smooth = before.smooth.clone();
  worker_->Give({frame.stamp_ns, frame.grey.clone(), odometry_.images()[0].clone(), unscaled, scale,
                 std::move(before)});
  return false;
}

/// A keyframe that was made in the background becomes the one that frames are aligned with.
bool MonocularOdometry::TakeKeyframe() {
  if (!worker_) return false;
  const bool late = Seconds(now_ns_ - ordered_ns_) > config_.longest_keyframe_s;
  std::optional<KeyframeWorker::Made> made =
      late ? worker_->WaitAndTake(config_.longest_wait_s) : worker_->Take();
  if (!made) return false;
  OnLearnt(made->learnt);
  if (const auto& said_from_true = made->learnt.said_from_true) {
    // The last frame is moved in the world as the keyframe is.
    Eigen::Isometry3d& pose = made->order.result.world_from_camera;
    const Eigen::Isometry3d keyframe_from_last = pose.inverse() * last_unscaled_;
    odometry_.Correct(keyframe_from_last.inverse() * *said_from_true * keyframe_from_last,
                      Seconds(made->order.stamp_ns - odometry_.keyframe()->stamp_ns));
    pose = pose * *said_from_true;
  }
  return odometry_.AddEarlierKeyframe(
      {made->order.stamp_ns, made->order.grey, made->learnt.depth, 1},
      made->learnt.inverse_depth_sigma, made->order.result);
}

void MonocularOdometry::OnLearnt(const LearntDepths& learnt) {
  scale_.Drift();
  if (learnt.road_height) MeasureByHeight(*learnt.road_height);
}

/// The images of about the last metre, for the road; of whatever the map's unit is where nobody
/// knows metres.
void MonocularOdometry::Remember(const Eigen::Isometry3d& world_from_camera) {
  if (config_.scale_source == ScaleSource::kSpeed) return;
  const auto way_m = [&](const PosedImage& from) {
    return scale_.metres_per_unit() *
           (world_from_camera.translation() - from.world_from_camera.translation()).norm();
  };
  if (recent_.size() > 1 && way_m(recent_.back()) < kRoadSpacingM) return;
  PosedImage now;
  if (recent_.size() > 1 && way_m(recent_[1]) >= kRoadStepM) {
    now = std::move(recent_.front());  // Its memory serves again.
    recent_.pop_front();
  }
  odometry_.images()[0].copyTo(now.smooth);
  now.world_from_camera = world_from_camera;
  recent_.push_back(std::move(now));
}

/// By the height that the camera is said to have; where a better source has told metres, by the one
/// that it had then.
void MonocularOdometry::MeasureByHeight(const RoadHeight& height) {
  if (config_.scale_source == ScaleSource::kSpeed) return;
  const auto sigma_m = [&height](double height_m) {
    return std::hypot(kHeightSigmaM, height.relative_sigma * height_m);
  };
  if (config_.scale_source == ScaleSource::kCameraHeight) {
    scale_.Measure(config_.camera_height_m, sigma_m(config_.camera_height_m), height.units);
    HasTold(MetresSource::kHeight, kSharedHeightSigma);
    return;
  }
  const bool better_tells = source_ == MetresSource::kWheels || source_ == MetresSource::kReceiver;
  if (better_tells) {
    if (scale_.log_sigma().value_or(1) > kTeachingSigma) return;
    const double log_height = std::log(height.units * scale_.metres_per_unit());
    log_height_ = log_height_.value_or(log_height);
    *log_height_ += kHeightShare * (log_height - *log_height_);
    height_variance_ = kSharedTaughtSigma * kSharedTaughtSigma;
    return;
  }
  const double height_m = log_height_ ? std::exp(*log_height_) : config_.camera_height_m;
  if (!(height_m > kHeightSigmaM)) return;
  if (!log_height_) {
    log_height_ = std::log(height_m);
    height_variance_ = kSharedHeightSigma * kSharedHeightSigma;
  }
  if (!scale_.log_sigma()) fixes_.Reset();  // Their distance was in units.
  scale_.Measure(height_m, sigma_m(height_m), height.units);
  height_told_ns_ = now_ns_;
  // Fixes teach how high the camera is: they are still the source.
  const MetresSource source = source_ == MetresSource::kFixes ? source_ : MetresSource::kHeight;
  const std::int64_t told_ns = told_ns_;
  HasTold(source, std::sqrt(height_variance_));
  if (source == MetresSource::kFixes) told_ns_ = told_ns;
}

/// The metres by the camera's height were wrong by the exponential of `log_metres_error`: so is the
/// height.
void MonocularOdometry::TeachHeight(double log_metres_error, double variance) {
  const double gain = height_variance_ / (height_variance_ + variance);
  const double most = kMostSigmas * std::sqrt(height_variance_ + variance);
  log_metres_error = std::clamp(log_metres_error, -most, most);
  *log_height_ += gain * log_metres_error;
  height_variance_ *= 1 - gain;
  scale_.Stretch(std::exp(gain * log_metres_error));
}

void MonocularOdometry::HasTold(MetresSource source, double shared_sigma) {
  source_ = source;
  shared_sigma_ = shared_sigma;
  told_ns_ = now_ns_;
}

void MonocularOdometry::MeasureScale(const Eigen::Isometry3d& world_from_camera) {
  way_units_ += (last_unscaled_.inverse() * world_from_camera).translation().norm();
  if (way_.has_gap) {
    ForgetWay();
    return;
  }
  if (config_.scale_source == ScaleSource::kCameraHeight || way_.m < kScaleWayM) return;
  const bool by_fixes = last_frame_ && last_frame_->speed_source == MetresSource::kFixes;
  if (way_.m >= config_.min_speed_mps * way_.s && !by_fixes) {
    scale_.Measure(way_.m, way_.sigma_m, way_units_);
    HasTold(last_frame_->speed_source, 0);
  }
  ForgetWay();
}

/// The way between two fixes against the path, which is in metres as soon as they are known: while
/// the road is seen, how wrong the height is that tells them; else the metres themselves.
void MonocularOdometry::MeasureByFixes(std::int64_t stamp_ns, const Eigen::Isometry3d& step) {
  if (config_.scale_source != ScaleSource::kBest) return;
  path_ = Renormalised(path_ * StretchedMonocularMotion(step, scale_.metres_per_unit()));
  fixes_.AddPose(stamp_ns, path_);
  const auto measured = fixes_.Measure();
  if (!measured) return;
  const bool better_tells = source_ == MetresSource::kWheels || source_ == MetresSource::kReceiver;
  if (better_tells || !(measured->units > 0 && measured->metres > 0)) return;
  const bool by_height = log_height_ && Seconds(now_ns_ - height_told_ns_) <= config_.source_age_s;
  const double scale_before = scale_.metres_per_unit();
  if (by_height) {
    const double relative = measured->sigma_m / measured->metres;
    TeachHeight(std::log(measured->metres / measured->units),
                relative * relative + kBaselineSigma * kBaselineSigma);
    HasTold(MetresSource::kFixes, std::sqrt(height_variance_));
  } else {
    scale_.Measure(measured->metres, measured->sigma_m, measured->units / scale_before);
    HasTold(MetresSource::kFixes, 0);
  }
  // The next distance begins with steps that were made before: they were as wrong.
  const double factor = scale_.metres_per_unit() / scale_before;
  path_.translation() *= factor;
  fixes_.Stretch(factor);
}

/// Whether the path is none of a car.
bool MonocularOdometry::Slides(const Eigen::Isometry3d& step) {
  if (config_.scale_source != ScaleSource::kBest || !KnowsMetres()) return false;
  return !travel_.Add(StretchedMonocularMotion(step, scale_.metres_per_unit()));
}

bool MonocularOdometry::KnowsMetres() const {
  return config_.scale_source != ScaleSource::kBest || scale_.log_sigma().has_value();
}

/// The frame was followed, but how far it is nobody knows yet: the path begins later.
VoResult MonocularOdometry::WithoutMetres(const MonocularFrame& frame, const VoResult& unscaled) {
  VoResult held = Held(frame);
  held.new_keyframe = unscaled.new_keyframe;
  held.keyframe_stamp_ns = unscaled.keyframe_stamp_ns;
  last_unscaled_ = unscaled.world_from_camera;
  start_stamp_ns_ = frame.stamp_ns;
  start_pose_ = held.world_from_camera;
  start_covariance_ = held.covariance;
  return held;
}

/// The step since the last frame, added to the path in metres.
VoResult MonocularOdometry::InMetres(const MonocularFrame& frame, const VoResult& unscaled) {
  if (!KnowsMetres()) return WithoutMetres(frame, unscaled);
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
  const double log_sigma = metres_sigma().value_or(1.0);
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
