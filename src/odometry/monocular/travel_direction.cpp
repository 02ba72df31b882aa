#include "odometry/monocular/travel_direction.h"

#include <algorithm>
#include <cmath>

namespace livemap::odometry {
namespace {

constexpr double kTightestTurnRad = 0.7;  // What the tightest turn makes of the direction.

}  // namespace

bool TravelDirection::Add(const Eigen::Isometry3d& step) {
  way_m_ += step.translation();
  length_m_ += step.translation().norm();
  turn_rad_ += std::abs(Eigen::AngleAxisd(step.linear()).angle());
  // Written so that NaN ends the way.
  if (length_m_ < config_.way_m) return true;
  const double direction_rad = std::atan2(way_m_.x(), way_m_.z());
  const bool is_straight = turn_rad_ <= config_.straight_rad_per_m * length_m_;
  way_m_.setZero();
  length_m_ = turn_rad_ = 0;
  // A car that reverses goes along the same line.
  const double off_rad = std::remainder(direction_rad - mean_rad_, M_PI);
  const bool is_known = told_ >= config_.enough;
  if (is_known && !(std::abs(off_rad) <= config_.most_rad)) {
    if (!is_straight && std::abs(off_rad) <= kTightestTurnRad) return true;
    if (++doubts_ < config_.doubts) return true;
    Reset();
    return false;
  }
  doubts_ = 0;
  if (!is_straight) return true;
  told_ = std::min(told_ + 1, config_.remembered);
  mean_rad_ += off_rad / told_;
  return true;
}

void TravelDirection::Reset() { *this = TravelDirection(config_); }

}  // namespace livemap::odometry
