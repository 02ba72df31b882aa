#include "odometry/edge/aligner.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/median.h"
#include "odometry/edge/seen_movements.h"

namespace livemap::odometry {
namespace {

constexpr std::size_t kChunk = 256;  // Points worked off at once: their arrays stay in the cache.
/// With fewer of the points in view no motion is told; with surfaces, with fewer than the second.
constexpr double kMinVisibleShare = 0.1;
constexpr double kMinMeasuredVisibleShare = 0.03;
constexpr double kFirstDamping = 1e-3;
constexpr double kLastDamping = 1e3;
constexpr float kExplainedPx = 0.75F;  // What is no noise is explained by so much of a pixel.
/// Of a gradient, what its direction errs by, in what is stated: a pixel that sees one ray makes
/// steps of slanted edges, which slide along them. Steps trust it all the same, weak edges are
/// often right.
constexpr float kJaggedShare = 0.12F;
constexpr double kMinGain = 0.25;  // A black image must not explain everything.

/// Least standard deviation of the distances to surfaces: exact depth does not outvote all edges.
constexpr double kLeastSurfaceSigma = 0.005;
/// All surfaces together weigh as much as so many edges: neighbouring pixels of a depth camera err
/// together.
constexpr double kSurfaceWorth = 120;
/// So many parts of the covariance are of surfaces; see PartSize.
constexpr std::size_t kSurfaceParts = 12;

/// Of the unknowns that are solved for; lies on the stack.
using UpToEight = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 8, 8>;
using ConstMap = Eigen::Map<const Eigen::ArrayXf>;

ConstMap AlignerPart(const std::vector<float>& values, std::size_t begin, std::size_t count) {
  return {values.data() + begin, static_cast<Eigen::Index>(count)};
}

/// Points that follow each other err together; so many are one part of the covariance. There must
/// be clearly more parts than unknowns.
std::size_t PartSize(std::size_t points) {
  constexpr std::size_t kParts = 32, kLeast = 16, kMultipleOf = 8;
  return std::clamp(points / kParts / kMultipleOf * kMultipleOf, kLeast, kChunk);
}

/// With the movements that no edge shows. Edges of one direction leave one unseen; its variance is
/// then a quotient of rounding errors, of either sign, or zero.
Matrix6d WithUnseen(const Matrix6d& covariance, const Matrix6d& information) {
  constexpr double kSeenShare = 1e-9;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> known(information);
  const double most = known.eigenvalues().maxCoeff();
  if (!covariance.allFinite() || !(most > 0)) return kUnseenVariance * Matrix6d::Identity();
  const Vector6d unseen =
      (known.eigenvalues().array() < kSeenShare * most).cast<double>() * kUnseenVariance;
  const auto& directions = known.eigenvectors();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> stated(0.5 * (covariance + covariance.transpose()));
  const Vector6d variances = stated.eigenvalues().cwiseAbs();
  return stated.eigenvectors() * variances.asDiagonal() * stated.eigenvectors().transpose() +
         directions * unseen.asDiagonal() * directions.transpose();
}

}  // namespace

void Aligner::Reserve(std::size_t points) {
  whitening_.reserve(points);
  for (Residuals* residuals : {&current_, &candidate_}) {
    residuals->value.reserve(points);
    residuals->visible.reserve(points);
  }
}

void Aligner::Evaluate(const EdgePoints& points, const cv::Mat& grey,
                       const geo::CameraIntrinsics& camera, const AlignmentState& state,
                       Residuals& residuals) const {
  PointProjection projection;
  projection.rotation = state.new_from_reference.linear().cast<float>();
  projection.translation = state.new_from_reference.translation().cast<float>();
  projection.fx = static_cast<float>(camera.fx), projection.fy = static_cast<float>(camera.fy);
  projection.cx = static_cast<float>(camera.cx), projection.cy = static_cast<float>(camera.cy);
  projection.gain = static_cast<float>(state.gain);
  projection.bias = static_cast<float>(state.bias);
  EvaluateResiduals(points, whitening_, grey, projection, residuals);
}

/// Residuals are divided by what they err by, as a multiple of the noise of a grey value: by the
/// place of a steep edge, which is known to a part of a pixel only (Engel et al. 2018 weigh by the
/// gradient, too), or by depths that are not exact, equation (12) of
/// docs/explanation/monocular-odometry.md, at the motion that the alignment starts with. Those were
/// estimated from the places of edges, so that what a place errs by is in them.
void Aligner::Whiten(const EdgePoints& points, const Eigen::Isometry3d& new_from_reference) {
  whitening_.resize(points.size());
  const auto per_grey = static_cast<float>(1 / config_.grey_sigma);
  const float per_slope = PerSlope(points);
  for (std::size_t begin = 0; begin < points.size(); begin += kChunk) {
    const std::size_t count = std::min(kChunk, points.size() - begin);
    Eigen::Map<Eigen::ArrayXf>(whitening_.data() + begin, static_cast<Eigen::Index>(count)) =
        1 + (per_slope * AlignerPart(points.slope, begin, count)).square();
  }
  if (!points.inverse_depth_sigma.empty()) {
    const Eigen::Vector3f way =
        (new_from_reference.linear().transpose() * new_from_reference.translation()).cast<float>();
    for (std::size_t i = 0; i < whitening_.size(); ++i) {
      const float by_inverse_depth =
          points.z[i] * (points.jacobian[0][i] * way.x() + points.jacobian[1][i] * way.y() +
                         points.jacobian[2][i] * way.z());
      const float more = by_inverse_depth * points.inverse_depth_sigma[i] * per_grey;
      whitening_[i] += more * more;
    }
  }
  for (std::size_t begin = 0; begin < points.size(); begin += kChunk) {
    const std::size_t count = std::min(kChunk, points.size() - begin);
    Eigen::Map<Eigen::ArrayXf> factor(whitening_.data() + begin, static_cast<Eigen::Index>(count));
    factor = factor.rsqrt();
  }
}

/// From the median of the absolute residuals, which half of them may spoil.
double Aligner::RobustSigma(const Residuals& residuals) const {
  constexpr std::size_t kBinsPerLevel = 4;
  std::array<std::size_t, 256 * kBinsPerLevel> histogram{};
  for (std::size_t i = 0; i < residuals.value.size(); ++i) {
    if (residuals.visible[i] == 0) continue;
    const float bin = std::abs(residuals.value[i]) * static_cast<float>(kBinsPerLevel);
    ++histogram[std::min(static_cast<std::size_t>(bin), histogram.size() - 1)];
  }
  std::size_t seen = 0, bin = 0;
  while (bin < histogram.size() && 2 * (seen += histogram[bin]) < residuals.count) ++bin;
  const double median = (static_cast<double>(bin) + 0.5) / static_cast<double>(kBinsPerLevel);
  return std::max(config_.min_sigma, kMedianToSigma * median);
}

/// Mean of Huber's rho over the visible points, equation (3).
double Aligner::RobustCost(const Residuals& residuals, double sigma) const {
  const double least = surfaces_.points == nullptr ? kMinVisibleShare : kMinMeasuredVisibleShare;
  if (static_cast<double>(residuals.count) < least * static_cast<double>(residuals.value.size())) {
    return std::numeric_limits<double>::infinity();
  }
  const auto k = static_cast<float>(config_.huber_k * sigma);
  double sum = 0;
  for (std::size_t begin = 0; begin < residuals.value.size(); begin += kChunk) {
    const std::size_t count = std::min(kChunk, residuals.value.size() - begin);
    const auto magnitude =
        AlignerPart(residuals.value, begin, count).abs();  // 0 where not visible.
    const auto clipped = magnitude.min(k);
    sum += static_cast<double>((clipped * (2 * magnitude - clipped)).sum());
  }
  return (sum + RobustSurfaceCost(residuals, sigma)) / static_cast<double>(residuals.count);
}

void Aligner::MeasureSurfaces(const AlignmentState& state, Residuals& residuals) const {
  residuals.distances.Clear();
  if (surfaces_.points == nullptr) return;
  surfaces_.points->Measure(surfaces_.depth, state.new_from_reference, surfaces_every_,
                            residuals.distances);
}

/// Stays as it was where nothing is measured any more.
void Aligner::UpdateSurfaceSigma() {
  if (current_.distances.measured() == 0) return;
  surface_sigma_ = std::max(kLeastSurfaceSigma, current_.distances.Sigma());
}

/// The surfaces' part of the sum in (3), in squared grey levels. Another surface counts as much as
/// the limit to it, and so does a place where nothing is measured any more.
double Aligner::RobustSurfaceCost(const Residuals& residuals, double sigma) const {
  if (surfaces_.points == nullptr) return 0;
  const auto k = static_cast<float>(config_.huber_k * surface_sigma_);
  const float most = std::max(k, kOtherSurface);
  const auto rho = [k](float magnitude) {
    const float clipped = std::min(magnitude, k);
    return static_cast<double>(clipped * (2 * magnitude - clipped));
  };
  double sum = 0;
  for (std::size_t i = 0; i < residuals.distances.size(); ++i) {
    const float magnitude = std::abs(residuals.distances[i]);
    if (!std::isnan(magnitude)) sum += rho(std::min(magnitude, most));
  }
  const std::size_t measured = residuals.distances.measured();
  const double mean = measured == 0 ? rho(most) : sum / static_cast<double>(measured);
  const double ratio = sigma / surface_sigma_;
  return ratio * ratio * kSurfaceWorth * mean;
}

/// Adds the surfaces to the normal equations, as edges whose residuals have this sigma.
void Aligner::AddSurfaces(double sigma, double gain) {
  const SurfaceDistances& distances = current_.distances;
  surface_parts_ = 0;
  if (distances.measured() == 0) return;
  const double ratio = sigma / surface_sigma_;
  const double worth = ratio * ratio * kSurfaceWorth / static_cast<double>(distances.measured());
  const auto k = static_cast<float>(config_.huber_k * surface_sigma_);
  const float most = std::max(k, kOtherSurface);
  const std::size_t part_size = (distances.size() + kSurfaceParts - 1) / kSurfaceParts;
  Eigen::Matrix<float, 6, 6> sum = Eigen::Matrix<float, 6, 6>::Zero();
  for (std::size_t begin = 0; begin < distances.size(); begin += part_size, ++surface_parts_) {
    SurfacePoints::Row part = SurfacePoints::Row::Zero();
    for (std::size_t i = begin; i < std::min(distances.size(), begin + part_size); ++i) {
      const float distance = distances[i];
      if (!(std::abs(distance) < most)) continue;
      const SurfacePoints::Row& row = surfaces_.points->Jacobian(i * surfaces_every_);
      const SurfacePoints::Row weighted = k / std::max(std::abs(distance), k) * row;
      sum.noalias() += weighted * row.transpose();
      part += distance * weighted;
    }
    // The step is one of the points, times the gain: minus that of the motion.
    Step step = Step::Zero();
    step.head<6>() = -worth / gain * part.cast<double>();
    gradient_ += step;
    scatter_ += step * step.transpose();
  }
  normal_.topLeftCorner<6, 6>() += worth / (gain * gain) * sum.cast<double>();
}

/// Equation (7): the Jacobian is the reference's and stays; only the weights change.
void Aligner::BuildNormalEquations(const EdgePoints& points, double sigma, double gain) {
  const auto huber = static_cast<float>(config_.huber_k * sigma);
  const NormalSums sums =
      SumNormalEquations(points, whitening_, current_, huber, PartSize(points.size()));
  const int unknowns = config_.estimate_illumination ? kUnknowns : 6;
  normal_.setZero();
  scatter_.setZero();
  gradient_.setZero();
  normal_.topLeftCorner(unknowns, unknowns) = sums.normal.topLeftCorner(unknowns, unknowns);
  scatter_.topLeftCorner(unknowns, unknowns) = sums.scatter.topLeftCorner(unknowns, unknowns);
  gradient_.head(unknowns) = sums.gradient.head(unknowns);
  AddSurfaces(sigma, gain);
  normal_.triangularView<Eigen::StrictlyUpper>() = normal_.transpose();
}

/// False when the points do not determine the unknowns.
bool Aligner::Solve(double damping, Step& step) const {
  Normal damped = normal_;
  Step wanted = gradient_;
  const auto hold = [&](int unknown) {
    damped.row(unknown).setZero();
    damped.col(unknown).setZero();
    damped(unknown, unknown) = 1;
    wanted[unknown] = 0;
  };
  if (config_.rotation_only) {
    for (int i = 0; i < 3; ++i) hold(i);
  }
  if (!config_.estimate_illumination) {
    for (int i = 6; i < kUnknowns; ++i) hold(i);
  }
  damped.diagonal() *= 1 + damping;
  const Eigen::LDLT<Normal> factors(damped);
  if (factors.info() != Eigen::Success || !factors.isPositive()) return false;
  step = factors.solve(wanted);
  return step.allFinite();
}

/// Equation (8). The twist was solved for times the gain.
AlignmentState Aligner::Moved(const AlignmentState& state, const Step& step) const {
  AlignmentState moved = state;
  moved.new_from_reference = state.new_from_reference * Se3Exp(-step.head<6>() / state.gain);
  moved.gain = std::clamp(state.gain + step[6], kMinGain, 1 / kMinGain);
  moved.bias += step[7];
  return moved;
}

AlignmentResult Aligner::Align(const EdgePoints& points, const cv::Mat& grey,
                               const geo::CameraIntrinsics& camera, const AlignmentState& start,
                               const SurfaceConstraint& surfaces, std::size_t every) {
  AlignmentResult result;
  result.state = start;
  result.points = points.size();
  surfaces_ = surfaces;
  surfaces_every_ = every;
  Whiten(points, start.new_from_reference);
  Evaluate(points, grey, camera, start, current_);
  MeasureSurfaces(start, current_);
  if (current_.distances.measured() == 0) surfaces_ = {};
  double sigma = RobustSigma(current_);
  UpdateSurfaceSigma();
  double cost = RobustCost(current_, sigma);
  double damping = 0;
  bool stale = true;
  std::optional<SeenMovements> seen;
  Step step;
  while (result.iterations < config_.max_iterations && std::isfinite(cost)) {
    ++result.iterations;
    if (stale) BuildNormalEquations(points, sigma, result.state.gain);
    // Surfaces tell more when they are near.
    const bool is_asked = !seen || (stale && !seen->All());
    stale = false;
    if (is_asked && points.gradient_noise > 0) {
      seen.emplace(PoseInformation(), NoiseInformation(points, camera, sigma, 0));
    }
    if (!Solve(damping, step)) break;
    // Else noise would move the camera along stripes.
    if (seen && !seen->All()) step.head<6>() = seen->Told(step.head<6>());
    const AlignmentState moved = Moved(result.state, step);
    Evaluate(points, grey, camera, moved, candidate_);
    MeasureSurfaces(moved, candidate_);
    const double new_cost = RobustCost(candidate_, sigma);
    const double pixels =
        camera.fx * (step.head<3>().norm() * points.mean_inverse_depth + step.segment<3>(3).norm());
    if (!(new_cost < cost)) {
      damping = std::max(kFirstDamping, damping * 10);
      if (damping > kLastDamping || pixels < config_.converged_px) break;
      continue;
    }
    result.state = moved;
    std::swap(current_, candidate_);
    sigma = RobustSigma(current_);
    UpdateSurfaceSigma();
    cost = RobustCost(current_, sigma);
    damping = damping > kFirstDamping ? damping / 10 : 0;
    stale = true;
    if (pixels < config_.converged_px) break;
  }
  if (stale) BuildNormalEquations(points, sigma, result.state.gain);
  result.state.new_from_reference = Renormalised(result.state.new_from_reference);
  result.cost = cost;
  Summarise(points, camera, sigma, result);
  result.explained = CountExplained(points, current_, result.state.gain, kNoiseGrey);
  return result;
}

double Aligner::CostAt(const EdgePoints& points, const cv::Mat& grey,
                       const geo::CameraIntrinsics& camera, const AlignmentState& state,
                       double sigma) {
  surfaces_ = {};
  Whiten(points, state.new_from_reference);
  Evaluate(points, grey, camera, state, candidate_);
  return RobustCost(candidate_, sigma);
}

/// By how much the residual of an edge errs more for each grey level per px of its slope.
float Aligner::PerSlope(const EdgePoints& points) const {
  if (!points.inverse_depth_sigma.empty()) return 0;
  return static_cast<float>(config_.place_sigma_px / config_.grey_sigma);
}

std::size_t Aligner::CountExplained(const EdgePoints& points, const Residuals& residuals,
                                    double gain, double noise) const {
  const float per_slope = PerSlope(points);
  const auto explained_px = kExplainedPx * static_cast<float>(gain);
  noise *= std::min(1.0, gain);  // Light that fades takes the contrast with it.
  std::size_t explained = 0;
  for (std::size_t begin = 0; begin < points.size(); begin += kChunk) {
    const std::size_t count = std::min(kChunk, points.size() - begin);
    const auto slope = AlignerPart(points.slope, begin, count);
    const auto bound = (explained_px * slope).max(static_cast<float>(noise)) /
                       (1 + (per_slope * slope).square()).sqrt();
    explained += static_cast<std::size_t>(
        ((AlignerPart(residuals.value, begin, count).abs() <= bound).cast<float>() *
         AlignerPart(residuals.visible, begin, count))
            .sum());
  }
  return explained;
}

std::size_t Aligner::ExplainedAt(const EdgePoints& points, const cv::Mat& grey,
                                 const geo::CameraIntrinsics& camera, const AlignmentState& state,
                                 double noise) {
  Whiten(points, state.new_from_reference);
  Evaluate(points, grey, camera, state, candidate_);
  return CountExplained(points, candidate_, state.gain, noise);
}

/// As BuildNormalEquations with the variance of the noise in the place of the gradients' squares;
/// some of the points say enough.
Matrix6d Aligner::NoiseInformation(const EdgePoints& points, const geo::CameraIntrinsics& camera,
                                   double sigma, float jagged_share) const {
  constexpr std::size_t kEvery = 32;
  Eigen::Matrix<float, 6, 6> sum = Eigen::Matrix<float, 6, 6>::Zero();
  const auto k = static_cast<float>(config_.huber_k * sigma);
  const auto fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  Eigen::Matrix<float, 6, 1> across, down;
  for (std::size_t i = 0; i < points.size(); i += kEvery) {
    if (current_.visible[i] == 0) continue;
    const float inverse = 1 / points.z[i], x = points.x[i] * inverse, y = points.y[i] * inverse;
    across << inverse, 0, -x * inverse, -x * y, 1 + x * x, -y;
    down << 0, inverse, -y * inverse, -1 - y * y, x * y, x;
    const float jagged = jagged_share * points.slope[i];
    const float noise = static_cast<float>(points.gradient_noise) + jagged * jagged;
    const float weight =
        noise * whitening_[i] * whitening_[i] * k / std::max(std::abs(current_.value[i]), k);
    sum += (weight * fx * fx) * across * across.transpose() +
           (weight * fy * fy) * down * down.transpose();
  }
  return static_cast<double>(kEvery) * sum.cast<double>();
}

Matrix6d Aligner::PoseInformation() const {
  Matrix6d pose = normal_.topLeftCorner<6, 6>();
  if (!config_.estimate_illumination) return pose;
  const Eigen::Matrix2d light = normal_.bottomRightCorner<2, 2>();
  const Eigen::Matrix<double, 6, 2> mixed = normal_.topRightCorner<6, 2>();
  if (std::abs(light.determinant()) > 0) pose -= mixed * light.inverse() * mixed.transpose();
  return pose;
}

void Aligner::Summarise(const EdgePoints& points, const geo::CameraIntrinsics& camera, double sigma,
                        AlignmentResult& result) const {
  result.sigma = sigma;
  result.surface_sigma = current_.distances.Sigma();
  result.visible = current_.count;
  const auto k = static_cast<float>(config_.huber_k * sigma);
  for (std::size_t i = 0; i < current_.value.size(); ++i) {
    result.inliers += current_.visible[i] > 0 && std::abs(current_.value[i]) <= k ? 1U : 0U;
  }
  // Gain and bias are not known either: their part is taken out (Schur complement).
  const Matrix6d pose = PoseInformation();
  const double square_gain = result.state.gain * result.state.gain;
  result.information = square_gain * pose;
  const int unknowns = config_.estimate_illumination ? kUnknowns : 6;
  const Eigen::LDLT<UpToEight> factors(normal_.topLeftCorner(unknowns, unknowns));
  const UpToEight half = factors.solve(scatter_.topLeftCorner(unknowns, unknowns));
  // Parts that the unknowns were fitted to contradict each other less than others would.
  const std::size_t size = current_.value.size();
  const double parts =
      std::max(2.0, (static_cast<double>(size) / static_cast<double>(PartSize(size)) +
                     static_cast<double>(surface_parts_)) /
                        6);
  const UpToEight whole = factors.solve(half.transpose());
  result.covariance =
      WithUnseen(parts / (parts - 1) / square_gain * whole.topLeftCorner<6, 6>(), pose);
  if (points.gradient_noise > 0) {
    const SeenMovements seen(pose, NoiseInformation(points, camera, sigma, kJaggedShare));
    result.covariance = seen.Widened(result.covariance);
  }
}

}  // namespace livemap::odometry
