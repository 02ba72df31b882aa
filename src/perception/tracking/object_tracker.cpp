#include "perception/tracking/object_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/error.h"
#include "common/stamp_gate.h"
#include "common/time.h"

namespace livemap::perception {
namespace {

/// An object nearer to the camera's plane than this is no longer seen, m.
constexpr double kNearestM = 0.3;
/// Step of the numeric derivative of an image position by the way, m.
constexpr double kProbeM = 0.25;

Eigen::Vector2d FootOfTracked(const cv::Rect2f& box) {
  return {double{box.x} + 0.5 * double{box.width}, double{box.y} + double{box.height}};
}

/// A point on the road in the image and its distance along the optical axis.
struct SeenPoint {
  Eigen::Vector2d pixel;
  double depth_m;
};

std::optional<SeenPoint> TrackerLook(const Eigen::Vector3d& in_base, const CameraMotion& motion) {
  const Eigen::Vector3d p = motion.base_from_optical.inverse() * in_base;
  // Written so that NaN is refused too.
  if (!(p.z() >= kNearestM)) return std::nullopt;
  const geo::CameraIntrinsics& camera = motion.intrinsics;
  return SeenPoint{{camera.fx * p.x() / p.z() + camera.cx, camera.fy * p.y() / p.z() + camera.cy},
                   p.z()};
}

std::optional<Eigen::Vector3d> TrackedOnRoad(const Eigen::Vector2d& pixel,
                                             const CameraMotion& motion) {
  const auto point = ProjectToGround(pixel, motion.intrinsics, motion.base_from_optical, {});
  if (!point) return std::nullopt;
  return Eigen::Vector3d(point->position_m.x(), point->position_m.y(), 0);
}

bool TrackedTouchesBorder(const cv::Rect2f& box, cv::Size image) {
  constexpr float kEdgePx = 1.5F;
  return box.x < kEdgePx || box.y < kEdgePx ||
         box.x + box.width > static_cast<float>(image.width) - kEdgePx ||
         box.y + box.height > static_cast<float>(image.height) - kEdgePx;
}

void CheckTrackerConfig(const char* name, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    throw Error(std::string("the tracker's ") + name + " is " + std::to_string(value) +
                ", accepted is " + std::to_string(least) + " to " + std::to_string(most));
  }
}

}  // namespace

ObjectTracker::ObjectTracker(const Config& config, std::vector<float> thresholds)
    : config_(config), thresholds_(std::move(thresholds)) {
  constexpr double kMost = 1e6;
  CheckTrackerConfig("low_share", config_.low_share, 0.01, 1);
  CheckTrackerConfig("sure", config_.sure, 0.01, 100);
  CheckTrackerConfig("repeat_gain", config_.repeat_gain, 0, 1);
  CheckTrackerConfig("gate", config_.gate, 0.1, kMost);
  CheckTrackerConfig("pixel_sigma_px", config_.pixel_sigma_px, 0.1, kMost);
  CheckTrackerConfig("size_sigma", config_.size_sigma, 0.01, kMost);
  CheckTrackerConfig("good_range_m", config_.good_range_m, 0.1, kMost);
  CheckTrackerConfig("good_side_px", config_.good_side_px, 0.1, kMost);
  CheckTrackerConfig("max_delay_s", config_.max_delay_s, 0, kMost);
  CheckTrackerConfig("max_unseen_s", config_.max_unseen_s, 0, kMost);
  CheckTrackerConfig("max_tracks", config_.max_tracks, 1, 10000);
}

std::vector<ObjectEvent> ObjectTracker::Add(const TrackerFrame& frame) {
  ++counters_.frames;
  if (newest_ns_ && IsSetBack(frame.stamp_ns, *newest_ns_)) StartAnew();
  if (newest_ns_ && frame.stamp_ns <= *newest_ns_) {
    ++counters_.late;
    return {};
  }
  newest_ns_ = frame.stamp_ns;

  std::vector<HazardDetection> strong;
  std::vector<HazardDetection> weak;
  for (const HazardDetection& found : frame.detections) {
    if (!IsUsable(found)) {
      ++counters_.refused;
      continue;
    }
    const double share =
        double{found.confidence} / double{thresholds_[static_cast<std::size_t>(found.class_index)]};
    if (share < config_.low_share) continue;
    (share >= 1 ? strong : weak).push_back(found);
  }

  std::vector<Expected> expected;
  for (const Track& track : tracks_) expected.push_back(Expect(track, frame));
  std::vector<bool> seen(tracks_.size(), false);
  Associate(frame, expected, strong, seen);
  Associate(frame, expected, weak, seen);

  std::vector<ObjectEvent> events;
  std::vector<Track> living;
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    Track& track = tracks_[i];
    const bool gone = !seen[i] && (expected[i].behind || expected[i].way_m > config_.max_unseen_m ||
                                   Seconds(frame.stamp_ns - track.last_ns) > config_.max_unseen_s);
    if (IsDue(track, seen[i], gone, frame.stamp_ns)) events.push_back(Report(track));
    if (!gone) living.push_back(std::move(track));
  }
  tracks_ = std::move(living);
  // Weak detections begin tracks too: several of them may make an object sure.
  strong.insert(strong.end(), weak.begin(), weak.end());
  for (const HazardDetection& found : strong) {
    Begin(found, frame);
    Track& track = tracks_.back();
    if (IsDue(track, true, false, frame.stamp_ns)) events.push_back(Report(track));
    if (tracks_.size() > static_cast<std::size_t>(config_.max_tracks)) {
      tracks_.erase(std::min_element(
          tracks_.begin(), tracks_.end(),
          [this](const Track& a, const Track& b) { return Evidence(a) < Evidence(b); }));
      ++counters_.forgotten;
    }
  }
  return events;
}

void ObjectTracker::StartAnew() {
  tracks_.clear();
  newest_ns_.reset();
  ++counters_.resets;
}

std::vector<ObjectEvent> ObjectTracker::Finish() {
  std::vector<ObjectEvent> events;
  for (Track& track : tracks_) {
    if (IsDue(track, false, true, track.last_ns)) events.push_back(Report(track));
  }
  tracks_.clear();
  newest_ns_.reset();
  return events;
}

std::vector<std::int64_t> ObjectTracker::BestViews() const {
  std::vector<std::int64_t> stamps;
  for (const Track& track : tracks_) {
    if (!track.reported) stamps.push_back(track.best.stamp_ns);
  }
  return stamps;
}

bool ObjectTracker::IsUsable(const HazardDetection& found) const {
  const cv::Rect2f& box = found.box;
  return found.class_index >= 0 &&
         static_cast<std::size_t>(found.class_index) < thresholds_.size() &&
         found.confidence >= 0 && found.confidence <= 1 && std::isfinite(box.x) &&
         std::isfinite(box.y) && std::isfinite(box.width) && std::isfinite(box.height) &&
         box.width > 0 && box.height > 0;
}

ObjectTracker::Expected ObjectTracker::Expect(const Track& track, const TrackerFrame& frame) const {
  if (frame.motion && track.last_motion) {
    if (const auto expected = ExpectByMotion(track, *frame.motion)) return *expected;
  }
  return ExpectByVelocity(track, frame);
}

std::optional<ObjectTracker::Expected> ObjectTracker::ExpectByMotion(
    const Track& track, const CameraMotion& motion) const {
  const CameraMotion& before = *track.last_motion;
  const auto on_road = TrackedOnRoad(FootOfTracked(track.last.box), before);
  if (!on_road) return std::nullopt;
  const auto seen_before = TrackerLook(*on_road, before);
  const Eigen::Isometry3d base_from_before =
      motion.world_from_base.inverse() * before.world_from_base;
  if (!seen_before || !base_from_before.matrix().allFinite()) return std::nullopt;

  Expected expected;
  expected.way_m = base_from_before.translation().norm();
  const Eigen::Vector3d in_base = base_from_before * *on_road;
  const auto now = TrackerLook(in_base, motion);
  const auto probe = TrackerLook(in_base - kProbeM * Eigen::Vector3d::UnitX(), motion);
  if (!now || !probe) {
    expected.behind = true;
    return expected;
  }
  expected.behind = now->pixel.y() > 1.15 * motion.intrinsics.height;
  const double growth = seen_before->depth_m / now->depth_m;
  expected.foot_px = now->pixel;
  expected.width_px = growth * double{track.last.box.width};
  expected.upright_height_px = growth * double{track.last.box.height};
  expected.flat_height_px = growth * expected.upright_height_px;

  const auto square = [](double value) { return value * value; };
  const double placed = square(config_.pixel_sigma_px) * (1 + square(growth));
  const double pitch =
      square(config_.pitch_sigma_rad * motion.intrinsics.fy) * (1 + square(growth));
  const Eigen::Vector2d per_m = (probe->pixel - now->pixel) / kProbeM;
  const double way_sigma = config_.motion_sigma_m + config_.motion_sigma_share * expected.way_m;
  expected.covariance_px2 = square(way_sigma) * per_m * per_m.transpose();
  expected.covariance_px2(0, 0) += placed + square(config_.side_sigma * expected.width_px);
  expected.covariance_px2(1, 1) +=
      placed + pitch + square(config_.side_sigma * expected.flat_height_px);
  return expected;
}

ObjectTracker::Expected ObjectTracker::ExpectByVelocity(const Track& track,
                                                        const TrackerFrame& frame) const {
  Expected expected;
  const double time_s = Seconds(frame.stamp_ns - track.last_ns);
  expected.foot_px = FootOfTracked(track.last.box) + time_s * track.velocity_px_s;
  expected.width_px = double{track.last.box.width};
  expected.flat_height_px = expected.upright_height_px = double{track.last.box.height};
  // Before the velocity is known, only the gate says how far it may be.
  const double drift = config_.drift_sigma * (track.velocity_known ? 1.0 : 2.0);
  const double sigma_x = config_.pixel_sigma_px + drift * expected.width_px;
  const double sigma_y = config_.pixel_sigma_px + drift * expected.flat_height_px;
  expected.covariance_px2 = Eigen::Vector2d(sigma_x * sigma_x, sigma_y * sigma_y).asDiagonal();
  return expected;
}

double ObjectTracker::Cost(const Track& track, const Expected& expected,
                           const HazardDetection& found) const {
  if (track.last.class_index != found.class_index || expected.behind) {
    return std::numeric_limits<double>::infinity();
  }
  const Eigen::Vector2d off = FootOfTracked(found.box) - expected.foot_px;
  const double width = std::log(double{found.box.width} / expected.width_px);
  // Whether the object lies or stands is not known.
  const double flat = std::log(double{found.box.height} / expected.flat_height_px);
  const double upright = std::log(double{found.box.height} / expected.upright_height_px);
  const double height = std::min(std::abs(flat), std::abs(upright));
  const double size = (width * width + height * height) / (config_.size_sigma * config_.size_sigma);
  return off.dot(expected.covariance_px2.ldlt().solve(off)) + size;
}

void ObjectTracker::Associate(const TrackerFrame& frame, const std::vector<Expected>& expected,
                              std::vector<HazardDetection>& detections, std::vector<bool>& seen) {
  struct Pair {
    double cost;
    std::size_t track;
    std::size_t detection;
  };
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    if (seen[i]) continue;
    for (std::size_t j = 0; j < detections.size(); ++j) {
      const double cost = Cost(tracks_[i], expected[i], detections[j]);
      if (cost <= config_.gate) pairs.push_back({cost, i, j});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.cost < b.cost; });
  std::vector<bool> taken(detections.size(), false);
  for (const Pair& pair : pairs) {
    if (seen[pair.track] || taken[pair.detection]) continue;
    seen[pair.track] = taken[pair.detection] = true;
    See(tracks_[pair.track], detections[pair.detection], frame);
  }
  std::vector<HazardDetection> left;
  for (std::size_t j = 0; j < detections.size(); ++j) {
    if (!taken[j]) left.push_back(std::move(detections[j]));
  }
  detections = std::move(left);
}

void ObjectTracker::See(Track& track, const HazardDetection& found,
                        const TrackerFrame& frame) const {
  const double time_s = Seconds(frame.stamp_ns - track.last_ns);
  if (track.sights > 0 && time_s > 0) {
    track.velocity_px_s = (FootOfTracked(found.box) - FootOfTracked(track.last.box)) / time_s;
    track.velocity_known = true;
  }
  track.last = found;
  track.last_ns = frame.stamp_ns;
  track.last_motion = frame.motion;
  ++track.sights;
  track.best_confidence = std::max(track.best_confidence, double{found.confidence});
  track.sum_confidence += double{found.confidence};
  track.quality = Quality(found, frame);
  if (track.sights == 1 || track.quality > track.best_quality) {
    track.best_quality = track.quality;
    track.best.stamp_ns = frame.stamp_ns;
    track.best.image_size = frame.image_size;
    track.best.detection = found;
  }
  if (!track.sure_ns && Evidence(track) >= config_.sure) track.sure_ns = frame.stamp_ns;
}

void ObjectTracker::Begin(const HazardDetection& found, const TrackerFrame& frame) {
  Track track;
  track.last_ns = frame.stamp_ns;
  See(track, found, frame);
  tracks_.push_back(std::move(track));
  ++counters_.tracks;
}

double ObjectTracker::Quality(const HazardDetection& found, const TrackerFrame& frame) const {
  double quality = double{found.confidence};
  const double side_px = std::sqrt(double{found.box.width} * double{found.box.height});
  quality *= std::min(1.0, side_px / config_.good_side_px);
  if (TrackedTouchesBorder(found.box, frame.image_size)) quality *= config_.cut_share;
  if (frame.motion) {
    if (const auto place = TrackedOnRoad(FootOfTracked(found.box), *frame.motion)) {
      quality *= std::min(1.0, config_.good_range_m / std::max(place->norm(), kNearestM));
    }
  }
  return quality;
}

double ObjectTracker::Evidence(const Track& track) const {
  const double confidence =
      track.best_confidence + config_.repeat_gain * (track.sum_confidence - track.best_confidence);
  return confidence / double{thresholds_[static_cast<std::size_t>(track.last.class_index)]};
}

double ObjectTracker::MaxDelayS(const std::string& class_name) const {
  const auto own = config_.class_max_delay_s.find(class_name);
  return own == config_.class_max_delay_s.end() ? config_.max_delay_s : own->second;
}

bool ObjectTracker::IsDue(Track& track, bool seen, bool gone, std::int64_t now_ns) const {
  if (track.reported || !track.sure_ns) return false;
  const bool past_best = seen && track.quality < config_.past_best_share * track.best_quality;
  return gone || past_best || Seconds(now_ns - *track.sure_ns) >= MaxDelayS(track.last.class_name);
}

ObjectEvent ObjectTracker::Report(Track& track) {
  track.reported = true;
  ++counters_.events;
  ObjectEvent event = track.best;
  event.evidence = Evidence(track);
  event.sights = track.sights;
  return event;
}

}  // namespace livemap::perception
