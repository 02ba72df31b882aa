#include "simulation/vehicle_motion.h"

#include <cmath>

#include "simulation/random.h"

namespace livemap {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
/// Where the car's springs sway: cycles per second.
constexpr double kPitchHz = 1.35;
constexpr double kBounceHz = 1.7;

}  // namespace

VehicleMotion::VehicleMotion(const Street& street, double speed_mps, double start_m)
    : street_(street), speed_mps_(speed_mps), start_m_(start_m) {
  CounterRandom random(street.seed(), 9);
  for (double& phase : phases_) phase = random.Uniform(0.0, kTwoPi);
}

double VehicleMotion::AlongM(double time_s) const {
  // A tenth of the mean speed comes and goes within 14 s.
  const double omega = kTwoPi / 14;
  const double breathing =
      0.1 / omega * (std::sin(omega * time_s + phases_[0]) - std::sin(phases_[0]));
  return start_m_ + speed_mps_ * (time_s + breathing);
}

Eigen::Isometry3d VehicleMotion::WorldFromBase(double time_s) const {
  const double along = AlongM(time_s);
  const double omega = kTwoPi / 90;  // per metre of road
  const double wander = 0.12 * std::sin(omega * along + phases_[1]);
  const double drift = 0.12 * omega * std::cos(omega * along + phases_[1]);
  const double left = street_.lane_left_m() + wander;
  const double sway = std::sin(kTwoPi * kBounceHz * time_s + phases_[2]) *
                      (0.6 + 0.4 * std::sin(0.7 * time_s + phases_[3]));
  const double nod = std::sin(kTwoPi * kPitchHz * time_s + phases_[4]) *
                     (0.6 + 0.4 * std::sin(0.5 * time_s + phases_[5]));
  const double slope = std::atan(street_.line().Slope(along));
  const double crown = static_cast<double>(kCrownFall);
  const Eigen::Vector3d place =
      street_.line().At(along, left, -crown * std::abs(left) + 0.006 * sway);
  return Eigen::Translation3d(place) *
         Eigen::AngleAxisd(street_.line().HeadingRad(along) + drift, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(-slope + 0.0025 * nod, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(crown, Eigen::Vector3d::UnitX());
}

}  // namespace livemap
