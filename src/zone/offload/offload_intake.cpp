#include "zone/offload/offload_intake.h"

#include <algorithm>
#include <cmath>

#include "common/number_text.h"
#include "common/sha256.h"
#include "placement/hazard_placement.h"
#include "placement/road_ground_contact.h"
#include "zone/admission/longest_silent.h"

namespace livemap::zone {
namespace {

constexpr double kEndlessM = 1e4;  // The projection's own limit; max_range_m is ours.

}  // namespace

Uuid OffloadReportUuid(const std::string& vehicle_id, std::int64_t stamp_ns,
                       const std::string& class_name, const imaging::Box& box) {
  const auto tenths = [](float px) {
    return "\n" + std::to_string(std::llround(static_cast<double>(px) * 10));
  };
  // Lines: no vehicle id and no class name holds a line end.
  const std::string digest =
      Sha256Hex("candidate\n" + vehicle_id + "\n" + std::to_string(stamp_ns) + "\n" + class_name +
                tenths(box.x_min) + tenths(box.y_min) + tenths(box.x_max) + tenths(box.y_max));
  Uuid uuid;
  for (std::size_t i = 0; i < uuid.bytes.size(); ++i) {
    uuid.bytes[i] =
        static_cast<std::uint8_t>(16 * HexValue(digest[2 * i]) + HexValue(digest[2 * i + 1]));
  }
  uuid.bytes[6] = static_cast<std::uint8_t>((uuid.bytes[6] & 0x0fU) | 0x80U);
  uuid.bytes[8] = static_cast<std::uint8_t>((uuid.bytes[8] & 0x3fU) | 0x80U);
  return uuid;
}

std::string OffloadIntake::Add(protocol::OffloadedFrame frame, std::int64_t now_ns) {
  ++counters_.frames;
  counters_.bytes += frame.image.size();
  // The allowance first: refusing must not be free of charge.
  if (!allowance_.Take(frame.vehicle_id, frame.image.size(), now_ns)) {
    ++counters_.over_allowance;
    return "vehicle has sent more than its allowance";
  }
  if (const auto why = WhyOffloadRefused(frame, config_.limits, now_ns)) {
    ++counters_.refused;
    return why->sentence;
  }
  // Before its place is judged: a frame that comes again does not agree with itself.
  if (!Remember(frame)) {
    ++counters_.repeated;
    return "frame came before";
  }
  if (const auto speed_mps = ChallengePlace(frame, now_ns)) {
    ++counters_.refused;
    ++counters_.too_fast;
    return SpeedText(*speed_mps, config_.speed);
  }
  waiting_bytes_ += frame.image.size();
  waiting_.push_back(std::move(frame));
  while (waiting_.size() > static_cast<std::size_t>(config_.max_waiting) ||
         static_cast<double>(waiting_bytes_) > config_.max_waiting_bytes) {
    waiting_bytes_ -= waiting_.front().image.size();
    waiting_.pop_front();
    ++counters_.displaced;
  }
  return {};
}

/// The speed that the frame's place would need; none when the vehicle can have been there.
std::optional<double> OffloadIntake::ChallengePlace(const protocol::OffloadedFrame& frame,
                                                    std::int64_t now_ns) {
  if (tracks_.count(frame.vehicle_id) == 0) {
    ForgetLongestSilent(tracks_, config_.allowance.max_vehicles);
  }
  Track& known = tracks_[frame.vehicle_id];
  known.heard_ns = now_ns;
  const ReportedFix fix{frame.stamp_ns, frame.base.position,
                        std::sqrt(frame.base.covariance_m2.trace())};
  return Challenge(known.track, fix, config_.speed, false);
}

bool OffloadIntake::Remember(const protocol::OffloadedFrame& frame) {
  const Key key(frame.vehicle_id, frame.stamp_ns);
  if (!remembered_.insert(key).second) return false;
  remembered_order_.push_back(key);
  if (remembered_order_.size() > static_cast<std::size_t>(config_.max_remembered)) {
    remembered_.erase(remembered_order_.front());
    remembered_order_.pop_front();
  }
  return true;
}

const OffloadIntake::Job* OffloadIntake::Next(std::int64_t now_ns, double steady_s) {
  if (waiting_.empty() || in_flight_.size() >= static_cast<std::size_t>(config_.max_in_flight)) {
    return nullptr;
  }
  // A clock that was set back is followed: the detector refuses stamps far ahead of it.
  constexpr std::int64_t kSetBackNs = 1'000'000'000;
  const bool set_back = newest_internal_ns_ - now_ns > kSetBackNs;
  newest_internal_ns_ = set_back ? now_ns : std::max(now_ns, newest_internal_ns_ + 1);
  while (in_flight_.count(newest_internal_ns_) != 0) ++newest_internal_ns_;
  InFlight next;
  next.job.internal_ns = newest_internal_ns_;
  next.job.frame = std::move(waiting_.front());
  next.since_s = steady_s;
  waiting_.pop_front();
  waiting_bytes_ -= next.job.frame.image.size();
  return &in_flight_.emplace(newest_internal_ns_, std::move(next)).first->second.job;
}

void OffloadIntake::Abandon(std::int64_t internal_ns) {
  if (in_flight_.erase(internal_ns) != 0) ++counters_.undecodable;
}

std::vector<std::int64_t> OffloadIntake::Expire(double steady_s) {
  std::vector<std::int64_t> lost;
  for (auto entry = in_flight_.begin(); entry != in_flight_.end();) {
    if (steady_s - entry->second.since_s < config_.detection_timeout_s) {
      ++entry;
      continue;
    }
    lost.push_back(entry->first);
    ++counters_.lost_by_detector;
    entry = in_flight_.erase(entry);
  }
  return lost;
}

std::vector<protocol::Report> OffloadIntake::Finish(std::int64_t internal_ns,
                                                    const placement::SightingFrame& answer) {
  const auto found = in_flight_.find(internal_ns);
  if (found == in_flight_.end()) return {};
  const protocol::OffloadedFrame frame = std::move(found->second.job.frame);
  in_flight_.erase(found);
  ++counters_.detected;
  counters_.sightings += answer.sightings.size();
  if (answer.sightings.empty()) ++counters_.empty;
  std::vector<protocol::Report> reports;
  for (const placement::Sighting& sighting : answer.sightings) {
    if (!IsUsable(sighting)) continue;
    const auto ground = PlaceOnRoad(frame, sighting);
    if (ground) reports.push_back(ReportOf(frame, sighting, *ground));
  }
  counters_.reports += reports.size();
  return reports;
}

bool OffloadIntake::IsUsable(const placement::Sighting& sighting) {
  if (!placement::IsWellFormed(sighting)) {
    ++counters_.invalid_sightings;
    return false;
  }
  if (sighting.confidence < config_.min_confidence) {
    ++counters_.below_confidence;
    return false;
  }
  return true;
}

std::optional<geo::GroundPoint> OffloadIntake::PlaceOnRoad(const protocol::OffloadedFrame& frame,
                                                           const placement::Sighting& sighting) {
  if (placement::IsCutBySide(sighting.box, frame.intrinsics.width)) {
    ++counters_.cut_by_side;
    return std::nullopt;
  }
  geo::GroundProjectionNoise noise = config_.projection;
  noise.max_range_m = kEndlessM;
  auto ground = geo::ProjectToGround(placement::ContactPixel(sighting.box), frame.intrinsics,
                                     frame.base_from_optical, noise);
  if (!ground) {
    ++counters_.not_on_ground;
    return std::nullopt;
  }
  const double heading_variance_rad2 = frame.fused ? frame.base.course_variance_rad2 : 0.0;
  if (!placement::IsNearEnough(*ground, heading_variance_rad2, config_.max_range_m,
                               config_.max_ground_sigma_m)) {
    ++counters_.too_far;
    return std::nullopt;
  }
  return ground;
}

protocol::Report OffloadIntake::ReportOf(const protocol::OffloadedFrame& frame,
                                         const placement::Sighting& sighting,
                                         const geo::GroundPoint& ground) {
  const placement::PlacedHazard foot =
      placement::PlaceHazard(frame.base, Eigen::Vector2d::Zero(), ground);
  const placement::PlacedHazard place = placement::MiddleOf(
      foot, frame.base.position, catalogue_.Get(sighting.class_name).half_depth_m);
  protocol::Report report;
  report.uuid =
      OffloadReportUuid(frame.vehicle_id, frame.stamp_ns, sighting.class_name, sighting.box);
  report.vehicle_id = frame.vehicle_id;
  report.drive_id = frame.drive_id;
  report.stamp_ns = frame.stamp_ns;
  report.class_name = sighting.class_name;
  report.confidence = sighting.confidence;
  report.box = sighting.box;
  report.position = place.position;
  report.covariance_m2 = place.covariance_m2;
  report.image_width = static_cast<std::uint32_t>(frame.intrinsics.width);
  report.image_height = static_cast<std::uint32_t>(frame.intrinsics.height);
  report.image_frame_id = frame.image_frame_id;
  return report;
}

}  // namespace livemap::zone
