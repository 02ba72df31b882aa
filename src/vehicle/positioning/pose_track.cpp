#include "vehicle/positioning/pose_track.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "common/time.h"
#include "geo/fix_covariance.h"

namespace livemap::vehicle {
namespace {

bool IsUsableTrackPose(const geo::TrackPose& pose) {
  return geo::IsValid(pose.position) && std::isfinite(pose.course_rad) &&
         std::isfinite(pose.speed_mps) && geo::IsFixCovariance(pose.covariance_m2) &&
         pose.position_course.allFinite() && pose.course_variance_rad2 >= 0 &&
         pose.course_variance_rad2 <= 10;
}

geo::TrackPose PoseBetween(const geo::TrackPose& before, const geo::TrackPose& after,
                           double share) {
  const geo::LocalFrame frame(before.position);
  geo::TrackPose pose;
  pose.position = frame.ToGeo(share * frame.ToEnu(after.position));
  pose.covariance_m2 = (1 - share) * before.covariance_m2 + share * after.covariance_m2;
  pose.course_rad =
      before.course_rad + share * std::remainder(after.course_rad - before.course_rad, 2 * M_PI);
  pose.course_variance_rad2 =
      (1 - share) * before.course_variance_rad2 + share * after.course_variance_rad2;
  pose.position_course = (1 - share) * before.position_course + share * after.position_course;
  pose.speed_mps = (1 - share) * before.speed_mps + share * after.speed_mps;
  return pose;
}

}  // namespace

bool PoseTrack::Add(std::int64_t stamp_ns, const geo::TrackPose& pose, std::int64_t now_ns) {
  if (!IsUsableTrackPose(pose)) return false;
  const StampGate::Verdict stamp = stamps_.Judge(stamp_ns, now_ns);
  if (stamp == StampGate::Verdict::kLate || !StampGate::IsUsable(stamp)) return false;
  // A replay that begins again: nothing of before can be compared.
  if (stamp == StampGate::Verdict::kRestarted) points_.clear();
  points_.push_back({stamp_ns, pose});
  while (Seconds(stamp_ns - points_.front().stamp_ns) > config_.keep_s) points_.pop_front();
  return true;
}

void PoseTrack::Reset() {
  stamps_.Reset();
  points_.clear();
}

FixTrack::Lookup PoseTrack::At(std::int64_t stamp_ns) const {
  using Answer = FixTrack::Answer;
  const auto after = std::lower_bound(
      points_.begin(), points_.end(), stamp_ns,
      [](const Point& point, std::int64_t moment_ns) { return point.stamp_ns < moment_ns; });
  if (after == points_.end()) return {Answer::kWait, {}};
  if (after->stamp_ns == stamp_ns) return {Answer::kReady, after->pose};
  if (after == points_.begin()) return {Answer::kHopeless, {}};
  const Point& before = *std::prev(after);
  const double gap_s = Seconds(after->stamp_ns - before.stamp_ns);
  if (gap_s > config_.max_gap_s) return {Answer::kHopeless, {}};
  return {Answer::kReady,
          PoseBetween(before.pose, after->pose, Seconds(stamp_ns - before.stamp_ns) / gap_s)};
}

std::optional<std::int64_t> PoseTrack::newest_ns() const {
  if (points_.empty()) return std::nullopt;
  return points_.back().stamp_ns;
}

}  // namespace livemap::vehicle
