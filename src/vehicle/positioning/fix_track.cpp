#include "vehicle/positioning/fix_track.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "common/median.h"
#include "common/time.h"
#include "geo/fix_plausibility.h"

namespace livemap::vehicle {
namespace {

constexpr double kMinSigmaM = 1e-3;   // No receiver is better; keeps covariances invertible.
constexpr double kStandingMps = 0.3;  // Slower than this the vehicle stands.
// Three fixes within so long are a straight line, but for their scatter: braking bends it by 6 cm.
constexpr double kStraightS = 0.55;
constexpr std::size_t kScattersAsked = 21;  // The newest ones.
constexpr std::size_t kScattersEnough = 5;

double FixSigmaM(const Eigen::Matrix2d& covariance_m2) {
  return std::sqrt(covariance_m2.trace() / 2);
}

}  // namespace

FixTrack::FixTrack(const Config& config) : config_(config), stamps_(config.stamps) {}

void FixTrack::Reset() {
  stamps_.Reset();
  points_.clear();
  suspects_.clear();
}

std::optional<std::int64_t> FixTrack::newest_ns() const {
  if (points_.empty()) return std::nullopt;
  return points_.back().stamp_ns;
}

std::optional<std::int64_t> FixTrack::oldest_ns() const {
  if (points_.empty()) return std::nullopt;
  return points_.front().stamp_ns;
}

std::optional<geo::TrackPose> FixTrack::Newest() const {
  if (points_.empty()) return std::nullopt;
  return PoseOf(points_.back());
}

std::optional<geo::TrackPose> FixTrack::Oldest() const {
  if (points_.empty()) return std::nullopt;
  return PoseOf(points_.front());
}

geo::TrackPose FixTrack::PoseOf(const Point& point) const {
  geo::TrackPose pose;
  pose.position = point.position;
  pose.covariance_m2 = point.covariance_m2;
  pose.course_rad = std::numeric_limits<double>::quiet_NaN();
  if (const auto motion = MotionAt(point.stamp_ns, points_.end())) {
    pose.speed_mps = motion->velocity_mps.norm();
    const auto course = CourseOf(*motion);
    if (course && pose.speed_mps >= kStandingMps) {
      pose.course_rad = course->course_rad;
      pose.course_variance_rad2 = course->variance_rad2;
    }
  }
  return pose;
}

FixTrack::Verdict FixTrack::Add(const geo::Fix& fix, std::int64_t now_ns) {
  if (!fix.has_fix) return Verdict::kNoFix;
  const auto point = ToPoint(fix);
  if (!point) return Verdict::kInvalid;
  const StampGate::Verdict stamp = stamps_.Judge(point->stamp_ns, now_ns);
  if (stamp == StampGate::Verdict::kLate) return Verdict::kOutOfOrder;
  if (!StampGate::IsUsable(stamp)) return Verdict::kBadStamp;
  const bool time_went_back = stamp == StampGate::Verdict::kRestarted;
  if (time_went_back) {
    // Nothing of before can be compared.
    points_.clear();
    suspects_.clear();
  }
  if (points_.empty()) return Begin(*point, time_went_back);
  if (Reachable(points_.back(), *point)) {
    suspects_.clear();
    Append(*point);
    return Verdict::kAccepted;
  }
  if (!JoinSuspects(*point, config_.jumps_to_restart)) return Verdict::kJump;
  return Verdict::kRestarted;
}

std::optional<FixTrack::Point> FixTrack::ToPoint(const geo::Fix& fix) const {
  if (!geo::IsPlausible(fix)) return std::nullopt;
  const Eigen::Matrix2d covariance_m2 = geo::CovarianceOf(fix, config_.default_sigma_m) +
                                        Eigen::Matrix2d::Identity() * kMinSigmaM * kMinSigmaM;
  return Point{fix.stamp_ns, fix.position, covariance_m2, std::nullopt, std::nullopt};
}

bool FixTrack::Reachable(const Point& from, const Point& to) const {
  return geo::AreReachable({from.stamp_ns, from.position, FixSigmaM(from.covariance_m2)},
                           {to.stamp_ns, to.position, FixSigmaM(to.covariance_m2)},
                           config_.max_speed_mps);
}

/// A track that has no fix yet begins with some that agree.
FixTrack::Verdict FixTrack::Begin(const Point& point, bool time_went_back) {
  const bool contradicted = !suspects_.empty() && !Reachable(suspects_.back(), point);
  const bool begun = JoinSuspects(point, config_.fixes_to_start);
  if (time_went_back) return Verdict::kRestarted;
  return begun || !contradicted ? Verdict::kAccepted : Verdict::kJump;
}

/// True when as many as `wanted` agree: then the track consists of them.
bool FixTrack::JoinSuspects(const Point& point, int wanted) {
  if (!suspects_.empty() && !Reachable(suspects_.back(), point)) suspects_.clear();
  suspects_.push_back(point);
  if (static_cast<int>(suspects_.size()) < wanted) return false;
  points_.clear();
  for (const Point& suspect : suspects_) Append(suspect);
  suspects_.clear();
  return true;
}

void FixTrack::Append(const Point& point) {
  const std::optional<Course> course_before =
      points_.empty() ? std::nullopt : points_.back().course;
  points_.push_back(point);
  points_.back().scatter_m2 = NewestScatter();
  while (Seconds(point.stamp_ns - points_.front().stamp_ns) > config_.keep_s) points_.pop_front();
  const auto motion = MotionAt(point.stamp_ns, points_.end());
  points_.back().course = motion ? CourseOf(*motion) : std::nullopt;
  if (!points_.back().course) points_.back().course = course_before;
}

/// Of the fix before the newest one, by its two neighbours.
std::optional<double> FixTrack::NewestScatter() const {
  if (points_.size() < 3) return std::nullopt;
  const Point& newest = points_.back();
  const Point& middle = points_[points_.size() - 2];
  const Point& oldest = points_[points_.size() - 3];
  const double span_s = Seconds(newest.stamp_ns - oldest.stamp_ns);
  if (span_s > kStraightS) return std::nullopt;
  const double share = Seconds(middle.stamp_ns - oldest.stamp_ns) / span_s;
  const geo::LocalFrame frame(middle.position);
  const Eigen::Vector2d aside_m =
      (1 - share) * frame.ToEnu(oldest.position) + share * frame.ToEnu(newest.position);
  return aside_m.squaredNorm() / 2 / (1 + share * share + (1 - share) * (1 - share));
}

/// How much the newest fixes before `end` scatter, at least course_noise_m. By the median: a fix
/// that reflections throw aside is no scatter. The first fixes of a track that will show their
/// scatter are taken to scatter as they state.
double FixTrack::ScatterM(const Points::const_iterator& end) const {
  std::vector<double> scatters_m2;
  for (auto point = end; point != points_.begin() && scatters_m2.size() < kScattersAsked;) {
    --point;
    if (point->scatter_m2) scatters_m2.push_back(*point->scatter_m2);
  }
  if (scatters_m2.size() < kScattersEnough) {
    return std::max(config_.course_noise_m, FirstScatterM(end));
  }
  // Half the square of two normal numbers has this median.
  return std::max(config_.course_noise_m, std::sqrt(TakeMedian(scatters_m2) / M_LN2));
}

/// What the last fix before `end` states; 0 where fixes come too seldom to show more.
double FixTrack::FirstScatterM(const Points::const_iterator& end) const {
  if (end - points_.begin() < 2) return 0;
  const Point& last = *std::prev(end);
  const double step_s = Seconds(last.stamp_ns - std::prev(end, 2)->stamp_ns);
  return step_s <= kStraightS / 2 ? FixSigmaM(last.covariance_m2) : 0;
}

/// Course of a vehicle that stands at this moment: the one it came with, else the one it leaves
/// with.
std::optional<FixTrack::Course> FixTrack::StandingCourse(
    const Points::const_iterator& after) const {
  if (after != points_.begin() && std::prev(after)->course) return std::prev(after)->course;
  const auto leaving =
      std::find_if(after, points_.end(), [](const Point& point) { return point.course; });
  return leaving == points_.end() ? std::nullopt : leaving->course;
}

FixTrack::Lookup FixTrack::At(std::int64_t stamp_ns) const {
  const auto after = std::lower_bound(
      points_.begin(), points_.end(), stamp_ns,
      [](const Point& point, std::int64_t moment_ns) { return point.stamp_ns < moment_ns; });
  if (points_.empty()) return {Answer::kWait, {}};
  if (after == points_.begin() && after->stamp_ns != stamp_ns) return {Answer::kHopeless, {}};
  // What lies beyond the first later fix stays out, so that the answer does not hang on how late it
  // is asked for: a replay places every hazard where the drive placed it.
  const auto motion = MotionAt(stamp_ns, after == points_.end() ? after : std::next(after));
  std::optional<Course> course = motion ? CourseOf(*motion) : std::nullopt;
  if (!course) course = StandingCourse(after);
  if (!course) return {Answer::kWait, {}};

  Lookup lookup;
  if (after == points_.end()) {
    if (!motion || Seconds(stamp_ns - points_.back().stamp_ns) > config_.max_extrapolation_s) {
      return {Answer::kWait, {}};
    }
    lookup = {Answer::kExtrapolated, Extrapolate(points_.back(), *motion, stamp_ns)};
  } else if (after->stamp_ns == stamp_ns) {
    lookup = {Answer::kReady, {after->position, after->covariance_m2}};
  } else {
    const Point& before = *std::prev(after);
    if (Seconds(after->stamp_ns - before.stamp_ns) > config_.max_gap_s) {
      return {Answer::kHopeless, {}};
    }
    lookup = {Answer::kReady, Interpolate(before, *after, stamp_ns)};
  }
  lookup.pose.course_rad = course->course_rad;
  lookup.pose.course_variance_rad2 = course->variance_rad2;
  lookup.pose.speed_mps = motion ? motion->velocity_mps.norm() : 0.0;
  return lookup;
}

geo::TrackPose FixTrack::Interpolate(const Point& before, const Point& after,
                                     std::int64_t stamp_ns) const {
  const geo::LocalFrame frame(before.position);
  const double ahead_s = Seconds(stamp_ns - before.stamp_ns);
  const double gap_s = Seconds(after.stamp_ns - before.stamp_ns);
  const double share = ahead_s / gap_s;
  // Straight and even between the two fixes, save for what accelerating could have changed.
  const double bend_m = 0.5 * config_.acceleration_mps2 * ahead_s * (gap_s - ahead_s);
  geo::TrackPose pose;
  pose.position = frame.ToGeo(share * frame.ToEnu(after.position));
  pose.covariance_m2 = (1 - share) * before.covariance_m2 + share * after.covariance_m2 +
                       bend_m * bend_m * Eigen::Matrix2d::Identity();
  return pose;
}

geo::TrackPose FixTrack::Extrapolate(const Point& last, const Motion& motion,
                                     std::int64_t stamp_ns) const {
  const double ahead_s = Seconds(stamp_ns - last.stamp_ns);
  const double bend_m = 0.5 * config_.acceleration_mps2 * ahead_s * ahead_s;
  geo::TrackPose pose;
  pose.position = geo::LocalFrame(last.position).ToGeo(ahead_s * motion.velocity_mps);
  pose.covariance_m2 =
      last.covariance_m2 +
      (motion.variance * ahead_s * ahead_s + bend_m * bend_m) * Eigen::Matrix2d::Identity();
  return pose;
}

std::optional<FixTrack::Motion> FixTrack::MotionAt(std::int64_t stamp_ns,
                                                   const Points::const_iterator& end) const {
  if (end == points_.begin()) return std::nullopt;
  std::vector<Sample> samples;  // By their distance in time from the moment, nearest first.
  const auto middle = std::lower_bound(
      points_.begin(), end, stamp_ns,
      [](const Point& point, std::int64_t moment_ns) { return point.stamp_ns < moment_ns; });
  const geo::LocalFrame frame((middle == end ? *std::prev(end) : *middle).position);
  auto older = middle;
  auto newer = middle;
  while (true) {
    const double older_s = older == points_.begin()
                               ? config_.course_window_s + 1
                               : Seconds(stamp_ns - std::prev(older)->stamp_ns);
    const double newer_s =
        newer == end ? config_.course_window_s + 1 : Seconds(newer->stamp_ns - stamp_ns);
    if (std::min(older_s, newer_s) > config_.course_window_s) break;
    if (older_s <= newer_s) {
      --older;
      samples.push_back({-older_s, frame.ToEnu(older->position)});
    } else {
      samples.push_back({newer_s, frame.ToEnu(newer->position)});
      ++newer;
    }
  }
  return BestLineFit(samples, ScatterM(end));
}

std::optional<FixTrack::Motion> FixTrack::BestLineFit(const std::vector<Sample>& samples,
                                                      double noise_m) const {
  // Grows the window fix by fix. A longer one averages out the scatter of the fixes, but if its
  // middle lags behind the asked moment, the vehicle may have turned or braked since: the window
  // with the smallest sum of both errors wins.
  std::optional<Motion> best;
  double sum_t = 0, sum_tt = 0, earliest_s = 0, latest_s = 0;
  Eigen::Vector2d sum_p = Eigen::Vector2d::Zero(), sum_tp = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto& [time_s, place_m] = samples[i];
    sum_t += time_s;
    sum_tt += time_s * time_s;
    sum_p += place_m;
    sum_tp += time_s * place_m;
    earliest_s = i == 0 ? time_s : std::min(earliest_s, time_s);
    latest_s = i == 0 ? time_s : std::max(latest_s, time_s);
    const double count = static_cast<double>(i + 1);
    const double mean_s = sum_t / count;
    const double spread = sum_tt - count * mean_s * mean_s;  // Sum of squared deviations of time.
    if (latest_s - earliest_s < 1e-3 || spread <= 0) continue;
    Motion motion;
    motion.velocity_mps = (sum_tp - mean_s * sum_p) / spread;
    const double turn_mps2 = config_.turn_rate_rps * motion.velocity_mps.norm();
    const double change = std::hypot(config_.acceleration_mps2, turn_mps2) * mean_s;
    motion.variance = noise_m * noise_m / spread + change * change;
    motion.span_s = latest_s - earliest_s;
    if (!best || motion.variance < best->variance) best = motion;
  }
  return best;
}

std::optional<FixTrack::Course> FixTrack::CourseOf(const Motion& motion) const {
  const double speed_mps = motion.velocity_mps.norm();
  if (speed_mps * motion.span_s < config_.min_baseline_m) return std::nullopt;
  const double variance_rad2 = motion.variance / (speed_mps * speed_mps);
  const double limit_rad = config_.max_course_sigma_rad;
  if (!(variance_rad2 <= limit_rad * limit_rad)) return std::nullopt;
  return Course{std::atan2(motion.velocity_mps.x(), motion.velocity_mps.y()), variance_rad2};
}

}  // namespace livemap::vehicle
