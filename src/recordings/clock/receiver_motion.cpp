#include "recordings/clock/receiver_motion.h"

#include <Eigen/Core>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/median.h"
#include "common/time.h"

namespace livemap::recordings {
namespace {

/// Longer gaps between positions say nothing of what was between.
constexpr double kMaxGapS = 3.5;
/// A slower vehicle has no course that its positions could tell.
constexpr double kMinCourseSpeedMps = 1.5;
/// Standard deviations of the smoothing's weights, at least.
constexpr double kSpeedSmoothingS = 0.5;
constexpr double kTurnSmoothingByVelocityS = 0.7;
constexpr double kTurnSmoothingByPositionS = 1.5;
/// And in intervals of the positions.
constexpr double kSmoothingIntervals = 0.9;
/// No vehicle on a road turns faster.
constexpr double kMaxTurnRadps = 1.5;
/// Two days; more is no recording.
constexpr std::size_t kMaxSamples = 2'000'000;

/// Velocities or else positions of a track in a plane, and times in seconds since its begin.
struct PlaneTrack {
  std::vector<double> times_s;
  std::vector<Eigen::Vector2d> values;  ///< East and north, m/s or m.
  bool are_velocities = false;
};

PlaneTrack InPlane(const RecordedTrack& track) {
  PlaneTrack plane;
  plane.are_velocities = std::all_of(
      track.positions.begin(), track.positions.end(),
      [](const RecordedPosition& position) { return position.speed_mps && position.course_deg; });
  const geo::LocalFrame frame(track.positions[track.positions.size() / 2].position);
  for (const RecordedPosition& position : track.positions) {
    plane.times_s.push_back(Seconds(position.stamp_ns - track.begin_ns()));
    if (!plane.are_velocities) {
      plane.values.push_back(frame.ToEnu(position.position));
      continue;
    }
    const double course_rad = *position.course_deg * geo::kRadiansPerDegree;
    plane.values.emplace_back(*position.speed_mps * std::sin(course_rad),
                              *position.speed_mps * std::cos(course_rad));
  }
  return plane;
}

double MedianInterval(const std::vector<double>& times_s) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < times_s.size(); ++i) intervals.push_back(times_s[i] - times_s[i - 1]);
  return TakeMedian(intervals);
}

struct SmoothMotion {
  Eigen::Vector2d velocity, acceleration;
};

/// The polynomial through the neighbourhood of a time, weighted by a Gaussian; none in a gap.
std::optional<SmoothMotion> Smooth(const PlaneTrack& track, double time_s, double sigma_s) {
  const std::vector<double>& times = track.times_s;
  const auto after = std::upper_bound(times.begin(), times.end(), time_s);
  if (after == times.begin() || after == times.end() || *after - *(after - 1) > kMaxGapS) {
    return std::nullopt;
  }
  // Of velocities the parabola's last term is left out.
  const Eigen::Index terms = track.are_velocities ? 2 : 3;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
  const double reach_s = 3 * sigma_s;
  for (auto at = std::lower_bound(times.begin(), times.end(), time_s - reach_s);
       at != times.end() && *at <= time_s + reach_s; ++at) {
    const double t = *at - time_s;
    const double weight = std::exp(-t * t / (2 * sigma_s * sigma_s));
    const Eigen::Vector3d row(1, t, t * t / 2);
    normal += weight * row * row.transpose();
    right += weight * row * track.values[static_cast<std::size_t>(at - times.begin())].transpose();
  }
  const Eigen::FullPivLU<Eigen::MatrixXd> solver(normal.topLeftCorner(terms, terms));
  if (!solver.isInvertible()) return std::nullopt;
  const Eigen::MatrixX2d fit = solver.solve(right.topRows(terms));
  return SmoothMotion{fit.row(terms - 2).transpose(), fit.row(terms - 1).transpose()};
}

}  // namespace

std::optional<ReceiverMotion::Sample> ReceiverMotion::At(std::int64_t stamp_ns) const {
  const double place = Seconds(stamp_ns - begin_ns) / kStepS;
  if (!(place >= 0) || place >= static_cast<double>(samples.size()) - 1) return std::nullopt;
  const auto index = static_cast<std::size_t>(place);
  const double part = place - static_cast<double>(index);
  const Sample &a = samples[index], &b = samples[index + 1];
  const Sample between{a.speed_mps + part * (b.speed_mps - a.speed_mps),
                       a.turn_radps + part * (b.turn_radps - a.turn_radps)};
  if (std::isnan(between.speed_mps)) return std::nullopt;
  return between;
}

ReceiverMotion MotionOf(const RecordedTrack& track) {
  const PlaneTrack plane = InPlane(track);
  const double interval_s = kSmoothingIntervals * MedianInterval(plane.times_s);
  ReceiverMotion motion;
  motion.begin_ns = track.begin_ns();
  motion.speed_smoothing_s = std::max(kSpeedSmoothingS, interval_s);
  motion.turn_smoothing_s = std::max(
      plane.are_velocities ? kTurnSmoothingByVelocityS : kTurnSmoothingByPositionS, interval_s);
  const auto wanted = static_cast<std::size_t>(plane.times_s.back() / ReceiverMotion::kStepS) + 1;
  motion.samples.reserve(std::min(wanted, kMaxSamples));
  for (std::size_t i = 0; i < std::min(wanted, kMaxSamples); ++i) {
    const double time_s = static_cast<double>(i) * ReceiverMotion::kStepS;
    const auto fine = Smooth(plane, time_s, motion.speed_smoothing_s);
    const auto smooth = Smooth(plane, time_s, motion.turn_smoothing_s);
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    ReceiverMotion::Sample sample{fine && smooth ? fine->velocity.norm() : kNone, 0};
    if (smooth && smooth->velocity.norm() > kMinCourseSpeedMps) {
      // Clockwise, as courses are counted.
      const double cross = smooth->velocity.y() * smooth->acceleration.x() -
                           smooth->velocity.x() * smooth->acceleration.y();
      sample.turn_radps =
          std::clamp(cross / smooth->velocity.squaredNorm(), -kMaxTurnRadps, kMaxTurnRadps);
    }
    motion.samples.push_back(sample);
  }
  return motion;
}

}  // namespace livemap::recordings
