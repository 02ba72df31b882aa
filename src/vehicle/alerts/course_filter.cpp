#include "vehicle/alerts/course_filter.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/time.h"

namespace livemap::vehicle {
namespace {

constexpr double kMaxStepS = 0.2;     // Of the integration.
constexpr double kMisfit = 40;        // Normalised squared distance of a position that misfits.
constexpr int kMisfitsToRestart = 3;  // In succession.
constexpr double kMaxPeriodS = 2;     // What counts as the time between two positions.
constexpr double kMaxSpeedMps = 80;
constexpr double kStartSpeedMps = 3;  // Standard deviations of a state that has just begun.
constexpr double kStartCourseRad = 0.2;
constexpr double kLeastWeight = 1e-6;

using Mode = CourseFilter::Mode;
using State = CourseFilter::State;
using Covariance = CourseFilter::Covariance;

void MakeSymmetric(Covariance& covariance) {
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
}

/// Mean and covariance of the modes, each with its share.
void MomentsOf(const std::array<Mode, 2>& modes, const std::array<double, 2>& shares, State& mean,
               Covariance& covariance) {
  mean = shares[0] * modes[0].state + shares[1] * modes[1].state;
  covariance.setZero();
  for (std::size_t i = 0; i < 2; ++i) {
    const State off = modes[i].state - mean;
    covariance += shares[i] * (modes[i].covariance + off * off.transpose());
  }
}

/// Normalised squared distance of the position, and its likelihood.
struct Fit {
  double distance;
  double likelihood;
};

Fit UpdateModePlace(const Eigen::Vector2d& place_m, double noise_m, Mode& mode) {
  const Eigen::Matrix2d innovation =
      mode.covariance.topLeftCorner<2, 2>() + noise_m * noise_m * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d inverse = innovation.inverse();
  const Eigen::Vector2d error_m = place_m - mode.state.head<2>();
  const double distance = error_m.dot(inverse * error_m);
  const Eigen::Matrix<double, 6, 2> gain = mode.covariance.leftCols<2>() * inverse;
  mode.state += gain * error_m;
  mode.covariance -= (gain * mode.covariance.topRows<2>()).eval();
  MakeSymmetric(mode.covariance);
  mode.state[CourseFilter::kSpeed] = std::max(0.0, mode.state[CourseFilter::kSpeed]);
  return {distance, std::exp(-0.5 * distance) / std::sqrt(innovation.determinant())};
}

/// The likelihood of the velocity. One that misfits does not change the state.
double UpdateModeVelocity(const Eigen::Vector2d& plane_mps, double noise_mps, Mode& mode) {
  const double speed = mode.state[CourseFilter::kSpeed];
  const double sine = std::sin(mode.state[CourseFilter::kCourse]);
  const double cosine = std::cos(mode.state[CourseFilter::kCourse]);
  Eigen::Matrix<double, 2, 6> measures = Eigen::Matrix<double, 2, 6>::Zero();
  measures.col(CourseFilter::kCourse) = speed * Eigen::Vector2d(cosine, -sine);
  measures.col(CourseFilter::kSpeed) = Eigen::Vector2d(sine, cosine);
  const Eigen::Matrix<double, 6, 2> spread = mode.covariance * measures.transpose();
  const Eigen::Matrix2d innovation =
      measures * spread + noise_mps * noise_mps * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d inverse = innovation.inverse();
  const Eigen::Vector2d error_mps = plane_mps - speed * Eigen::Vector2d(sine, cosine);
  const double distance = error_mps.dot(inverse * error_mps);
  const double likelihood =
      std::exp(-0.5 * std::min(distance, kMisfit)) / std::sqrt(innovation.determinant());
  if (distance > kMisfit) return likelihood;
  const Eigen::Matrix<double, 6, 2> gain = spread * inverse;
  mode.state += gain * error_mps;
  mode.covariance -= (gain * spread.transpose()).eval();
  MakeSymmetric(mode.covariance);
  mode.state[CourseFilter::kSpeed] = std::max(0.0, mode.state[CourseFilter::kSpeed]);
  return likelihood;
}

void UpdateModeCourse(double course_rad, double course_variance_rad2, Mode& mode) {
  constexpr auto kCourse = CourseFilter::kCourse;
  const double error_rad = std::remainder(course_rad - mode.state[kCourse], 2 * M_PI);
  const double variance = mode.covariance(kCourse, kCourse) + std::max(1e-6, course_variance_rad2);
  const State gain = mode.covariance.col(kCourse) / variance;
  mode.state += gain * error_rad;
  mode.covariance -= (gain * mode.covariance.row(kCourse)).eval();
  MakeSymmetric(mode.covariance);
  mode.state[CourseFilter::kSpeed] = std::max(0.0, mode.state[CourseFilter::kSpeed]);
}

}  // namespace

double CourseFilter::CurvatureSigma(double sideways_mps2, double speed_mps) const {
  const double square = std::max(1.0, speed_mps * speed_mps);
  return std::min(sideways_mps2 / square, config_.max_curvature);
}

double CourseFilter::NoiseM(const Sample& sample) const {
  return std::max(config_.fix_noise_m, config_.stated_share * sample.stated_sigma_m);
}

void CourseFilter::Reset() {
  known_ = false;
  misfits_ = 0;
  start_.reset();
  newest_.reset();
}

void CourseFilter::MoveOrigin(const Eigen::Vector2d& origin_m) {
  state_.head<2>() -= origin_m;
  for (Mode& mode : modes_) mode.state.head<2>() -= origin_m;
  if (start_) start_->place_m -= origin_m;
  if (newest_) newest_->place_m -= origin_m;
}

bool CourseFilter::Add(const Sample& sample) {
  const bool finite = sample.place_m.allFinite() && std::isfinite(sample.stated_sigma_m) &&
                      (!sample.course_rad || (std::isfinite(*sample.course_rad) &&
                                              std::isfinite(sample.course_variance_rad2)));
  if (!finite) return false;
  if (newest_ && sample.stamp_ns <= newest_->stamp_ns) return false;
  double time_s = newest_ ? Seconds(sample.stamp_ns - newest_->stamp_ns) : 0;
  if (time_s > config_.max_gap_s) {
    Reset();
    time_s = 0;
  }
  if (newest_) period_s_ += 0.2 * (std::min(time_s, kMaxPeriodS) - period_s_);
  if (!known_) {
    Start(sample);
  } else {
    Mix(time_s);
    for (Mode& mode : modes_) Predict(time_s, mode);
    if (!Update(sample)) Start(sample);
  }
  newest_ = sample;
  return true;
}

/// Begins where two positions are far enough apart to tell the course, or where it is told.
void CourseFilter::Start(const Sample& sample) {
  if (!start_) start_ = sample;
  const Eigen::Vector2d way_m = sample.place_m - start_->place_m;
  const double noise_m = NoiseM(sample);
  const double enough_m = std::max(config_.start_way_m, 5 * noise_m);
  if (!sample.course_rad && way_m.norm() < enough_m) return;
  Mode mode;
  mode.state.head<2>() = sample.place_m;
  mode.covariance.setZero();
  mode.covariance.topLeftCorner<2, 2>() = noise_m * noise_m * Eigen::Matrix2d::Identity();
  mode.state[kCourse] = sample.course_rad.value_or(std::atan2(way_m.x(), way_m.y()));
  mode.covariance(kCourse, kCourse) =
      sample.course_rad ? sample.course_variance_rad2 : kStartCourseRad * kStartCourseRad;
  // Over the last stretch: the first ones may have been driven more slowly, or stood.
  const double last_s = newest_ ? Seconds(sample.stamp_ns - newest_->stamp_ns) : 0;
  if (last_s > 0) mode.state[kSpeed] = (sample.place_m - newest_->place_m).norm() / last_s;
  mode.state[kSpeed] = std::min(mode.state[kSpeed], kMaxSpeedMps);
  mode.covariance(kSpeed, kSpeed) = kStartSpeedMps * kStartSpeedMps;
  mode.covariance(kAcceleration, kAcceleration) =
      config_.acceleration_mps2 * config_.acceleration_mps2;
  const double steady_share = config_.steady_s / (config_.steady_s + config_.bending_s);
  modes_ = {mode, mode};
  modes_[0].weight = steady_share;
  modes_[1].weight = 1 - steady_share;
  modes_[0].sideways_mps2 = config_.steady_mps2;
  modes_[1].sideways_mps2 = config_.sideways_mps2;
  for (Mode& each : modes_) {
    const double bend = CurvatureSigma(each.sideways_mps2, each.state[kSpeed]);
    each.covariance(kCurvature, kCurvature) = bend * bend;
  }
  known_ = true;
  misfits_ = 0;
  Combine();
}

/// Each mode begins with what both believe, by the chance that the road was of the other kind.
void CourseFilter::Mix(double time_s) {
  // A vehicle that stands comes to no other road.
  const double moving_s = state_[kSpeed] > 1 ? time_s : 0;
  const double leaves_steady = 1 - std::exp(-moving_s / config_.steady_s);
  const double leaves_bending = 1 - std::exp(-moving_s / config_.bending_s);
  const double steady = modes_[0].weight;
  const double bending = modes_[1].weight;
  const double steady_next = steady * (1 - leaves_steady) + bending * leaves_bending;
  const double bending_next = 1 - steady_next;
  const std::array<double, 2> to_steady{steady * (1 - leaves_steady) / steady_next,
                                        bending * leaves_bending / steady_next};
  const std::array<double, 2> to_bending{steady * leaves_steady / bending_next,
                                         bending * (1 - leaves_bending) / bending_next};
  std::array<Mode, 2> mixed = modes_;
  MomentsOf(modes_, to_steady, mixed[0].state, mixed[0].covariance);
  MomentsOf(modes_, to_bending, mixed[1].state, mixed[1].covariance);
  mixed[0].weight = steady_next;
  mixed[1].weight = bending_next;
  modes_ = mixed;
}

void CourseFilter::Predict(double time_s, Mode& mode) const {
  const int steps = std::max(1, static_cast<int>(std::ceil(time_s / kMaxStepS)));
  for (int i = 0; i < steps; ++i) Step(time_s / steps, mode);
}

void CourseFilter::Step(double time_s, Mode& mode) const {
  State& state = mode.state;
  const double speed = std::max(0.0, state[kSpeed]);
  const double way_m = speed * time_s;
  const double sine = std::sin(state[kCourse]);
  const double cosine = std::cos(state[kCourse]);
  const double lasting_m = std::max(config_.curvature_way_m, config_.curvature_time_s * speed);
  const double keep_bend = std::exp(-way_m / lasting_m);
  const double keep_push = std::exp(-time_s / config_.acceleration_time_s);

  Covariance f = Covariance::Identity();
  f(kEast, kCourse) = way_m * cosine;
  f(kEast, kSpeed) = time_s * sine;
  f(kNorth, kCourse) = -way_m * sine;
  f(kNorth, kSpeed) = time_s * cosine;
  f(kCourse, kSpeed) = state[kCurvature] * time_s;
  f(kCourse, kCurvature) = way_m;
  f(kSpeed, kAcceleration) = time_s;
  f(kCurvature, kCurvature) = keep_bend;
  f(kAcceleration, kAcceleration) = keep_push;

  state[kEast] += way_m * sine;
  state[kNorth] += way_m * cosine;
  state[kCourse] += state[kCurvature] * way_m;
  state[kSpeed] = std::max(0.0, speed + state[kAcceleration] * time_s);
  state[kCurvature] *= keep_bend;
  state[kAcceleration] *= keep_push;
  if (state[kSpeed] == 0) state[kAcceleration] = std::max(0.0, state[kAcceleration]);

  mode.covariance = f * mode.covariance * f.transpose();
  const double bend = CurvatureSigma(mode.sideways_mps2, speed);
  const double push = config_.acceleration_mps2;
  mode.covariance(kCurvature, kCurvature) += bend * bend * (1 - keep_bend * keep_bend);
  mode.covariance(kAcceleration, kAcceleration) += push * push * (1 - keep_push * keep_push);
}

/// Takes in the position. False when the vehicle moves otherwise than believed: all begins anew.
bool CourseFilter::Update(const Sample& sample) {
  const double noise_m = NoiseM(sample);
  std::array<Mode, 2> updated = modes_;
  std::array<double, 2> weights{};
  bool fits = false;
  for (std::size_t i = 0; i < 2; ++i) {
    const Fit fit = UpdateModePlace(sample.place_m, noise_m, updated[i]);
    fits = fits || fit.distance <= kMisfit;
    weights[i] = updated[i].weight * fit.likelihood;
    if (sample.course_rad) {
      UpdateModeCourse(*sample.course_rad, sample.course_variance_rad2, updated[i]);
    }
  }
  const double sum = weights[0] + weights[1];
  if (!fits || !(sum > 0)) {
    Combine();
    if (++misfits_ < kMisfitsToRestart) return true;
    known_ = false;
    misfits_ = 0;
    start_.reset();
    return false;
  }
  misfits_ = 0;
  modes_ = updated;
  Weigh(weights[0] / sum);
  return true;
}

bool CourseFilter::AddVelocity(const Velocity& velocity) {
  const bool finite = velocity.plane_mps.allFinite() && std::isfinite(velocity.stated_sigma_mps);
  if (!finite || !known_) return false;
  const double noise_mps = std::max(config_.velocity_noise_mps,
                                    config_.velocity_stated_share * velocity.stated_sigma_mps);
  std::array<double, 2> weights{};
  for (std::size_t i = 0; i < 2; ++i) {
    weights[i] = modes_[i].weight * UpdateModeVelocity(velocity.plane_mps, noise_mps, modes_[i]);
  }
  Weigh(weights[0] / (weights[0] + weights[1]));
  return true;
}

void CourseFilter::Weigh(double steady) {
  modes_[0].weight = std::min(std::max(steady, kLeastWeight), 1 - kLeastWeight);
  modes_[1].weight = 1 - modes_[0].weight;
  Combine();
}

void CourseFilter::Combine() {
  MomentsOf(modes_, {modes_[0].weight, modes_[1].weight}, state_, covariance_);
}

}  // namespace livemap::vehicle
