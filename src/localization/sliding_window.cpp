#include "localization/sliding_window.h"

#include <algorithm>
#include <cmath>

#include "common/time.h"
#include "localization/track_alignment.h"

namespace livemap::localization {
namespace {

// The prior of a new window: so wide that the fixes decide.
constexpr double kStartSigmaM = 100;
constexpr double kStartYawSigmaRad = 1;
// A fixed value of the calibration still needs an invertible covariance.
constexpr double kFixedSigma = 1e-7;
constexpr double kLatencyWalkS = 1e-4;  // The latency's change within 1 s, standard deviation.
// A fix is tied anew when the latency has moved by this.
constexpr double kLatencyStepS = 0.005;
constexpr double kSettledS = 2;

StateVector JoinedWindowState(const NodeState& node, const Calibration& calibration) {
  StateVector state;
  state << node, calibration;
  return state;
}

double Squared(double value) { return value * value; }

}  // namespace

SlidingWindow::SlidingWindow(const LocalizerConfig& config)
    : config_(config),
      loss_(config.cauchy_scale),
      prior_(new PriorFactor{&prior_mean_, &prior_root_}) {
  Clear();
}

void SlidingWindow::Clear() {
  nodes_.clear();
  widening_ = 1;
  calibration_ << config_.receiver.latency_s, 0, 0;
  const Calibration sigmas(config_.receiver.latency_sigma_s, config_.odometry.scale_sigma,
                           config_.odometry.yaw_bias_sigma_rps);
  calibration_prior_.setZero();
  calibration_prior_.diagonal().tail<kCalibrationSize>() = sigmas.cwiseMax(kFixedSigma).cwiseAbs2();
}

void SlidingWindow::Start(std::int64_t stamp_ns, const PlanarPose& map_from_base, double widening) {
  widening_ = widening;
  if (!nodes_.empty()) {
    constexpr int kFrom = kNodeSize;
    calibration_prior_.setZero();
    calibration_prior_.block<kCalibrationSize, kCalibrationSize>(kFrom, kFrom) =
        nodes_.back().covariance.block<kCalibrationSize, kCalibrationSize>(kFrom, kFrom);
  }
  nodes_.clear();
  Node& node = nodes_.emplace_back();
  node.stamp_ns = stamp_ns;
  node.state << map_from_base.position_m, map_from_base.yaw_rad, 0, 0;
  node.covariance = calibration_prior_;
  node.covariance.diagonal().head<kNodeSize>() << Squared(kStartSigmaM), Squared(kStartSigmaM),
      Squared(kStartYawSigmaRad), 1, 1;
  SetPrior(JoinedWindowState(node.state, calibration_), node.covariance);
}

void SlidingWindow::SetPrior(const StateVector& mean, const StateMatrix& covariance) {
  prior_mean_ = mean;
  prior_root_ = RootInformation(covariance);
}

void SlidingWindow::AddNode(std::int64_t stamp_ns, const PlanarMotion& from_newest) {
  const Belief belief = CarryOn(Newest(), from_newest);
  Node& node = nodes_.emplace_back();
  node.stamp_ns = stamp_ns;
  node.state = belief.node;
  node.covariance = belief.covariance;
  node.speed_variance =
      from_newest.covariance.topLeftCorner<2, 2>().trace() / std::max(from_newest.time_s, 1e-3);
  node.from_previous =
      std::make_unique<LinkCost>(new LinkFactor(from_newest, config_.receiver.shared_time_s));
}

/// Index of the newest node that is not after a moment; 0 if all are.
std::size_t SlidingWindow::NodeBefore(std::int64_t stamp_ns) const {
  const auto after = std::upper_bound(
      nodes_.begin(), nodes_.end(), stamp_ns,
      [](std::int64_t moment_ns, const Node& node) { return moment_ns < node.stamp_ns; });
  return after == nodes_.begin() ? 0 : static_cast<std::size_t>(after - nodes_.begin()) - 1;
}

void SlidingWindow::Tie(FixMeasurement& fix, std::int64_t node_ns,
                        const OdometryTrack& track) const {
  const std::int64_t moment_ns = fix.stamp_ns - Nanoseconds(latency_s());
  fix.latency_s = latency_s();
  fix.widening = widening_;
  fix.motion = track.Nearby(node_ns, moment_ns);
  fix.velocity_mps = Rotation2(-track.At(node_ns).yaw_rad) * track.VelocityAt(moment_ns);
  fix.reported_velocity_mps = fix.velocity_mps;
}

bool SlidingWindow::AddFix(const FixMeasurement& fix, const OdometryTrack& track) {
  const std::int64_t moment_ns = fix.stamp_ns - Nanoseconds(latency_s());
  if (nodes_.empty() || moment_ns < oldest_ns()) return false;
  Node& node = nodes_[NodeBefore(moment_ns)];
  Fix& added = node.fixes.emplace_back(fix, config_.receiver.antenna_m);
  Tie(added.measurement, node.stamp_ns, track);
  return true;
}

std::optional<double> SlidingWindow::Distance(FixMeasurement& fix,
                                              const OdometryTrack& track) const {
  const std::int64_t moment_ns = fix.stamp_ns - Nanoseconds(latency_s());
  if (nodes_.empty() || moment_ns < oldest_ns()) return std::nullopt;
  const Node& node = nodes_[NodeBefore(moment_ns)];
  Belief belief{node.state, calibration_, node.covariance};
  std::int64_t from_ns = node.stamp_ns;
  if (Seconds(moment_ns - from_ns) > config_.node_spacing_s) {
    belief = CarryOn(belief, track.Between(from_ns, moment_ns));
    from_ns = moment_ns;
  }
  Tie(fix, from_ns, track);
  const FixCost cost(new FixFactor{&fix, config_.receiver.antenna_m});
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, kNodeSize, Eigen::RowMajor> by_node;
  Eigen::Matrix<double, 2, kCalibrationSize, Eigen::RowMajor> by_calibration;
  const double* const parameters[] = {belief.node.data(), belief.calibration.data()};
  double* jacobians[] = {by_node.data(), by_calibration.data()};
  cost.Evaluate(parameters, residual.data(), jacobians);
  Eigen::Matrix<double, 2, kStateSize> jacobian;
  jacobian << by_node, by_calibration;
  const Eigen::Matrix2d innovation =
      Eigen::Matrix2d::Identity() + jacobian * belief.covariance * jacobian.transpose();
  return residual.dot(innovation.inverse() * residual);
}

SlidingWindow::Counts SlidingWindow::Solve(const OdometryTrack& track) {
  Relinearise(track);
  Optimise();
  const Counts counts = Judge();
  // The covariance of the newest node: everything older eliminated one after the other.
  StateInformation information = PriorInformation();
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (i > 0) {
      information = information.PassOn(*nodes_[i].from_previous, nodes_[i - 1].state,
                                       nodes_[i].state, calibration_);
    }
    AddFixes(nodes_[i], information);
  }
  nodes_.back().covariance = information.Covariance();
  return counts;
}

void SlidingWindow::Relinearise(const OdometryTrack& track) {
  for (Node& node : nodes_) {
    for (Fix& fix : node.fixes) {
      fix.measurement.widening = widening_;
      // The newest ones have been tied before the odometry around their moments was known.
      const bool settled = Seconds(newest_ns() - node.stamp_ns) > kSettledS;
      if (settled && std::abs(fix.measurement.latency_s - latency_s()) < kLatencyStepS) continue;
      Tie(fix.measurement, node.stamp_ns, track);
    }
  }
  ShrinkVelocities();
}

/// The latency shows in changes of velocity only. What the odometry's noise feigns of them would
/// claim a latency at constant speed: deviations from the mean shrink by the share that is noise.
void SlidingWindow::ShrinkVelocities() {
  double count = 0;
  double noise = 0;
  double square_sum = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Node& node : nodes_) {
    for (const Fix& fix : node.fixes) {
      count += 1;
      noise += node.speed_variance;
      sum += fix.measurement.reported_velocity_mps;
      square_sum += fix.measurement.reported_velocity_mps.squaredNorm();
    }
  }
  if (count < 2) return;
  const Eigen::Vector2d mean = sum / count;
  const double variance = square_sum / count - mean.squaredNorm();
  const double kept = variance > noise / count ? 1 - noise / count / variance : 0;
  for (Node& node : nodes_) {
    for (Fix& fix : node.fixes) {
      fix.measurement.velocity_mps = mean + kept * (fix.measurement.reported_velocity_mps - mean);
    }
  }
}

void SlidingWindow::Optimise() {
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  problem.AddResidualBlock(&prior_, nullptr, nodes_.front().state.data(), calibration_.data());
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    if (i > 0) {
      problem.AddResidualBlock(node.from_previous.get(), nullptr, nodes_[i - 1].state.data(),
                               node.state.data(), calibration_.data());
    }
    for (Fix& fix : node.fixes) {
      if (!fix.measurement.used) continue;
      problem.AddResidualBlock(&fix.cost, &loss_, node.state.data(), calibration_.data());
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = config_.max_iterations;
  options.function_tolerance = 1e-6;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);  // On failure the states stay as they were.
}

SlidingWindow::Counts SlidingWindow::Judge() {
  Counts counts;
  std::vector<double> squared_distances;
  for (Node& node : nodes_) {
    for (Fix& fix : node.fixes) {
      Eigen::Vector2d residual;
      const double* const parameters[] = {node.state.data(), calibration_.data()};
      fix.cost.Evaluate(parameters, residual.data(), nullptr);
      squared_distances.push_back(residual.squaredNorm());
      const bool used = residual.squaredNorm() <= config_.gate;
      if (used && !fix.measurement.used) ++counts.reinstated;
      if (!used && fix.measurement.used) ++counts.refused;
      fix.measurement.used = used;
    }
  }
  Widen(std::move(squared_distances));
  return counts;
}

/// Receivers state too little at times: the scatter in the window tells. For the next optimisation.
void SlidingWindow::Widen(std::vector<double> squared_distances) {
  constexpr std::size_t kEnough = 20;
  constexpr double kSlowly = 0.1;
  if (squared_distances.size() < kEnough) return;
  for (double& distance : squared_distances) distance *= widening_ * widening_;
  widening_ += kSlowly * (Widening(std::move(squared_distances)) - widening_);
}

StateInformation SlidingWindow::PriorInformation() const {
  StateInformation information;
  information.Add(prior_, nullptr, nodes_.front().state, calibration_);
  return information;
}

void SlidingWindow::AddFixes(const Node& node, StateInformation& information) const {
  for (const Fix& fix : node.fixes) {
    if (fix.measurement.used) information.Add(fix.cost, &loss_, node.state, calibration_);
  }
}

void SlidingWindow::Slide() {
  while (nodes_.size() > 2 && Seconds(newest_ns() - nodes_[1].stamp_ns) >= config_.window_s) {
    StateInformation information = PriorInformation();
    AddFixes(nodes_[0], information);
    information = information.PassOn(*nodes_[1].from_previous, nodes_[0].state, nodes_[1].state,
                                     calibration_);
    StateMatrix covariance = information.Covariance();
    const StateVector mean =
        JoinedWindowState(nodes_[1].state, calibration_) - covariance * information.b;
    // The calibration changes slowly: what is older counts less.
    const double time_s = Seconds(nodes_[1].stamp_ns - nodes_[0].stamp_ns);
    const OdometryModel& odometry = config_.odometry;
    covariance.diagonal().tail<kCalibrationSize>() +=
        time_s * Calibration(config_.receiver.latency_sigma_s > 0 ? kLatencyWalkS : 0,
                             odometry.scale_sigma > 0 ? odometry.scale_walk : 0,
                             odometry.yaw_bias_sigma_rps > 0 ? odometry.yaw_bias_walk_rps : 0)
                     .cwiseAbs2();
    SetPrior(mean, covariance);
    nodes_.pop_front();
    nodes_.front().from_previous.reset();
  }
}

std::pair<std::int64_t, Belief> SlidingWindow::Before(std::int64_t stamp_ns) const {
  const Node& node = nodes_[NodeBefore(stamp_ns)];
  return {node.stamp_ns, {node.state, calibration_, node.covariance}};
}

Belief SlidingWindow::Newest() const {
  const Node& node = nodes_.back();
  return {node.state, calibration_, node.covariance};
}

Belief SlidingWindow::CarryOn(const Belief& belief, const PlanarMotion& motion) const {
  const Calibration& calibration = belief.calibration;
  Belief later = belief;
  const Eigen::Vector2d way_m =
      (1 + calibration[1]) * (motion.way_m + calibration[2] * motion.way_per_bias);
  later.node.head<2>() += Rotation2(belief.node[2]) * way_m;
  later.node[2] = WrapAngle(belief.node[2] + motion.turn_rad - calibration[2] * motion.time_s);
  const LinkFactor link(motion, config_.receiver.shared_time_s);
  later.node.tail<2>() *= link.keep;
  // First-order propagation by the same derivatives as equation (3).
  StateMatrix by_before = StateMatrix::Identity();
  const Eigen::Matrix2d rotation = Rotation2(belief.node[2]);
  by_before.block<2, 1>(0, 2) = TurnedLeft(rotation * way_m);
  by_before.block<2, 1>(0, kNodeSize + 1) =
      rotation * (motion.way_m + calibration[2] * motion.way_per_bias);
  by_before.block<2, 1>(0, kNodeSize + 2) = (1 + calibration[1]) * rotation * motion.way_per_bias;
  by_before(2, kNodeSize + 2) = -motion.time_s;
  by_before(3, 3) = by_before(4, 4) = link.keep;
  later.covariance = by_before * belief.covariance * by_before.transpose();
  later.covariance.topLeftCorner<2, 2>() +=
      rotation * motion.covariance.topLeftCorner<2, 2>() * rotation.transpose();
  const Eigen::Vector2d with_yaw = rotation * motion.covariance.topRightCorner<2, 1>();
  later.covariance.block<2, 1>(0, 2) += with_yaw;
  later.covariance.block<1, 2>(2, 0) += with_yaw.transpose();
  later.covariance(2, 2) += motion.covariance(2, 2);
  later.covariance(3, 3) += link.wander * link.wander;
  later.covariance(4, 4) += link.wander * link.wander;
  return later;
}

}  // namespace livemap::localization
