#include "localization/odometry_track.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "common/time.h"

namespace livemap::localization {
namespace {

constexpr double kMaxAccelerationMps2 = 12;  // Of a vehicle, both axes.
constexpr double kMinWaySigmaM = 1e-4;       // Keeps covariances invertible.
constexpr double kMinYawSigmaRad = 1e-5;
constexpr double kStandingSigmaM = 1e-3;  // Of a standing vehicle, after 1 s.
constexpr double kMaxPlaceM = 1e8;        // Nobody drives that far.
// Velocity is taken over twice this: over less, the noise of the way would pass for changes of
// speed.
constexpr std::int64_t kVelocitySpanNs = 500'000'000;
constexpr int kStepsToBelieve = 3;     // That contradict the speed.
constexpr double kSpeedMemoryS = 0.2;  // Of the speed that the track is carried on with.

bool IsOdometryPose(const Eigen::Isometry3d& pose) {
  if (!pose.matrix().allFinite() || pose.translation().norm() > kMaxPlaceM) return false;
  const Eigen::Matrix3d rotation = pose.linear();
  return (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3 &&
         rotation.determinant() > 0;
}

bool IsOdometryCovariance(const Eigen::Matrix3d& matrix) {
  if (!matrix.allFinite() || matrix.diagonal().minCoeff() < 0 || matrix.trace() > 1e6) return false;
  if ((matrix - matrix.transpose()).norm() > 1e-6 * matrix.norm()) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() >= -1e-9 * matrix.norm();
}

PlanarPose OdometryPlanarPose(const Eigen::Isometry3d& pose) {
  return {pose.translation().head<2>(), std::atan2(pose.linear()(1, 0), pose.linear()(0, 0))};
}

/// Diagonal covariance of a way and a turn.
Eigen::Matrix3d OdometryCovariance(double way_variance, double yaw_variance) {
  return Eigen::Vector3d(way_variance, way_variance, yaw_variance).asDiagonal();
}

}  // namespace

OdometryTrack::OdometryTrack(const OdometryModel& model, double max_extrapolation_s)
    : model_(model), max_extrapolation_s_(max_extrapolation_s) {}

/// What keeps a pose from becoming a step of the track; the first pose only starts it.
std::optional<OdometryTrack::Verdict> OdometryTrack::Refuse(
    std::int64_t stamp_ns, const Eigen::Isometry3d& odom_from_base) {
  if (stamp_ns <= 0 || !IsOdometryPose(odom_from_base)) return Verdict::kInvalid;
  if (samples_.empty()) {
    newest_raw_ = OdometryPlanarPose(odom_from_base);
    samples_.push_back({stamp_ns, {}, Eigen::Matrix3d::Zero()});
    return Verdict::kAccepted;
  }
  if (stamp_ns <= newest_ns()) return Verdict::kOutOfOrder;
  return std::nullopt;
}

/// The track goes on by its last speed.
void OdometryTrack::Coast(std::int64_t stamp_ns) {
  const double time_s = Seconds(stamp_ns - newest_ns());
  const PlanarPose coast{time_s * speed_.way_mps, time_s * speed_.yaw_rps};
  samples_.push_back({stamp_ns, samples_.back().pose * coast, CoastCovariance(time_s)});
}

OdometryTrack::Verdict OdometryTrack::AddLost(std::int64_t stamp_ns,
                                              const Eigen::Isometry3d& odom_from_base) {
  if (const auto refused = Refuse(stamp_ns, odom_from_base)) return *refused;
  newest_raw_ = OdometryPlanarPose(odom_from_base);
  Coast(stamp_ns);
  return Verdict::kReset;
}

OdometryTrack::Verdict OdometryTrack::Add(
    std::int64_t stamp_ns, const Eigen::Isometry3d& odom_from_base,
    const std::optional<Eigen::Matrix3d>& increment_covariance) {
  if (increment_covariance && !IsOdometryCovariance(*increment_covariance))
    return Verdict::kInvalid;
  if (const auto refused = Refuse(stamp_ns, odom_from_base)) return *refused;
  const PlanarPose raw = OdometryPlanarPose(odom_from_base);
  const double time_s = Seconds(stamp_ns - newest_ns());
  PlanarPose step = newest_raw_.Inverse() * raw;
  step.yaw_rad = WrapAngle(step.yaw_rad);
  newest_raw_ = raw;
  if (IsJump(step, time_s)) {
    Coast(stamp_ns);
    return Verdict::kReset;
  }
  Eigen::Matrix3d covariance = StepCovariance(step, time_s);
  if (increment_covariance) {
    covariance = *increment_covariance + OdometryCovariance(kMinWaySigmaM * kMinWaySigmaM,
                                                            kMinYawSigmaRad * kMinYawSigmaRad);
  }
  samples_.push_back({stamp_ns, samples_.back().pose * step, covariance});
  const double fresh = moving_known_ ? 1 - std::exp(-time_s / kSpeedMemoryS) : 1;
  speed_.way_mps += fresh * (step.position_m / time_s - speed_.way_mps);
  speed_.yaw_rps += fresh * (step.yaw_rad / time_s - speed_.yaw_rps);
  moving_known_ = true;
  return Verdict::kAccepted;
}

bool OdometryTrack::IsPossible(const PlanarPose& step, double time_s) const {
  // What rounding and noise move in a very short time is no speed.
  return step.position_m.norm() <= model_.max_speed_mps * time_s + 0.1 &&
         std::abs(step.yaw_rad) <= model_.max_yaw_rate_rps * time_s + 0.1;
}

bool OdometryTrack::Continues(const Speed& speed, const PlanarPose& step, double time_s) const {
  const double left_m = (step.position_m - time_s * speed.way_mps).norm();
  return left_m <= model_.max_jump_m + 0.5 * kMaxAccelerationMps2 * time_s * time_s;
}

/// Learns from what it sees.
bool OdometryTrack::IsJump(const PlanarPose& step, double time_s) {
  if (!IsPossible(step, time_s)) {
    other_steps_ = 0;
    return true;
  }
  if (!moving_known_ || Continues(speed_, step, time_s)) {
    other_steps_ = 0;
    return false;
  }
  const bool agrees = other_steps_ > 0 && Continues(other_speed_, step, time_s);
  other_steps_ = agrees ? other_steps_ + 1 : 1;
  other_speed_ = {step.position_m / time_s, step.yaw_rad / time_s};
  if (other_steps_ < kStepsToBelieve) return true;
  speed_ = other_speed_;
  other_steps_ = 0;
  return false;
}

Eigen::Matrix3d OdometryTrack::StepCovariance(const PlanarPose& step, double time_s) const {
  const double way_variance = model_.way_sigma_m * model_.way_sigma_m * step.position_m.norm() +
                              kStandingSigmaM * kStandingSigmaM * time_s +
                              kMinWaySigmaM * kMinWaySigmaM;
  return OdometryCovariance(way_variance, model_.yaw_sigma_rad * model_.yaw_sigma_rad * time_s);
}

Eigen::Matrix3d OdometryTrack::CoastCovariance(double time_s) const {
  const double way_sigma_m = model_.reset_speed_sigma_mps * time_s;
  const double yaw_sigma_rad = std::min(3.0, model_.reset_yaw_rate_sigma_rps * time_s);
  return OdometryCovariance(way_sigma_m * way_sigma_m + kMinWaySigmaM * kMinWaySigmaM,
                            yaw_sigma_rad * yaw_sigma_rad + kMinYawSigmaRad * kMinYawSigmaRad);
}

bool OdometryTrack::Covers(std::int64_t stamp_ns) const {
  return !samples_.empty() && stamp_ns >= oldest_ns() &&
         Seconds(stamp_ns - newest_ns()) <= max_extrapolation_s_;
}

/// Index of the first sample after a moment.
std::size_t OdometryTrack::After(std::int64_t stamp_ns) const {
  const auto after = std::upper_bound(
      samples_.begin(), samples_.end(), stamp_ns,
      [](std::int64_t moment_ns, const Sample& sample) { return moment_ns < sample.stamp_ns; });
  return static_cast<std::size_t>(after - samples_.begin());
}

PlanarPose OdometryTrack::At(std::int64_t stamp_ns) const {
  const std::size_t after = After(stamp_ns);
  if (after == 0) return samples_.front().pose;
  const Sample& before = samples_[after - 1];
  if (after == samples_.size()) {
    const double ahead_s = Seconds(stamp_ns - before.stamp_ns);
    return before.pose * PlanarPose{ahead_s * speed_.way_mps, ahead_s * speed_.yaw_rps};
  }
  const Sample& next = samples_[after];
  const double share =
      Seconds(stamp_ns - before.stamp_ns) / Seconds(next.stamp_ns - before.stamp_ns);
  return {before.pose.position_m + share * (next.pose.position_m - before.pose.position_m),
          before.pose.yaw_rad + share * (next.pose.yaw_rad - before.pose.yaw_rad)};
}

Eigen::Vector2d OdometryTrack::VelocityAt(std::int64_t stamp_ns) const {
  if (samples_.size() < 2) return Eigen::Vector2d::Zero();
  const std::int64_t span_ns = std::max<std::int64_t>(
      std::min({kVelocitySpanNs, stamp_ns - oldest_ns(), newest_ns() - stamp_ns}), 0);
  // As far to either side, which an even acceleration does not bend, unless too little is known.
  const bool centred = 2 * span_ns >= kVelocitySpanNs;
  const std::int64_t to_ns =
      centred ? stamp_ns + span_ns : std::min(stamp_ns + kVelocitySpanNs, newest_ns());
  const std::int64_t from_ns =
      centred ? stamp_ns - span_ns : std::max(to_ns - kVelocitySpanNs, oldest_ns());
  if (from_ns >= to_ns) return Eigen::Vector2d::Zero();
  return (At(to_ns).position_m - At(from_ns).position_m) / Seconds(to_ns - from_ns);
}

PlanarMotion OdometryTrack::Between(std::int64_t from_ns, std::int64_t to_ns) const {
  PlanarMotion motion;
  const auto append = [&motion](const PlanarPose& step, double time_s, const Eigen::Matrix3d& q) {
    const Eigen::Matrix2d rotation = Rotation2(motion.turn_rad);
    const Eigen::Vector2d way_m = rotation * step.position_m;
    Eigen::Matrix3d from_before = Eigen::Matrix3d::Identity();
    from_before.block<2, 1>(0, 2) = TurnedLeft(way_m);
    Eigen::Matrix3d from_step = Eigen::Matrix3d::Identity();
    from_step.topLeftCorner<2, 2>() = rotation;
    motion.covariance = from_before * motion.covariance * from_before.transpose() +
                        from_step * q * from_step.transpose();
    // The heading is too far left by bias * time: the true way lies to the right.
    motion.way_per_bias -= (motion.time_s + 0.5 * time_s) * TurnedLeft(way_m);
    motion.way_m += way_m;
    motion.turn_rad += step.yaw_rad;
    motion.time_s += time_s;
  };
  PlanarPose last = At(from_ns);
  std::int64_t last_ns = from_ns;
  for (std::size_t i = After(from_ns); i < samples_.size() && last_ns < to_ns; ++i) {
    const Sample& sample = samples_[i];
    const std::int64_t end_ns = std::min(sample.stamp_ns, to_ns);
    const PlanarPose end = end_ns == sample.stamp_ns ? sample.pose : At(end_ns);
    const double time_s = Seconds(end_ns - last_ns);
    const double whole_s = i == 0 ? time_s : Seconds(sample.stamp_ns - samples_[i - 1].stamp_ns);
    append(last.Inverse() * end, time_s, sample.covariance * (time_s / whole_s));
    last = end;
    last_ns = end_ns;
  }
  if (last_ns < to_ns) {
    const double time_s = Seconds(to_ns - last_ns);
    append(last.Inverse() * At(to_ns), time_s, CoastCovariance(time_s));
  }
  return motion;
}

PlanarMotion OdometryTrack::Nearby(std::int64_t from_ns, std::int64_t to_ns) const {
  const PlanarPose step = At(from_ns).Inverse() * At(to_ns);
  PlanarMotion motion;
  motion.time_s = Seconds(to_ns - from_ns);
  motion.way_m = step.position_m;
  motion.turn_rad = step.yaw_rad;
  motion.way_per_bias = -0.5 * motion.time_s * TurnedLeft(step.position_m);
  return motion;
}

void OdometryTrack::ForgetBefore(std::int64_t stamp_ns) {
  while (samples_.size() > 2 && samples_[1].stamp_ns <= stamp_ns) samples_.pop_front();
}

void OdometryTrack::Clear() {
  samples_.clear();
  moving_known_ = false;
  speed_ = {};
  other_steps_ = 0;
}

}  // namespace livemap::localization
