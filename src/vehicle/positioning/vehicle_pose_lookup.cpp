#include "vehicle/positioning/vehicle_pose_lookup.h"

#include <cmath>
#include <optional>

#include "common/time.h"
#include "placement/hazard_placement.h"

namespace livemap::vehicle {
namespace {

// Fused poses come several times a second. When none has come for so long, none is on its way.
constexpr double kNoFusedPoseAfterS = 2.0;

}  // namespace

VehiclePoseLookup::VehiclePoseLookup(const Config& config)
    : config_(config), fixes_(config.fixes), poses_(config.poses) {}

VehiclePoseLookup::Lookup VehiclePoseLookup::At(std::int64_t stamp_ns, double waited_s,
                                                const Patience& patience) const {
  if (config_.use_fused) {
    const FixTrack::Lookup fused = poses_.At(stamp_ns);
    if (fused.answer == FixTrack::Answer::kReady) return {Answer::kReady, fused.pose, true, false};
    if (fused.answer == FixTrack::Answer::kWait && waited_s < patience.fused_wait_s &&
        IsFusedPoseDue(stamp_ns)) {
      return {};
    }
  }
  const FixTrack::Lookup lookup = fixes_.At(stamp_ns);
  switch (lookup.answer) {
    case FixTrack::Answer::kReady:
      return {Answer::kReady, BaseOf(lookup.pose), false, false};
    case FixTrack::Answer::kExtrapolated:
      if (waited_s < patience.bracket_wait_s) return {};
      return {Answer::kReady, BaseOf(lookup.pose), false, false};
    case FixTrack::Answer::kWait:
      return {waited_s < patience.max_wait_s ? Answer::kWait : Answer::kHopeless, {}, false, true};
    case FixTrack::Answer::kHopeless:
      break;
  }
  return {Answer::kHopeless, {}, false, true};
}

bool VehiclePoseLookup::IsFusedPoseDue(std::int64_t stamp_ns) const {
  const std::optional<std::int64_t> newest_ns = poses_.newest_ns();
  return newest_ns && Seconds(stamp_ns - *newest_ns) < kNoFusedPoseAfterS;
}

geo::TrackPose VehiclePoseLookup::BaseOf(const geo::TrackPose& antenna) const {
  const Eigen::Vector2d antenna_m(config_.antenna_x_m, config_.antenna_y_m);
  const geo::GroundPoint origin{Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero()};
  const placement::PlacedHazard placed = placement::PlaceHazard(antenna, antenna_m, origin);
  geo::TrackPose base = antenna;
  base.position = placed.position;
  base.covariance_m2 = placed.covariance_m2;
  // What the course's error does to the way from the antenna, base_link's place shares with it.
  const double sine = std::sin(antenna.course_rad);
  const double cosine = std::cos(antenna.course_rad);
  const Eigen::Vector2d way_m(-sine * antenna_m.x() + cosine * antenna_m.y(),
                              -cosine * antenna_m.x() - sine * antenna_m.y());
  base.position_course += antenna.course_variance_rad2 * Eigen::Vector2d(way_m.y(), -way_m.x());
  return base;
}

}  // namespace livemap::vehicle
