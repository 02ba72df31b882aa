#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "localization/localizer_config.h"
#include "localization/odometry_track.h"
#include "localization/state_information.h"
#include "localization/window_factors.h"

namespace livemap::localization {

/// What is believed of a moment: the node's state and the calibration, with their covariance.
struct Belief {
  NodeState node = NodeState::Zero();
  Calibration calibration = Calibration::Zero();
  StateMatrix covariance = StateMatrix::Identity();
};

/// The last seconds of a drive as a least-squares problem: poses ("nodes") tied by odometry, fixes
/// tied to poses, and a prior that stands for everything older. Not thread-safe.
class SlidingWindow {
 public:
  struct Counts {
    std::uint64_t reinstated = 0;  ///< Fixes refused before and used now.
    std::uint64_t refused = 0;     ///< Fixes used before and refused now.
  };

  explicit SlidingWindow(const LocalizerConfig& config);
  SlidingWindow(const SlidingWindow&) = delete;
  SlidingWindow& operator=(const SlidingWindow&) = delete;

  bool empty() const { return nodes_.empty(); }
  std::size_t nodes() const { return nodes_.size(); }
  std::int64_t newest_ns() const { return nodes_.back().stamp_ns; }
  std::int64_t oldest_ns() const { return nodes_.front().stamp_ns; }
  const Calibration& calibration() const { return calibration_; }
  double latency_s() const { return calibration_[0]; }

  /// Begins with one node of a rough pose. The calibration and what is known of it stay.
  void Start(std::int64_t stamp_ns, const PlanarPose& map_from_base, double widening);
  /// How much wider than stated the fixes scatter, at least 1.
  double widening() const { return widening_; }
  /// As after construction.
  void Clear();
  /// A node after the newest one.
  void AddNode(std::int64_t stamp_ns, const PlanarMotion& from_newest);
  /// Ties a fix to the newest node that is not after the moment it speaks of; false when that
  /// moment is older than the window.
  bool AddFix(const FixMeasurement& fix, const OdometryTrack& track);
  /// Fills in the fix's motion and gives its squared Mahalanobis distance to what was believed.
  std::optional<double> Distance(FixMeasurement& fix, const OdometryTrack& track) const;

  /// The optimisation: Ceres over all nodes, then the gate for each fix, then the covariance.
  Counts Solve(const OdometryTrack& track);
  /// Takes nodes older than the window out, their information into the prior.
  void Slide();

  /// Of the newest node that is not after a moment (the oldest, if all are), as it was believed
  /// when it was the newest.
  std::pair<std::int64_t, Belief> Before(std::int64_t stamp_ns) const;
  /// A belief carried on by the odometry.
  Belief CarryOn(const Belief& belief, const PlanarMotion& motion) const;
  /// Of the newest node.
  Belief Newest() const;

 private:
  struct Fix {
    explicit Fix(const FixMeasurement& of, const Eigen::Vector2d& antenna_m)
        : measurement(of), cost(new FixFactor{&measurement, antenna_m}) {}
    Fix(const Fix&) = delete;
    Fix& operator=(const Fix&) = delete;

    FixMeasurement measurement;
    FixCost cost;  // Looks at the measurement.
  };
  struct Node {
    std::int64_t stamp_ns = 0;
    NodeState state = NodeState::Zero();
    std::unique_ptr<LinkCost> from_previous;  // None at the first.
    std::deque<Fix> fixes;
    double speed_variance = 0;  // Of velocity over 1 s, by the odometry's noise.
    StateMatrix covariance = StateMatrix::Identity();  // When it was the newest.
  };

  std::size_t NodeBefore(std::int64_t stamp_ns) const;
  void Tie(FixMeasurement& fix, std::int64_t node_ns, const OdometryTrack& track) const;
  void Relinearise(const OdometryTrack& track);
  void ShrinkVelocities();
  void Optimise();
  Counts Judge();
  void Widen(std::vector<double> squared_distances);
  StateInformation PriorInformation() const;
  void AddFixes(const Node& node, StateInformation& information) const;
  void SetPrior(const StateVector& mean, const StateMatrix& covariance);

  const LocalizerConfig config_;
  ceres::CauchyLoss loss_;
  std::deque<Node> nodes_;
  Calibration calibration_;
  double widening_ = 1;
  StateMatrix calibration_prior_;  // Of the calibration alone, in its corner.
  StateVector prior_mean_;
  StateMatrix prior_root_;
  PriorCost prior_;  // Looks at the two above.
};

}  // namespace livemap::localization
