#include "odometry/monocular/fix_baseline.h"

#include <algorithm>
#include <cmath>

#include "common/time.h"
#include "geo/fix_plausibility.h"
#include "geo/wgs84.h"

namespace livemap::odometry {
namespace {

constexpr double kPosesKeptS = 10;
constexpr std::size_t kFixesWaiting = 100;

}  // namespace

void FixBaseline::AddPose(std::int64_t stamp_ns, const Eigen::Isometry3d& world_from_camera) {
  poses_.push_back({stamp_ns, world_from_camera});
  while (Seconds(stamp_ns - poses_.front().stamp_ns) > kPosesKeptS) poses_.pop_front();
}

void FixBaseline::AddFix(const geo::Fix& fix) {
  if (!fix.has_fix || !geo::IsPlausible(fix)) return;
  if (!fixes_.empty() && fix.stamp_ns <= fixes_.back().stamp_ns) return;
  if (anchor_ && fix.stamp_ns <= anchor_->fix.stamp_ns) return;
  fixes_.push_back(fix);
  if (fixes_.size() > kFixesWaiting) fixes_.pop_front();
}

void FixBaseline::Stretch(double factor) {
  for (Pose& pose : poses_) pose.world_from_camera.translation() *= factor;
  if (anchor_) anchor_->world_from_camera.translation() *= factor;
}

void FixBaseline::Reset() {
  poses_.clear();
  fixes_.clear();
  anchor_.reset();
}

/// None where no two poses close enough in time surround the moment.
std::optional<Eigen::Isometry3d> FixBaseline::PoseAt(std::int64_t stamp_ns) const {
  const auto after =
      std::lower_bound(poses_.begin(), poses_.end(), stamp_ns,
                       [](const Pose& pose, std::int64_t stamp) { return pose.stamp_ns < stamp; });
  if (after == poses_.end()) return std::nullopt;
  if (after->stamp_ns == stamp_ns) return after->world_from_camera;
  if (after == poses_.begin()) return std::nullopt;
  const Pose& before = *std::prev(after);
  const double gap_s = Seconds(after->stamp_ns - before.stamp_ns);
  if (gap_s > config_.max_gap_s) return std::nullopt;
  const double share = Seconds(stamp_ns - before.stamp_ns) / gap_s;
  Eigen::Isometry3d between = before.world_from_camera;
  between.translation() +=
      share * (after->world_from_camera.translation() - before.world_from_camera.translation());
  return between;
}

FixBaseline::Measurement FixBaseline::Compare(const Anchor& from, const Anchor& to) const {
  Measurement compared;
  const Eigen::Vector2d way = geo::LocalFrame(from.fix.position).ToEnu(to.fix.position);
  compared.metres = way.norm();
  const Eigen::Matrix2d covariance = geo::CovarianceOf(from.fix, config_.default_fix_sigma_m) +
                                     geo::CovarianceOf(to.fix, config_.default_fix_sigma_m);
  const Eigen::Vector2d along = compared.metres > 0 ? way.normalized() : Eigen::Vector2d::UnitX();
  const Eigen::AngleAxisd turn(from.world_from_camera.linear().transpose() *
                               to.world_from_camera.linear());
  const double lever_m = config_.lever_m * std::min(std::abs(turn.angle()), 2.0);
  compared.sigma_m = std::sqrt(along.dot(covariance * along) + lever_m * lever_m);
  compared.units =
      (to.world_from_camera.translation() - from.world_from_camera.translation()).norm();
  return compared;
}

std::optional<FixBaseline::Measurement> FixBaseline::Measure() {
  while (!fixes_.empty() && !poses_.empty() && fixes_.front().stamp_ns <= poses_.back().stamp_ns) {
    const geo::Fix fix = fixes_.front();
    fixes_.pop_front();
    const auto pose = PoseAt(fix.stamp_ns);
    if (!pose) continue;
    const Anchor here = {fix, *pose};
    if (!anchor_) {
      anchor_ = here;
      continue;
    }
    const Measurement compared = Compare(*anchor_, here);
    const bool late = Seconds(fix.stamp_ns - anchor_->fix.stamp_ns) >= config_.longest_s;
    const double allowed = late ? config_.worst_sigma : config_.enough_sigma;
    const bool sure = compared.sigma_m <= allowed * compared.metres;
    if (sure || late) anchor_ = here;
    if (sure) return compared;
  }
  return std::nullopt;
}

}  // namespace livemap::odometry
