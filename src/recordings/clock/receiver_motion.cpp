#include "recordings/clock/receiver_motion.h"

#include <Eigen/Core>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/time.h"

namespace livemap::recordings {
namespace {

/// Longer gaps between positions say nothing of what was between.
constexpr double kMaxGapS = 3.5;
/// A slower vehicle has no course that its positions could tell.
constexpr double kMinCourseSpeedMps = 1.2;
/// Of the smoothing, and in intervals of the positions.
constexpr double kMinSmoothingS = 0.5;
constexpr double kSmoothingIntervals = 0.9;
/// No vehicle on a road turns faster.
constexpr double kMaxTurnRadps = 1.5;
/// A sampled day; more is no recording.
constexpr std::size_t kMaxSamples = 10'000'000;

/// Position and speeds of a track in a plane, and times in seconds since its begin.
struct PlaneTrack {
  std::vector<double> times_s;
  std::vector<Eigen::Vector2d> places_m;
  std::vector<double> speeds_mps;  ///< Empty: the receiver states none.
};

PlaneTrack InPlane(const RecordedTrack& track) {
  PlaneTrack plane;
  const geo::LocalFrame frame(track.positions[track.positions.size() / 2].position);
  std::size_t with_speed = 0;
  for (const RecordedPosition& position : track.positions) {
    plane.times_s.push_back(Seconds(position.stamp_ns - track.begin_ns()));
    plane.places_m.push_back(frame.ToEnu(position.position));
    plane.speeds_mps.push_back(position.speed_mps.value_or(0));
    with_speed += position.speed_mps ? 1U : 0U;
  }
  // Half of the speeds are worse than none: the others would stand at 0.
  if (with_speed < track.positions.size()) plane.speeds_mps.clear();
  return plane;
}

double MedianInterval(const std::vector<double>& times_s) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < times_s.size(); ++i) intervals.push_back(times_s[i] - times_s[i - 1]);
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return *middle;
}

/// Parabolas through the neighbourhood of a time, weighted by a Gaussian.
class SmoothTrack {
 public:
  SmoothTrack(PlaneTrack track, double sigma_s) : track_(std::move(track)), sigma_s_(sigma_s) {}

  /// `time_s` must not go back from call to call.
  ReceiverMotion::Sample At(double time_s) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const std::vector<double>& times = track_.times_s;
    const auto after = std::upper_bound(times.begin(), times.end(), time_s);
    if (after == times.begin() || after == times.end() || *after - *(after - 1) > kMaxGapS) {
      return {kNone, kNone};
    }
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 3> right = Eigen::Matrix<double, 3, 3>::Zero();
    const double reach_s = 3 * sigma_s_;
    for (auto at = std::lower_bound(times.begin(), times.end(), time_s - reach_s);
         at != times.end() && *at <= time_s + reach_s; ++at) {
      const auto index = static_cast<std::size_t>(at - times.begin());
      const double t = *at - time_s;
      const double weight = std::exp(-t * t / (2 * sigma_s_ * sigma_s_));
      const Eigen::Vector3d row(1, t, t * t / 2);
      const double speed = track_.speeds_mps.empty() ? 0 : track_.speeds_mps[index];
      const Eigen::Vector3d values(track_.places_m[index].x(), track_.places_m[index].y(), speed);
      normal += weight * row * row.transpose();
      right += weight * row * values.transpose();
    }
    const Eigen::FullPivLU<Eigen::Matrix3d> solver(normal);
    if (!solver.isInvertible()) return {kNone, kNone};
    const Eigen::Matrix3d fit = solver.solve(right);
    const Eigen::Vector2d velocity(fit(1, 0), fit(1, 1)), acceleration(fit(2, 0), fit(2, 1));
    ReceiverMotion::Sample sample;
    sample.speed_mps = track_.speeds_mps.empty() ? velocity.norm() : std::max(0.0, fit(0, 2));
    // Clockwise, as courses are counted.
    const double cross = velocity.y() * acceleration.x() - velocity.x() * acceleration.y();
    if (sample.speed_mps > kMinCourseSpeedMps && velocity.norm() > kMinCourseSpeedMps) {
      sample.turn_radps = std::clamp(cross / velocity.squaredNorm(), -kMaxTurnRadps, kMaxTurnRadps);
    }
    return sample;
  }

 private:
  const PlaneTrack track_;
  const double sigma_s_;
};

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
  PlaneTrack plane = InPlane(track);
  const double sigma_s =
      std::max(kMinSmoothingS, kSmoothingIntervals * MedianInterval(plane.times_s));
  ReceiverMotion motion;
  motion.begin_ns = track.begin_ns();
  const double length_s = plane.times_s.back();
  SmoothTrack smooth(std::move(plane), sigma_s);
  const auto wanted = static_cast<std::size_t>(length_s / ReceiverMotion::kStepS) + 1;
  motion.samples.reserve(std::min(wanted, kMaxSamples));
  for (std::size_t i = 0; i < std::min(wanted, kMaxSamples); ++i) {
    motion.samples.push_back(smooth.At(static_cast<double>(i) * ReceiverMotion::kStepS));
  }
  return motion;
}

}  // namespace livemap::recordings
