#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>

namespace livemap::vehicle {

/// Where the vehicle is, how it moves and how its way bends: Kalman filters of positions, and of
/// velocities where the receiver measures them.
///
/// Two of them run side by side: one believes that the road is steady (straight, or of a curvature
/// that hardly changes), the other that it bends. Each has a weight, by how well it foretells the
/// positions (interacting multiple models: H. A. P. Blom, Y. Bar-Shalom, IEEE Transactions on
/// Automatic Control 33, 1988).
///
/// State: east, north (m), course (rad, clockwise from north), speed (m/s), curvature of the way
/// (1/m, positive to the right), acceleration (m/s^2). The course turns by the curvature over the
/// way driven, so that a standing vehicle keeps it. Curvature and acceleration fade: first-order
/// Gauss-Markov over the way and over time. docs/explanation/driver-alerts.md has the equations.
/// Deterministic. Not thread-safe.
class CourseFilter {
 public:
  struct Config {
    /// Scatter of one fix against its neighbours, standard deviation per axis, m. The error that
    /// neighbouring fixes share does not bend the way.
    double fix_noise_m = 0.6;
    /// The same as a share of what the receiver states; the greater of both counts.
    double stated_share = 0.15;
    /// Of a measured velocity, standard deviation per axis, m/s...
    double velocity_noise_mps = 0.15;
    /// ...and as a share of what the receiver states; the greater of both counts.
    double velocity_stated_share = 0.3;
    /// Sideways acceleration that drivers choose where the road bends, standard deviation, m/s^2:
    /// the curvature is about this by the square of the speed.
    double sideways_mps2 = 1.2;
    /// The same where it is steady.
    double steady_mps2 = 0.07;
    double steady_s = 16;              ///< How long a road stays steady, mean, s.
    double bending_s = 6;              ///< How long it stays bending, mean, s.
    double max_curvature = 0.08;       ///< Standard deviation of the curvature at most, 1/m.
    double curvature_time_s = 4.0;     ///< How long a curvature lasts, s...
    double curvature_way_m = 25;       ///< ...and on what way at least, m.
    double acceleration_mps2 = 1.8;    ///< Standard deviation.
    double acceleration_time_s = 2.5;  ///< How long an acceleration lasts, s.
    double start_way_m = 4;            ///< The course is known after so much way, m.
    double max_gap_s = 5;              ///< After longer without a position all begins anew, s.
  };

  /// A velocity over ground that the receiver measured by the Doppler shift.
  struct Velocity {
    Eigen::Vector2d plane_mps = Eigen::Vector2d::Zero();  ///< East, north.
    double stated_sigma_mps = 0;                          ///< What the receiver says, per axis.
  };

  /// A position at a stamp, on a plane; the course where something else than the positions tells
  /// it.
  struct Sample {
    std::int64_t stamp_ns = 0;
    Eigen::Vector2d place_m = Eigen::Vector2d::Zero();  ///< East, north.
    double stated_sigma_m = 0;                          ///< What the receiver says, per axis.
    std::optional<double> course_rad;
    double course_variance_rad2 = 0;
  };

  using State = Eigen::Matrix<double, 6, 1>;
  using Covariance = Eigen::Matrix<double, 6, 6>;
  enum Index { kEast, kNorth, kCourse, kSpeed, kCurvature, kAcceleration };

  explicit CourseFilter(const Config& config) : config_(config) {}

  /// Takes in a position. False when it is refused: not finite, or not newer than the newest.
  bool Add(const Sample& sample);
  /// Takes in a velocity of the newest position's moment. False when it is refused: not finite, or
  /// course and speed are not known yet.
  bool AddVelocity(const Velocity& velocity);
  /// Forgets everything.
  void Reset();
  /// Moves the plane's origin to `origin_m` of the present plane.
  void MoveOrigin(const Eigen::Vector2d& origin_m);

  /// One belief about the road.
  struct Mode {
    double weight = 0;         ///< The weights of both add up to 1.
    double sideways_mps2 = 0;  ///< As in Config.
    State state = State::Zero();
    Covariance covariance = Covariance::Identity();
  };

  /// Whether position, course and speed are known.
  bool known() const { return known_; }
  /// First the steady one, then the bending one.
  const std::array<Mode, 2>& modes() const { return modes_; }
  /// Of both together.
  const State& state() const { return state_; }
  const Covariance& covariance() const { return covariance_; }
  /// Typical time between two positions, s.
  double period_s() const { return period_s_; }
  /// Standard deviation of the curvature of ways driven at this speed, 1/m.
  double CurvatureSigma(double sideways_mps2, double speed_mps) const;
  const Config& config() const { return config_; }

 private:
  void Start(const Sample& sample);
  void Mix(double time_s);
  void Predict(double time_s, Mode& mode) const;
  void Step(double time_s, Mode& mode) const;
  bool Update(const Sample& sample);
  void Weigh(double steady);
  void Combine();
  double NoiseM(const Sample& sample) const;

  Config config_;
  bool known_ = false;
  int misfits_ = 0;  // Positions in succession that do not fit.
  std::optional<Sample> start_, newest_;
  double period_s_ = 1;
  std::array<Mode, 2> modes_;
  State state_ = State::Zero();
  Covariance covariance_ = Covariance::Identity();
};

}  // namespace livemap::vehicle
