#pragma once

#include <Eigen/Geometry>

namespace livemap::odometry {

/// Notices when the path of one eye is none that a car can drive: wheels do not slide sideways, so
/// that on a straight road a camera that is fixed to the car moves the same way all the time. One
/// eye that has lost its depths takes a turn for a motion to the side, and the path runs away long
/// before the residuals tell. Not thread-safe.
class TravelDirection {
 public:
  struct Config {
    /// A direction is that of so long a way, m.
    double way_m = 2.0;
    /// Where the car turns more tightly than this, the camera does move sideways, rad/m.
    double straight_rad_per_m = 0.02;
    /// So many ways must have told the direction before another one is doubted,
    int enough = 5;
    /// and so many more are in its mean, the newest count most.
    int remembered = 50;
    /// Further from the mean than this is none of a car, rad,
    double most_rad = 0.07;
    /// when so many ways in succession are.
    int doubts = 2;
  };

  explicit TravelDirection(const Config& config) : config_(config) {}

  /// One step of the camera in metres: its pose as seen from the one before. False when the car
  /// slides; the direction is then forgotten.
  bool Add(const Eigen::Isometry3d& step);
  void Reset();

 private:
  Config config_;
  Eigen::Vector3d way_m_ = Eigen::Vector3d::Zero();  // Camera axes.
  double length_m_ = 0;
  double turn_rad_ = 0;
  double mean_rad_ = 0;  // From the optical axis, positive to the right.
  int told_ = 0;
  int doubts_ = 0;
};

}  // namespace livemap::odometry
