#include "odometry/mounting/mounting_calibrator.h"

#include <cmath>
#include <utility>

#include "common/error.h"
#include "odometry/se3.h"

namespace livemap::odometry {
namespace {

/// Longer steps are none: tracking was lost, or the pose jumped.
constexpr double kLongestStepM = 5;

double WayBetween(const Eigen::Isometry3d& one, const Eigen::Isometry3d& other) {
  return (other.translation() - one.translation()).norm();
}

}  // namespace

MountingCalibrator::MountingCalibrator(const Config& config, const geo::CameraIntrinsics& camera)
    : config_(config), camera_(camera), road_(config.road, camera), estimator_(config.estimator) {
  // Written so that NaN is refused.
  if (!(config.assumed.height_m >= 0.3 && config.assumed.height_m <= 5)) {
    throw Error("the camera's assumed height is " + std::to_string(config.assumed.height_m) +
                " m; 0.3 to 5 is accepted");
  }
  for (const double angle :
       {config.assumed.yaw_rad, config.assumed.pitch_rad, config.assumed.roll_rad}) {
    if (!(std::abs(angle) <= 1)) {
      throw Error("an angle of the camera's assumed mounting is " + std::to_string(angle) +
                  " rad; -1 to 1 is accepted");
    }
  }
}

void MountingCalibrator::Add(const CalibrationFrame& frame) {
  if (!frame.tracking || !frame.world_from_camera.matrix().allFinite()) {
    travel_from_.reset();
    road_at_.reset();
    kept_.clear();
    return;
  }
  AddTravel(frame.world_from_camera);
  const double spacing = 0.25 * config_.road_step_m;
  if (!kept_.empty() &&
      WayBetween(kept_.back().world_from_camera, frame.world_from_camera) < spacing) {
    return;
  }
  Kept now;
  // The buffers of the oldest one serve again.
  if (kept_.size() > 1 &&
      WayBetween(kept_[1].world_from_camera, frame.world_from_camera) >= config_.road_step_m) {
    now = std::move(kept_.front());
    kept_.pop_front();
  }
  now.images.Build(frame.grey);
  now.world_from_camera = frame.world_from_camera;
  MeasureRoad(now, frame);
  kept_.push_back(std::move(now));
}

/// In the axes of the middle of the step, without what the camera's place on a turning vehicle
/// adds.
void MountingCalibrator::AddTravel(const Eigen::Isometry3d& world_from_camera) {
  if (!travel_from_) travel_from_ = world_from_camera;
  const double way_m = WayBetween(*travel_from_, world_from_camera);
  if (way_m < config_.travel_step_m) return;
  const Eigen::Isometry3d step = travel_from_->inverse() * world_from_camera;
  travel_from_ = world_from_camera;
  if (way_m > kLongestStepM) return;
  const Eigen::AngleAxisd turn(step.linear());
  if (turn.angle() > config_.max_curvature * way_m) {
    ++figures_.curved_steps;
    return;
  }
  const Eigen::AngleAxisd half_back(-0.5 * turn.angle(), turn.axis());
  Mounting mounting = config_.assumed;
  if (const auto guess = Guess()) mounting = *guess;
  const Eigen::Vector3d lever =
      BaseFromOpticalRotation(mounting).transpose() *
      Eigen::Vector3d(config_.forward_m, config_.left_m, mounting.height_m);
  const Eigen::Vector3d travel =
      half_back * step.translation() - turn.angle() * turn.axis().cross(lever);
  estimator_.AddTravel(travel, way_m);
  ++figures_.travel_steps;
}

/// What is known so far; none before there is a direction of travel.
std::optional<Mounting> MountingCalibrator::Guess() const {
  const std::optional<Eigen::Vector3d> forward = estimator_.TravelSoFar();
  if (!forward) return std::nullopt;
  const Mounting tilt = road_guess_.value_or(config_.assumed);
  const Eigen::Vector3d seen_down = AxesInCamera(tilt).down;
  const Eigen::Vector3d down = (seen_down - forward->dot(seen_down) * *forward).normalized();
  Mounting mounting = MountingOfAxes({*forward, down});
  mounting.height_m = tilt.height_m;
  return mounting;
}

void MountingCalibrator::MeasureRoad(const Kept& now, const CalibrationFrame& frame) {
  if (kept_.empty()) return;
  const Kept& before = kept_.front();
  const double way_m = WayBetween(before.world_from_camera, now.world_from_camera);
  if (way_m < config_.road_step_m || way_m > kLongestStepM) return;
  if (road_at_ && WayBetween(*road_at_, now.world_from_camera) < config_.road_every_m) return;
  const std::optional<Mounting> guess = Guess();
  if (!guess) return;
  road_at_ = now.world_from_camera;
  // What is seen now was in view before, too, further ahead.
  const RoadView view{now.images, before.images,
                      before.world_from_camera.inverse() * now.world_from_camera};
  std::optional<RoadPlane> road;
  if (!frame.depth_m.empty()) {
    road = FitRoadPlane(frame.depth_m, camera_, config_.road.patch, *guess);
  } else if (!road_guess_ || failures_ >= config_.max_failures) {
    road = road_.Search(view, *guess);
    ++figures_.searches;
  } else {
    road = road_.Refine(view, *guess);
  }
  if (!road) {
    ++figures_.planes_refused;
    ++failures_;
    return;
  }
  failures_ = 0;
  ++figures_.planes;
  estimator_.AddRoad(*road, frame.depth_m.empty() ? frame.metres_sigma : 0);
  const Eigen::Vector3d forward = AxesInCamera(*guess).forward;
  Mounting seen =
      MountingOfAxes({(forward - forward.dot(road->down) * road->down).normalized(), road->down});
  seen.height_m = road->distance;
  road_guess_ = seen;
}

}  // namespace livemap::odometry
