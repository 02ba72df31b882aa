#include "vehicle/reporting/hazard_reporter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/time.h"
#include "placement/road_ground_contact.h"

namespace livemap::vehicle {
namespace {

constexpr std::size_t kMaxEarlyPictures = 8;
constexpr double kEndlessRangeM = 1e4;  // The projection's own limit; max_range_m is ours.

VehiclePoseLookup::Config PoseConfigOf(const HazardReporter::Config& config) {
  VehiclePoseLookup::Config pose;
  pose.use_fused = config.position_source == PositionSource::kFused;
  pose.fused_wait_s = config.fused_wait_s;
  pose.bracket_wait_s = config.bracket_wait_s;
  pose.max_wait_s = config.max_wait_s;
  pose.antenna_x_m = config.antenna_x_m;
  pose.antenna_y_m = config.antenna_y_m;
  pose.fixes = config.track;
  pose.poses = config.poses;
  return pose;
}

}  // namespace

HazardReporter::HazardReporter(const Config& config, const protocol::HazardCatalogue& catalogue,
                               std::mt19937_64 random, std::int64_t now_ns, double steady_s)
    : config_(config),
      catalogue_(catalogue),
      random_(random),
      map_(config.map, catalogue, now_ns),
      vehicle_poses_(PoseConfigOf(config)),
      schedule_(config.resend, std::mt19937_64(random_())),
      start_ns_(now_ns),
      start_steady_s_(steady_s) {
  config_.projection.max_range_m = kEndlessRangeM;
  for (const auto& pending : map_.Pending()) {
    const int urgency = catalogue_.Get(pending.class_name).urgency;
    // Never longer than from now on: the clock may have been set since.
    const double left_s =
        pending.hold_until_ns <= 0
            ? 0.0
            : std::clamp(Seconds(pending.hold_until_ns - now_ns), 0.0, HoldS(urgency));
    held_at_start_ = held_at_start_ || (left_s > 0 && !pending.sent);
    schedule_.Add(pending.uuid, urgency, pending.created_ns, steady_s, steady_s + left_s,
                  pending.sent);
  }
}

void HazardReporter::SetMounting(const std::string& frame_id,
                                 const Eigen::Isometry3d& base_from_optical) {
  mountings_[frame_id] = base_from_optical;
}

std::optional<Eigen::Isometry3d> HazardReporter::Mounting(const std::string& frame_id) const {
  const auto found = mountings_.find(frame_id);
  if (found == mountings_.end()) return std::nullopt;
  return found->second;
}

void HazardReporter::AddFix(const geo::Fix& fix) {
  ++counters_.fixes;
  switch (vehicle_poses_.AddFix(fix)) {
    case FixTrack::Verdict::kAccepted:
    case FixTrack::Verdict::kRestarted:
      break;
    case FixTrack::Verdict::kNoFix:
      ++counters_.no_fixes;
      break;
    case FixTrack::Verdict::kInvalid:
    case FixTrack::Verdict::kOutOfOrder:
      ++counters_.invalid_fixes;
      break;
    case FixTrack::Verdict::kJump:
      ++counters_.jumps;
      break;
  }
}

void HazardReporter::AddPose(std::int64_t stamp_ns, const geo::TrackPose& pose) {
  ++counters_.poses;
  if (!vehicle_poses_.AddPose(stamp_ns, pose)) ++counters_.invalid_poses;
}

bool HazardReporter::IsUsable(const placement::Sighting& sighting) {
  if (!placement::IsWellFormed(sighting)) {
    ++counters_.invalid_detections;
    return false;
  }
  if (sighting.confidence < config_.min_confidence) {
    ++counters_.below_confidence;
    return false;
  }
  return true;
}

void HazardReporter::AddFrame(const placement::SightingFrame& frame, double now_s) {
  counters_.detections += frame.sightings.size();
  WaitingFrame waiting;
  waiting.frame = frame;
  waiting.arrival_s = now_s;
  auto& sightings = waiting.frame.sightings;
  sightings.erase(
      std::remove_if(sightings.begin(), sightings.end(),
                     [this](const placement::Sighting& sighting) { return !IsUsable(sighting); }),
      sightings.end());
  const auto picture = early_pictures_.find(frame.stamp_ns);
  if (picture != early_pictures_.end()) {
    waiting.picture = picture->second;
    early_pictures_.erase(picture);
  }
  if (sightings.empty()) return;
  waiting_.push_back(std::move(waiting));
  while (waiting_.size() > static_cast<std::size_t>(config_.max_waiting_frames)) {
    counters_.dropped_no_fix += waiting_.front().frame.sightings.size();
    waiting_.pop_front();
  }
}

void HazardReporter::AddPicture(std::int64_t stamp_ns, const imaging::Picture& picture,
                                const imaging::PixelRegion& part) {
  bool is_known = false;
  for (WaitingFrame& waiting : waiting_) {
    if (waiting.frame.stamp_ns != stamp_ns) continue;
    is_known = true;
    if (imaging::Contains(part, waiting.wanted)) waiting.picture = picture;
  }
  if (is_known || !part.IsWholeImage()) return;
  early_pictures_[stamp_ns] = picture;
  if (early_pictures_.size() > kMaxEarlyPictures) early_pictures_.erase(early_pictures_.begin());
}

void HazardReporter::AddDepth(std::int64_t stamp_ns, const placement::DepthImage& depth) {
  depths_[stamp_ns] = depth;
  if (depths_.size() <= static_cast<std::size_t>(config_.depth_images)) return;
  // The oldest, but for those of before a clock that was set back.
  const bool set_back = depths_.rbegin()->first - stamp_ns > 1'000'000'000;
  depths_.erase(set_back ? std::prev(depths_.end()) : depths_.begin());
}

void HazardReporter::Process(double now_s, double steady_s) {
  ApplyNotices();
  ForgetUnannounced(now_s);
  while (!waiting_.empty() && Advance(waiting_.front(), now_s, steady_s)) waiting_.pop_front();
  // All of them, so that none waits for its picture only after the one before it has waited.
  for (auto waiting = waiting_.begin(); waiting != waiting_.end(); ++waiting) {
    if (IsPlaced(*waiting, now_s) && HasUnknownHazard(*waiting) &&
        !IsCoveredByEarlierFrame(waiting)) {
      AskForPicture(*waiting, now_s);
    }
  }
}

/// Whether the frames before it will have reported all that it shows.
bool HazardReporter::IsCoveredByEarlierFrame(
    std::deque<WaitingFrame>::const_iterator waiting) const {
  const auto is_same = [this](const PlacedSighting& one, const PlacedSighting& other) {
    const std::string& name = one.sighting.class_name;
    return name == other.sighting.class_name &&
           geo::GeodesicDistanceM(one.place.position, other.place.position) <=
               catalogue_.Get(name).duplicate_radius_m;
  };
  const auto will_be_known = [&](const PlacedSighting& candidate) {
    return std::any_of(waiting_.begin(), waiting, [&](const WaitingFrame& earlier) {
      return std::any_of(earlier.candidates.begin(), earlier.candidates.end(),
                         [&](const PlacedSighting& other) { return is_same(candidate, other); });
    });
  };
  return std::all_of(waiting->candidates.begin(), waiting->candidates.end(), will_be_known);
}

bool HazardReporter::IsPlaced(WaitingFrame& waiting, double now_s) {
  // A clock that was set back must not make a frame wait for ever.
  waiting.arrival_s = std::min(waiting.arrival_s, now_s);
  return waiting.placed || Place(waiting, now_s - waiting.arrival_s);
}

bool HazardReporter::HasUnknownHazard(const WaitingFrame& waiting) const {
  return std::any_of(waiting.candidates.begin(), waiting.candidates.end(),
                     [this](const PlacedSighting& candidate) {
                       return !map_.Find(candidate.sighting.class_name, candidate.place.position);
                     });
}

/// True when the frame is done, whatever became of it.
bool HazardReporter::Advance(WaitingFrame& waiting, double now_s, double steady_s) {
  if (!IsPlaced(waiting, now_s)) return false;
  if (HasUnknownHazard(waiting) && WaitsForPicture(waiting, now_s)) return false;
  ReportCandidates(waiting, steady_s);
  return true;
}

void HazardReporter::AskForPicture(WaitingFrame& waiting, double now_s) {
  if (waiting.asked_s || !waiting.picture.bgr.empty()) return;
  // A picture that comes unasked is on its way since the frame came.
  waiting.asked_s = config_.pictures_on_demand ? now_s : waiting.arrival_s;
  ++counters_.pictures_requested;
  if (!config_.pictures_on_demand) return;
  waiting.wanted = VisibleRegion(waiting);
  picture_requests_.push_back({waiting.frame.stamp_ns, waiting.wanted});
}

/// What the pictures of its reports may show of the image.
imaging::PixelRegion HazardReporter::VisibleRegion(const WaitingFrame& waiting) const {
  std::optional<imaging::PixelRegion> shown;
  for (const PlacedSighting& candidate : waiting.candidates) {
    const imaging::PixelRegion crop =
        imaging::WidestCrop(candidate.sighting.box, static_cast<int>(waiting.frame.image_width),
                            static_cast<int>(waiting.frame.image_height), config_.picture);
    shown = shown ? imaging::Union(*shown, crop) : crop;
  }
  return shown.value_or(imaging::PixelRegion{});
}

bool HazardReporter::WaitsForPicture(WaitingFrame& waiting, double now_s) {
  if (!waiting.picture.bgr.empty()) return false;
  AskForPicture(waiting, now_s);
  if (!expects_pictures_) return false;
  waiting.asked_s = std::min(*waiting.asked_s, now_s);  // The clock was set back.
  return now_s - *waiting.asked_s < config_.picture_wait_s;
}

std::vector<imaging::PictureRequirements> HazardReporter::TakePictureRequests() {
  return std::exchange(picture_requests_, {});
}

bool HazardReporter::FitsCamera(const placement::SightingFrame& frame) const {
  return intrinsics_ && HasMounting(frame.frame_id) &&
         static_cast<std::uint32_t>(intrinsics_->width) == frame.image_width &&
         static_cast<std::uint32_t>(intrinsics_->height) == frame.image_height;
}

/// Places the frame's sightings as soon as camera and position are known; false while they may yet
/// come. A frame for which they never come ends up placed, without candidates.
bool HazardReporter::Place(WaitingFrame& waiting, double waited_s) {
  const std::size_t count = waiting.frame.sightings.size();
  if (!FitsCamera(waiting.frame)) {
    if (waited_s < config_.max_wait_s) return false;
    counters_.dropped_no_camera += count;
    waiting.placed = true;
    return true;
  }
  if (WaitsForDepth(waiting, waited_s)) return false;
  const VehiclePoseLookup::Lookup lookup = vehicle_poses_.At(waiting.frame.stamp_ns, waited_s);
  if (lookup.answer == VehiclePoseLookup::Answer::kReady) {
    PlaceSightings(waiting, lookup.base, lookup.fused);
    return true;
  }
  if (lookup.unknown && !waiting.held_back) {
    counters_.held_back_no_fix += count;
    waiting.held_back = true;
  }
  if (lookup.answer == VehiclePoseLookup::Answer::kWait) return false;
  counters_.dropped_no_fix += count;
  waiting.placed = true;
  return true;
}

bool HazardReporter::WaitsForDepth(const WaitingFrame& waiting, double waited_s) const {
  return config_.use_depth && waited_s < config_.depth_wait_s &&
         depths_.count(waiting.frame.stamp_ns) == 0;
}

/// Where the sighting's foot stands in base_link; counted where it is not on the road or too far.
std::optional<geo::GroundPoint> HazardReporter::PlaceOnRoad(const placement::SightingFrame& frame,
                                                            const placement::Sighting& sighting,
                                                            double heading_variance_rad2) {
  const Eigen::Isometry3d& mounting = mountings_.at(frame.frame_id);
  const imaging::Box& box = sighting.box;
  std::optional<geo::GroundPoint> ground;
  const auto depth = depths_.find(frame.stamp_ns);
  if (config_.use_depth && depth != depths_.end()) {
    ground = placement::ContactByDepth(depth->second, box, *intrinsics_, mounting,
                                       config_.projection, config_.depth);
    if (ground) ++counters_.distances_by_depth;
  }
  if (!ground && placement::IsCutBySide(box, intrinsics_->width)) {
    ++counters_.cut_by_side;
    return std::nullopt;
  }
  if (!ground) {
    ground = geo::ProjectToGround(placement::ContactPixel(box), *intrinsics_, mounting,
                                  config_.projection);
  }
  if (!ground) {
    ++counters_.not_on_ground;
    return std::nullopt;
  }
  if (!placement::IsNearEnough(*ground, heading_variance_rad2, config_.max_range_m,
                               config_.max_ground_sigma_m)) {
    ++counters_.too_far;
    return std::nullopt;
  }
  return ground;
}

void HazardReporter::PlaceSightings(WaitingFrame& waiting, const geo::TrackPose& base, bool fused) {
  for (const placement::Sighting& sighting : waiting.frame.sightings) {
    const auto ground =
        PlaceOnRoad(waiting.frame, sighting, fused ? base.course_variance_rad2 : 0.0);
    if (!ground) continue;
    waiting.candidates.push_back(
        {sighting, placement::PlaceHazard(base, Eigen::Vector2d::Zero(), *ground)});
    ++(fused ? counters_.placed_by_fusion : counters_.placed_by_fixes);
  }
  waiting.placed = true;
}

}  // namespace livemap::vehicle
