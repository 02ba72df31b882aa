#include "placement/hazard_sights.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "common/time.h"
#include "geo/fix_covariance.h"

namespace livemap::placement {
namespace {

constexpr double kLeastSigmaM = 1e-4;      // Of one sight: keeps the equations regular.
constexpr double kMostOwnPosition = 0.36;  // Of a pose's variance: as the localisation has it.
constexpr double kFixesApartS = 1.0;       // The scatter of fixes so far apart is independent.
constexpr double kConvergedM = 1e-4;
constexpr double kLeastFreedom = 2;  // Of the residuals, to say how far they scatter.
constexpr double kMaxHeadingVariance = 10;
// Columns of the unknowns.
constexpr int kPose = 2;
constexpr int kPitch = 5;
constexpr int kHeight = 6;
constexpr int kDepth = 7;

/// East-north from base_link's x and y.
Eigen::Matrix2d SightRotation(double course_rad) {
  const double sine = std::sin(course_rad);
  const double cosine = std::cos(course_rad);
  Eigen::Matrix2d rotation;
  rotation << sine, -cosine, cosine, sine;
  return rotation;
}

/// What a rotation by 1 rad clockwise does to a point.
Eigen::Vector2d SightSwing(const Eigen::Vector2d& east_north_m) {
  return {east_north_m.y(), -east_north_m.x()};
}

/// The matrix with its negative eigenvalues raised to `least`.
Eigen::Matrix2d PositivePart(const Eigen::Matrix2d& matrix, double least = 0) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(matrix);
  const Eigen::Vector2d raised = solver.eigenvalues().cwiseMax(least);
  return solver.eigenvectors() * raised.asDiagonal() * solver.eigenvectors().transpose();
}

/// Of the position, without what the image has for itself: at most so much of the variance. A
/// receiver never averages its error away by being asked often.
Eigen::Matrix2d LastingPosition(const HazardSight& sight) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes;
  axes.computeDirect(sight.base.covariance_m2, Eigen::EigenvaluesOnly);
  const double most_m2 = kMostOwnPosition * std::max(0.0, axes.eigenvalues().minCoeff());
  const double own_m2 = std::min(sight.own_position_sigma_m * sight.own_position_sigma_m, most_m2);
  return sight.base.covariance_m2 - own_m2 * Eigen::Matrix2d::Identity();
}

Eigen::Matrix2d OwnPosition(const HazardSight& sight) {
  return sight.base.covariance_m2 - LastingPosition(sight);
}

double LastingHeading(const HazardSight& sight) {
  return sight.base.course_variance_rad2 * (1 - sight.own_heading_share);
}

bool IsUsablePose(const geo::TrackPose& base) {
  return geo::IsValid(base.position) && geo::IsFixCovariance(base.covariance_m2) &&
         std::isfinite(base.course_rad) && std::isfinite(base.speed_mps) &&
         base.course_variance_rad2 >= 0 && base.course_variance_rad2 <= kMaxHeadingVariance &&
         base.position_course.allFinite();
}

bool IsUsableSight(const HazardSight& sight) {
  const geo::GroundProjectionNoise& noise = sight.noise;
  const bool noise_is_one = std::isfinite(noise.pixel_sigma_px) && noise.pixel_sigma_px >= 0 &&
                            std::isfinite(noise.pitch_sigma_rad) && noise.pitch_sigma_rad >= 0 &&
                            std::isfinite(noise.height_sigma_m) && noise.height_sigma_m >= 0;
  const double depth_share = sight.depth_sigma_share.value_or(0);
  return noise_is_one && IsUsablePose(sight.base) && sight.pixel.allFinite() &&
         sight.foot.position_m.allFinite() && geo::IsFixCovariance(sight.foot.covariance_m2) &&
         sight.own_position_sigma_m >= 0 && std::isfinite(sight.own_position_sigma_m) &&
         sight.own_heading_share >= 0 && sight.own_heading_share <= 1 && depth_share >= 0 &&
         depth_share <= 1 &&
         geo::SensitivityOfGroundPoint(sight.foot.position_m, sight.intrinsics,
                                       sight.base_from_optical);
}

/// A foot in base_link and what moves it, at the place where it is expected.
struct SightFoot {
  Eigen::Vector2d foot_m;
  Eigen::Vector2d pitch_m;  // By one standard deviation of each.
  Eigen::Vector2d height_m;
  Eigen::Vector2d depth_m;
  Eigen::Matrix2d pixel_m2;  // And of the pixel.
};

SightFoot FootByPlane(const HazardSight& sight, const Eigen::Vector2d& expected_m) {
  auto moves = geo::SensitivityOfGroundPoint(expected_m, sight.intrinsics, sight.base_from_optical);
  Eigen::Vector2d at_m = expected_m;
  if (!moves) {
    at_m = sight.foot.position_m;
    moves = geo::SensitivityOfGroundPoint(at_m, sight.intrinsics, sight.base_from_optical);
  }
  SightFoot foot;
  foot.foot_m = at_m + moves->per_pixel * (sight.pixel - moves->pixel);
  foot.pitch_m = moves->per_pitch * sight.noise.pitch_sigma_rad;
  foot.height_m = moves->per_height * sight.noise.height_sigma_m;
  foot.depth_m.setZero();
  foot.pixel_m2 = sight.noise.pixel_sigma_px * sight.noise.pixel_sigma_px * moves->per_pixel *
                  moves->per_pixel.transpose();
  return foot;
}

SightFoot FootByDepth(const HazardSight& sight) {
  const Eigen::Vector3d centre = sight.base_from_optical.translation();
  const Eigen::Vector2d& foot_m = sight.foot.position_m;
  const Eigen::Vector3d from_camera_m = Eigen::Vector3d(foot_m.x(), foot_m.y(), 0) - centre;
  SightFoot foot;
  foot.foot_m = foot_m;
  foot.pitch_m =
      Eigen::Vector3d::UnitY().cross(from_camera_m).head<2>() * sight.noise.pitch_sigma_rad;
  foot.height_m.setZero();
  foot.depth_m = from_camera_m.head<2>() * *sight.depth_sigma_share;
  foot.pixel_m2 = PositivePart(sight.foot.covariance_m2 - foot.pitch_m * foot.pitch_m.transpose() -
                               foot.depth_m * foot.depth_m.transpose());
  return foot;
}

}  // namespace

HazardSights::Kept HazardSights::ToKept(const HazardSight& sight) const {
  Kept kept;
  kept.sight = sight;
  kept.base_m = frame_->ToEnu(sight.base.position);
  if (sights_.empty()) return kept;
  const Kept& last = sights_.back();
  const double dt_s = std::abs(Seconds(sight.stamp_ns - last.sight.stamp_ns));
  // Fixes scatter, so that their distance is no way.
  const double step_m = sight.own_position_sigma_m > 0 ? std::abs(sight.base.speed_mps) * dt_s
                                                       : (kept.base_m - last.base_m).norm();
  kept.way_m = last.way_m + step_m;
  kept.share = std::min(1.0, step_m / config_.independent_way_m);
  return kept;
}

bool HazardSights::Add(const HazardSight& sight) {
  if (!IsUsableSight(sight)) return false;
  if (!frame_) frame_.emplace(sight.base.position);
  Kept kept = ToKept(sight);
  if (!sights_.empty() && kept.way_m - sights_.back().way_m < config_.min_way_m) return false;
  sights_.push_back(std::move(kept));
  if (sights_.size() > static_cast<std::size_t>(config_.max_sights)) DropLeastCertain();
  Solve();
  return true;
}

/// Never the newest one, from which the way is counted.
void HazardSights::DropLeastCertain() {
  const auto worst =
      std::max_element(sights_.begin(), std::prev(sights_.end()), [](const Kept& a, const Kept& b) {
        return a.sight.foot.covariance_m2.trace() < b.sight.foot.covariance_m2.trace();
      });
  sights_.erase(worst);
}

/// What another sight's pose states above it, that sight has for itself: weights stay positive.
HazardSights::SharedPose HazardSights::FindSharedPose() const {
  const auto spread_m2 = [](const Kept& kept) {
    return LastingPosition(kept.sight).trace() +
           LastingHeading(kept.sight) * kept.sight.foot.position_m.squaredNorm();
  };
  const Kept& best =
      *std::min_element(sights_.begin(), sights_.end(),
                        [&](const Kept& a, const Kept& b) { return spread_m2(a) < spread_m2(b); });
  SharedPose shared;
  shared.position_m2 = LastingPosition(best.sight);
  shared.heading_rad2 = LastingHeading(best.sight);
  shared.base_m = best.base_m;
  shared.way_m = best.way_m;
  shared.scatter_gain = FixScatterGain();
  Eigen::Matrix3d joint = Eigen::Matrix3d::Zero();
  joint.topLeftCorner<2, 2>() = shared.position_m2;
  joint(2, 2) = shared.heading_rad2;
  if (best.sight.own_heading_share == 0) {
    joint.topRightCorner<2, 1>() = best.sight.base.position_course;
    joint.bottomLeftCorner<1, 2>() = best.sight.base.position_course.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(joint);
  shared.root = axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  return shared;
}

/// Sights between the same two fixes share their scatter: it counts as often as fixes came.
double HazardSights::FixScatterGain() const {
  int count = 0;
  std::int64_t first_ns = sights_.front().sight.stamp_ns;
  std::int64_t last_ns = first_ns;
  for (const Kept& kept : sights_) {
    if (kept.sight.own_position_sigma_m <= 0 && kept.sight.own_heading_share <= 0) continue;
    ++count;
    first_ns = std::min(first_ns, kept.sight.stamp_ns);
    last_ns = std::max(last_ns, kept.sight.stamp_ns);
  }
  return std::max(1.0, count / (1 + std::floor(Seconds(last_ns - first_ns) / kFixesApartS)));
}

HazardSights::Linear HazardSights::Linearise(const Kept& kept, const SharedPose& shared,
                                             const Unknowns& at) const {
  const HazardSight& sight = kept.sight;
  const Eigen::Matrix2d rotation = SightRotation(sight.base.course_rad);
  Eigen::Matrix<double, 2, 3> pose_rows = shared.root.topRows<2>();
  pose_rows += SightSwing(at.head<2>() - shared.base_m) * shared.root.bottomRows<1>();
  // As the poses have it, with what they share.
  const Eigen::Vector2d seen_m = at.head<2>() + pose_rows * at.segment<3>(kPose) - kept.base_m;
  const Eigen::Vector2d swing_m = SightSwing(seen_m);
  const Eigen::Vector2d expected_m = rotation.transpose() * seen_m;
  const SightFoot foot =
      sight.depth_sigma_share ? FootByDepth(sight) : FootByPlane(sight, expected_m);

  const double lasting = config_.lasting_pitch_share;
  const double gain = shared.scatter_gain;
  Linear linear;
  linear.place_m = kept.base_m + rotation * foot.foot_m;
  linear.rows.leftCols<2>().setIdentity();
  linear.rows.middleCols<3>(kPose) = pose_rows;
  linear.rows.col(kPitch) = rotation * foot.pitch_m * std::sqrt(lasting);
  linear.rows.col(kHeight) = rotation * foot.height_m;
  linear.rows.col(kDepth) = rotation * foot.depth_m;
  const double way_m = shared.way_m - kept.way_m;
  const double way_sigma_m = config_.way_sigma_share * way_m;
  const double turn_sigma_rad = config_.heading_sigma_rad_per_m * way_m;
  const double own_heading = std::max(0.0, LastingHeading(sight) - shared.heading_rad2) +
                             gain * sight.base.course_variance_rad2 * sight.own_heading_share +
                             turn_sigma_rad * turn_sigma_rad;
  const Eigen::Matrix2d of_camera =
      foot.pixel_m2 + (1 - lasting) * foot.pitch_m * foot.pitch_m.transpose();
  linear.own_m2 = rotation * of_camera * rotation.transpose() +
                  PositivePart(LastingPosition(sight) - shared.position_m2) +
                  gain * OwnPosition(sight) + own_heading * swing_m * swing_m.transpose();
  linear.own_m2.diagonal().array() += way_sigma_m * way_sigma_m + kLeastSigmaM * kLeastSigmaM;
  return linear;
}

/// The sights' weighted normal equations at `at`, without the prior.
HazardSights::Equations HazardSights::Accumulate(const Unknowns& at) const {
  Equations sum;
  for (const Kept& kept : sights_) {
    const Linear linear = Linearise(kept, shared_, at);
    const Eigen::Vector2d residual_m = linear.place_m - linear.rows * at;
    const Eigen::Matrix2d own = linear.own_m2.inverse();
    const double distance2 = residual_m.dot(own * residual_m);
    const double doubt = 1 + distance2 / (config_.cauchy_scale * config_.cauchy_scale);
    const double weight = kept.share / doubt;
    sum.information += weight * linear.rows.transpose() * own * linear.rows;
    sum.right += weight * linear.rows.transpose() * own * linear.place_m;
    sum.squares += weight * distance2;
    sum.freedom += 2 * kept.share;
  }
  return sum;
}

void HazardSights::Solve() {
  shared_ = FindSharedPose();
  const Kept& nearest =
      *std::min_element(sights_.begin(), sights_.end(), [](const Kept& a, const Kept& b) {
        return a.sight.foot.covariance_m2.trace() < b.sight.foot.covariance_m2.trace();
      });
  solution_.setZero();
  solution_.head<2>() =
      nearest.base_m + SightRotation(nearest.sight.base.course_rad) * nearest.sight.foot.position_m;
  Information prior = Information::Identity();
  prior(0, 0) = prior(1, 1) = 0;
  for (int i = 0; i < config_.iterations; ++i) {
    const Equations equations = Accumulate(solution_);
    const Unknowns next =
        Eigen::LDLT<Information>(equations.information + prior).solve(equations.right);
    const double step_m = (next - solution_).head<2>().norm();
    solution_ = next;
    if (step_m < kConvergedM) break;
  }
  const Equations equations = Accumulate(solution_);
  const double scatter =
      equations.freedom >= kLeastFreedom ? equations.squares / equations.freedom : 1.0;
  covariance_ = Eigen::LDLT<Information>(equations.information / std::max(1.0, scatter) + prior)
                    .solve(Information::Identity());
  KeepPlace(scatter);
}

void HazardSights::KeepPlace(double scatter) {
  // The place with the error of position, but not that of the heading.
  Eigen::Matrix<double, 2, 5> seen;
  seen << Eigen::Matrix2d::Identity(), shared_.root.topRows<2>();
  SightsPlace place;
  place.place.position = frame_->ToGeo(solution_.head<2>());
  const Eigen::Matrix2d total_m2 = covariance_.topLeftCorner<2, 2>();
  place.place.covariance_m2 = 0.5 * (total_m2 + total_m2.transpose());
  place.seen_from_vehicle_m2 = seen * covariance_.topLeftCorner<5, 5>() * seen.transpose();
  place.sights = sights_.size();
  place.scatter = scatter;
  if (place.place.covariance_m2.allFinite() && geo::IsValid(place.place.position)) place_ = place;
}

std::optional<double> HazardSights::Distance2(const HazardSight& sight) const {
  if (!place_ || !IsUsableSight(sight)) return std::nullopt;
  const Linear linear = Linearise(ToKept(sight), shared_, solution_);
  const Eigen::Vector2d residual_m = linear.place_m - linear.rows * solution_;
  // Where its pose is the surer one, what the others state above it is their own.
  const Eigen::Vector2d swing_m = SightSwing(solution_.head<2>() - shared_.base_m);
  const double heading_rad2 = std::max(0.0, shared_.heading_rad2 - LastingHeading(sight));
  const Eigen::Matrix2d of_others_m2 = PositivePart(shared_.position_m2 - LastingPosition(sight)) +
                                       heading_rad2 * swing_m * swing_m.transpose();
  const Eigen::Matrix2d expected_m2 =
      linear.rows * covariance_ * linear.rows.transpose() + linear.own_m2 + of_others_m2;
  const double distance2 = residual_m.dot(expected_m2.inverse() * residual_m);
  if (!std::isfinite(distance2)) return std::nullopt;
  return distance2;
}

}  // namespace livemap::placement
