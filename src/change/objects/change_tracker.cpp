#include "change/objects/change_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "common/error.h"

namespace livemap::change {
namespace {

Eigen::Matrix2d TrackerTurnOf(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d forward = pose.linear().col(0);
  const double yaw = std::atan2(forward.y(), forward.x());
  Eigen::Matrix2d turn;
  turn << std::cos(yaw), -std::sin(yaw), std::sin(yaw), std::cos(yaw);
  return turn;
}

Eigen::Vector2d TrackerPlaceOf(const Eigen::Isometry3d& pose) {
  return pose.translation().head<2>();
}

}  // namespace

ChangeTracker::ChangeTracker(const Config& config) : config_(config) {
  if (config.min_seen < 2) {
    throw Error("a change's min_seen is " + std::to_string(config.min_seen) +
                ", accepted are 2 and more: nothing is said from one picture");
  }
}

std::optional<ChangeTracker::Sight> ChangeTracker::Place(const ChangeFrame& frame,
                                                         const ChangeRegion& region) const {
  // The lowest row of the region is where the thing stands; what the picture's edge cuts off stands
  // nobody knows where.
  const cv::Rect& box = region.box;
  if (box.y + box.height >= frame.camera.height) return std::nullopt;
  const Eigen::Vector2d foot(box.x + (box.width - 1) / 2.0, box.y + box.height - 1);
  geo::GroundProjectionNoise noise = config_.ground;
  noise.max_range_m = std::min(noise.max_range_m, config_.max_range_m);
  const auto ground = geo::ProjectToGround(foot, frame.camera, frame.base_from_optical, noise);
  if (!ground) return std::nullopt;
  const Eigen::Matrix2d turn = TrackerTurnOf(frame.map_from_base);
  Sight sight;
  sight.position_m = TrackerPlaceOf(frame.map_from_base) + turn * ground->position_m;
  sight.covariance_m2 =
      turn * ground->covariance_m2 * turn.transpose() +
      Eigen::Matrix2d::Identity() * config_.process_sigma_m * config_.process_sigma_m;
  sight.region = &region;
  if (!sight.position_m.allFinite() || !sight.covariance_m2.allFinite()) return std::nullopt;
  return sight;
}

ChangeTracker::Track* ChangeTracker::Nearest(const Sight& sight, const std::vector<bool>& taken) {
  Track* nearest = nullptr;
  double min_m = config_.max_gate_m;
  for (std::size_t i = 0; i < taken.size(); ++i) {
    Track& track = tracks_[i];
    if (taken[i]) continue;
    const Eigen::Vector2d apart = sight.position_m - track.event.position_m;
    const double distance_m = apart.norm();
    if (distance_m > min_m) continue;
    const Eigen::Matrix2d covariance = sight.covariance_m2 + track.event.covariance_m2;
    const double sigmas = std::sqrt(apart.dot(covariance.inverse() * apart));
    if (distance_m > config_.min_gate_m && !(sigmas <= config_.gate_sigmas)) continue;
    min_m = distance_m;
    nearest = &track;
  }
  return nearest;
}

void ChangeTracker::Update(Track& track, const Sight& sight, const ChangeFrame& frame) const {
  ChangedObject& event = track.event;
  const ChangeRegion& region = *sight.region;
  const Eigen::Vector2d from_m = TrackerPlaceOf(frame.map_from_base);
  if (event.seen == 0) {
    event.position_m = sight.position_m;
    event.covariance_m2 = sight.covariance_m2;
    event.first_ns = frame.stamp_ns;
    track.first_seen_from_m = from_m;
    track.class_weight.assign(protocol::kChangeClasses, 0);
  } else {
    // Two estimates of one place, weighted by what each knows.
    const Eigen::Matrix2d gain =
        event.covariance_m2 * (event.covariance_m2 + sight.covariance_m2).inverse();
    event.position_m += gain * (sight.position_m - event.position_m);
    event.covariance_m2 = (Eigen::Matrix2d::Identity() - gain) * event.covariance_m2;
  }
  ++event.seen;
  event.last_ns = frame.stamp_ns;
  event.earlier_ns = frame.earlier_ns;
  track.travel_m = std::max(track.travel_m, (from_m - track.first_seen_from_m).norm());
  track.confidence_sum += region.confidence;
  track.class_weight[static_cast<std::size_t>(region.change_class)] += region.confidence;
  track.appeared += region.direction == ChangeDirection::kAppeared ? 1 : 0;
  track.vanished += region.direction == ChangeDirection::kVanished ? 1 : 0;
  const auto heaviest = std::max_element(track.class_weight.begin(), track.class_weight.end());
  event.change_class = static_cast<protocol::ChangeClass>(heaviest - track.class_weight.begin());
  const double known = track.appeared + track.vanished;
  event.direction = ChangeDirection::kUnknown;
  if (known > 0 && track.appeared >= config_.min_direction_share * known) {
    event.direction = ChangeDirection::kAppeared;
  } else if (known > 0 && track.vanished >= config_.min_direction_share * known) {
    event.direction = ChangeDirection::kVanished;
  }
}

bool ChangeTracker::IsMissed(const Track& track, const ChangeFrame& frame,
                             const std::vector<ChangeRegion>& regions) const {
  const Eigen::Vector2d ahead_m = TrackerTurnOf(frame.map_from_base).transpose() *
                                  (track.event.position_m - TrackerPlaceOf(frame.map_from_base));
  const double range_m = ahead_m.norm();
  if (range_m > config_.max_range_m || range_m < config_.min_missed_m) return false;
  const Eigen::Vector3d point =
      frame.base_from_optical.inverse() * Eigen::Vector3d(ahead_m.x(), ahead_m.y(), 0);
  if (point.z() < 1) return false;
  const double column = frame.camera.fx * point.x() / point.z() + frame.camera.cx;
  const double row = frame.camera.fy * point.y() / point.z() + frame.camera.cy;
  if (!(column >= 0 && row >= 0 && column < frame.valid.cols && row < frame.valid.rows)) {
    return false;
  }
  const cv::Point foot(static_cast<int>(column), static_cast<int>(row));
  // One that the picture's edge cuts off, or that is taken together with another, is not missed.
  const bool covered = std::any_of(regions.begin(), regions.end(), [&](const ChangeRegion& region) {
    return region.box.contains(foot);
  });
  return !covered && frame.valid.at<std::uint8_t>(foot) != 0;
}

bool ChangeTracker::IsConfirmed(const Track& track) const {
  const ChangedObject& event = track.event;
  const double looked = event.seen + event.missed;
  return event.seen >= config_.min_seen && track.travel_m >= config_.min_travel_m &&
         event.seen >= config_.min_share * looked;
}

void ChangeTracker::LimitTracks() {
  while (tracks_.size() > config_.max_tracks) {
    tracks_.erase(std::min_element(tracks_.begin(), tracks_.end(), [](auto& a, auto& b) {
      return std::tie(a.event.seen, a.event.last_ns) < std::tie(b.event.seen, b.event.last_ns);
    }));
  }
}

std::vector<ChangedObject> ChangeTracker::Add(const ChangeFrame& frame,
                                              const std::vector<ChangeRegion>& regions) {
  std::vector<ChangedObject> confirmed;
  if (frame.stamp_ns <= last_stamp_ns_) return confirmed;
  if (frame.valid.type() != CV_8UC1 ||
      frame.valid.size() != cv::Size(frame.camera.width, frame.camera.height)) {
    throw Error("a change's mask of what is known is " + std::to_string(frame.valid.cols) + "x" +
                std::to_string(frame.valid.rows) + ", accepted is the camera's size");
  }
  last_stamp_ns_ = frame.stamp_ns;
  std::vector<bool> taken(tracks_.size(), false);
  std::vector<Sight> unmatched;
  for (const ChangeRegion& region : regions) {
    const auto sight = Place(frame, region);
    if (!sight) continue;
    Track* track = Nearest(*sight, taken);
    if (track == nullptr) {
      unmatched.push_back(*sight);
      continue;
    }
    taken[static_cast<std::size_t>(track - tracks_.data())] = true;
    Update(*track, *sight, frame);
  }
  for (std::size_t i = 0; i < taken.size(); ++i) {
    if (!taken[i] && IsMissed(tracks_[i], frame, regions)) ++tracks_[i].event.missed;
  }
  for (const Sight& sight : unmatched) {
    Track track;
    track.event.id = next_id_++;
    Update(track, sight, frame);
    tracks_.push_back(track);
  }
  for (Track& track : tracks_) {
    ChangedObject& event = track.event;
    // Their mean, times the share of the pictures that show it.
    event.confidence = track.confidence_sum / (event.seen + event.missed);
    if (track.confirmed || !IsConfirmed(track)) continue;
    track.confirmed = true;
    confirmed.push_back(event);
  }
  LimitTracks();
  return confirmed;
}

std::vector<ChangedObject> ChangeTracker::LeaveBehind(const Eigen::Isometry3d& map_from_base) {
  const Eigen::Matrix2d base_from_map = TrackerTurnOf(map_from_base).transpose();
  std::vector<ChangedObject> passed;
  std::vector<Track> near;
  for (Track& track : tracks_) {
    const Eigen::Vector2d ahead_m =
        base_from_map * (track.event.position_m - TrackerPlaceOf(map_from_base));
    const bool far = ahead_m.norm() > config_.forget_m;
    if (track.confirmed && !track.told_passed && (far || ahead_m.x() < -config_.passed_m)) {
      track.told_passed = true;
      passed.push_back(track.event);
    }
    if (!far) near.push_back(std::move(track));
  }
  tracks_ = std::move(near);
  return passed;
}

std::vector<ChangedObject> ChangeTracker::Restart() {
  std::vector<ChangedObject> untold;
  for (const Track& track : tracks_) {
    if (track.confirmed && !track.told_passed) untold.push_back(track.event);
  }
  tracks_.clear();
  last_stamp_ns_ = std::numeric_limits<std::int64_t>::min();
  return untold;
}

std::vector<ChangedObject> ChangeTracker::Confirmed() const {
  std::vector<ChangedObject> events;
  for (const Track& track : tracks_) {
    if (track.confirmed) events.push_back(track.event);
  }
  std::sort(events.begin(), events.end(),
            [](const ChangedObject& a, const ChangedObject& b) { return a.id < b.id; });
  return events;
}

}  // namespace livemap::change
