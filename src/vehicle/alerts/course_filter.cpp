#include "vehicle/alerts/course_filter.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/time.h"

namespace livemap::vehicle {
namespace {

constexpr double kMaxStepS = 0.2;      // Of the integration.
constexpr double kMisfit = 40;         // Normalised squared distance of a position that misfits.
constexpr int kMisfitsToRestart = 3;   // In succession.
constexpr double kMaxPeriodS = 2;      // What counts as the time between two positions.
constexpr double kStartSpeedMps = 3;   // Standard deviations of a state that has just begun.
constexpr double kStartCourseRad = 0.2;

}  // namespace

double CourseFilter::CurvatureSigma(double speed_mps) const {
  const double square = std::max(1.0, speed_mps * speed_mps);
  return std::min(config_.sideways_mps2 / square, config_.max_curvature);
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
  if (start_) start_->place_m -= origin_m;
  if (newest_) newest_->place_m -= origin_m;
}

bool CourseFilter::Add(const Sample& sample) {
  const bool finite = sample.place_m.allFinite() && std::isfinite(sample.stated_sigma_m) &&
                      (!sample.course_rad || (std::isfinite(*sample.course_rad) &&
                                              std::isfinite(sample.course_variance_rad2)));
  if (!finite) return false;
  if (newest_ && sample.stamp_ns <= newest_->stamp_ns) return false;
  const double time_s = newest_ ? Seconds(sample.stamp_ns - newest_->stamp_ns) : 0;
  if (time_s > config_.max_gap_s) Reset();
  if (newest_) period_s_ += 0.2 * (std::min(time_s, kMaxPeriodS) - period_s_);
  if (!known_) {
    Start(sample);
  } else {
    Predict(time_s);
    UpdatePlace(sample);
    if (known_ && sample.course_rad) UpdateCourse(sample);
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
  state_.setZero();
  covariance_.setZero();
  state_.head<2>() = sample.place_m;
  covariance_.topLeftCorner<2, 2>() = noise_m * noise_m * Eigen::Matrix2d::Identity();
  if (sample.course_rad) {
    state_[kCourse] = *sample.course_rad;
    covariance_(kCourse, kCourse) = sample.course_variance_rad2;
  } else {
    state_[kCourse] = std::atan2(way_m.x(), way_m.y());
    covariance_(kCourse, kCourse) = kStartCourseRad * kStartCourseRad;
  }
  // Over the last stretch: the first ones may have been driven more slowly, or stood.
  const double last_s = newest_ ? Seconds(sample.stamp_ns - newest_->stamp_ns) : 0;
  if (last_s > 0) state_[kSpeed] = (sample.place_m - newest_->place_m).norm() / last_s;
  state_[kSpeed] = std::min(state_[kSpeed], 60.0);
  covariance_(kSpeed, kSpeed) = kStartSpeedMps * kStartSpeedMps;
  const double bend = CurvatureSigma(state_[kSpeed]);
  covariance_(kCurvature, kCurvature) = bend * bend;
  covariance_(kAcceleration, kAcceleration) =
      config_.acceleration_mps2 * config_.acceleration_mps2;
  known_ = true;
  misfits_ = 0;
}

void CourseFilter::Predict(double time_s) {
  const int steps = std::max(1, static_cast<int>(std::ceil(time_s / kMaxStepS)));
  for (int i = 0; i < steps; ++i) Step(time_s / steps);
}

void CourseFilter::Step(double time_s) {
  const double speed = std::max(0.0, state_[kSpeed]);
  const double way_m = speed * time_s;
  const double sine = std::sin(state_[kCourse]);
  const double cosine = std::cos(state_[kCourse]);
  const double lasting_m =
      std::max(config_.curvature_way_m, config_.curvature_time_s * speed);
  const double keep_bend = std::exp(-way_m / lasting_m);
  const double keep_push = std::exp(-time_s / config_.acceleration_time_s);

  Covariance f = Covariance::Identity();
  f(kEast, kCourse) = way_m * cosine;
  f(kEast, kSpeed) = time_s * sine;
  f(kNorth, kCourse) = -way_m * sine;
  f(kNorth, kSpeed) = time_s * cosine;
  f(kCourse, kSpeed) = state_[kCurvature] * time_s;
  f(kCourse, kCurvature) = way_m;
  f(kSpeed, kAcceleration) = time_s;
  f(kCurvature, kCurvature) = keep_bend;
  f(kAcceleration, kAcceleration) = keep_push;

  state_[kEast] += way_m * sine;
  state_[kNorth] += way_m * cosine;
  state_[kCourse] += state_[kCurvature] * way_m;
  state_[kSpeed] = std::max(0.0, speed + state_[kAcceleration] * time_s);
  state_[kCurvature] *= keep_bend;
  state_[kAcceleration] *= keep_push;
  if (state_[kSpeed] == 0) state_[kAcceleration] = std::max(0.0, state_[kAcceleration]);

  covariance_ = f * covariance_ * f.transpose();
  const double bend = CurvatureSigma(speed);
  const double push = config_.acceleration_mps2;
  covariance_(kCurvature, kCurvature) += bend * bend * (1 - keep_bend * keep_bend);
  covariance_(kAcceleration, kAcceleration) += push * push * (1 - keep_push * keep_push);
}

void CourseFilter::UpdatePlace(const Sample& sample) {
  const double noise_m = NoiseM(sample);
  const Eigen::Matrix2d innovation = covariance_.topLeftCorner<2, 2>() +
                                     noise_m * noise_m * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d inverse = innovation.inverse();
  const Eigen::Vector2d error_m = sample.place_m - state_.head<2>();
  if (error_m.dot(inverse * error_m) > kMisfit) {
    if (++misfits_ >= kMisfitsToRestart) {
      // It moves otherwise than believed: the course begins anew from here.
      known_ = false;
      misfits_ = 0;
      start_ = sample;
    }
    return;
  }
  misfits_ = 0;
  const Eigen::Matrix<double, 6, 2> gain = covariance_.leftCols<2>() * inverse;
  state_ += gain * error_m;
  covariance_ -= gain * covariance_.topRows<2>();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  if (state_[kSpeed] < 0) state_[kSpeed] = 0;
}

void CourseFilter::UpdateCourse(const Sample& sample) {
  const double error_rad = std::remainder(*sample.course_rad - state_[kCourse], 2 * M_PI);
  const double variance =
      covariance_(kCourse, kCourse) + std::max(1e-6, sample.course_variance_rad2);
  const State gain = covariance_.col(kCourse) / variance;
  state_ += gain * error_rad;
  covariance_ -= (gain * covariance_.row(kCourse)).eval();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  if (state_[kSpeed] < 0) state_[kSpeed] = 0;
}

}  // namespace livemap::vehicle
