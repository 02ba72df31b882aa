#include "vehicle/reporting/offload_sender.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/stamp_gate.h"
#include "imaging/image_header.h"

namespace livemap::vehicle {
OffloadSender::OffloadSender(const Config& config)
    : config_(config),
      pose_(config.pose),
      budget_({config.max_bytes_per_s * config.burst_s, config.burst_s,
               TokenBucket::StepBack::kFollow}) {}

void OffloadSender::SetMounting(const std::string& frame_id,
                                const Eigen::Isometry3d& base_from_optical) {
  mountings_[frame_id] = base_from_optical;
}

void OffloadSender::StartAnew() {
  pose_.Reset();
  counters_.no_pose += waiting_.size();
  waiting_.clear();
  due_ns_.reset();
  newest_ns_.reset();
}

bool OffloadSender::Takes(std::int64_t stamp_ns) {
  ++counters_.frames;
  if (newest_ns_ && IsSetBack(stamp_ns, *newest_ns_)) due_ns_.reset();
  newest_ns_ = stamp_ns;
  if (due_ns_ && stamp_ns < *due_ns_) {
    ++counters_.rate_skipped;
    return false;
  }
  const auto period_ns = static_cast<std::int64_t>(1e9 / config_.rate_hz);
  // On the beat, so that a camera of nearly rate_hz is not halved; anew after a pause.
  const bool on_beat = due_ns_ && stamp_ns - *due_ns_ < period_ns;
  due_ns_ = (on_beat ? *due_ns_ : stamp_ns) + period_ns;
  ++counters_.taken;
  return true;
}

void OffloadSender::AddJudged(std::int64_t stamp_ns, const std::string& frame_id, float score,
                              bool is_candidate, const CameraImage& image, double now_s) {
  if (!is_candidate) {
    ++counters_.discarded;
    return;
  }
  ++counters_.candidates;
  waiting_.push_back({stamp_ns, frame_id, score, image, now_s});
  while (waiting_.size() > static_cast<std::size_t>(config_.max_waiting_frames)) {
    ++counters_.displaced;
    waiting_.pop_front();
  }
}

std::vector<protocol::OffloadedFrame> OffloadSender::TakeReady(double now_s, const Encode& encode) {
  std::vector<protocol::OffloadedFrame> ready;
  while (!waiting_.empty() && Advance(waiting_.front(), now_s, encode, ready)) waiting_.pop_front();
  return ready;
}

bool OffloadSender::FitsCamera(const Waiting& waiting) const {
  return intrinsics_ && HasMounting(waiting.frame_id) &&
         intrinsics_->width == waiting.image.picture.bgr.cols &&
         intrinsics_->height == waiting.image.picture.bgr.rows;
}

bool OffloadSender::Advance(Waiting& waiting, double now_s, const Encode& encode,
                            std::vector<protocol::OffloadedFrame>& ready) {
  // A clock that was set back must not make a frame wait for ever.
  waiting.arrival_s = std::min(waiting.arrival_s, now_s);
  const double waited_s = now_s - waiting.arrival_s;
  if (!FitsCamera(waiting)) {
    if (waited_s < config_.pose.max_wait_s) return false;
    ++counters_.no_camera;
    return true;
  }
  const VehiclePoseLookup::Lookup lookup = pose_.At(waiting.stamp_ns, waited_s);
  if (lookup.answer == VehiclePoseLookup::Answer::kWait) return false;
  if (lookup.answer == VehiclePoseLookup::Answer::kHopeless) {
    ++counters_.no_pose;
    return true;
  }
  if (last_sent_ &&
      geo::GeodesicDistanceM(*last_sent_, lookup.base.position) < config_.min_spacing_m) {
    ++counters_.same_place;
    return true;
  }
  auto frame = Encoded(waiting, lookup, encode);
  if (!frame) return true;
  last_sent_ = lookup.base.position;
  ++counters_.sent;
  counters_.sent_bytes += frame->image.size();
  ready.push_back(std::move(*frame));
  return true;
}

std::optional<protocol::OffloadedFrame> OffloadSender::Encoded(
    const Waiting& waiting, const VehiclePoseLookup::Lookup& lookup, const Encode& encode) {
  budget_.Refill(waiting.stamp_ns);
  if (budget_.tokens() < config_.min_image_bytes) {
    ++counters_.over_budget;
    return std::nullopt;
  }
  const double most = std::min(budget_.tokens(), static_cast<double>(config_.max_image_bytes));
  protocol::OffloadedFrame frame;
  frame.image = encode(waiting.image, static_cast<std::size_t>(most));
  const auto header = imaging::ReadImageHeader(frame.image.data(), frame.image.size());
  if (!header || header->format != imaging::ImageHeader::Format::kJpeg) {
    ++counters_.withheld;
    return std::nullopt;
  }
  budget_.Spend(static_cast<double>(frame.image.size()));
  frame.drive_id = config_.drive_id;
  frame.stamp_ns = waiting.stamp_ns;
  frame.score = waiting.score;
  frame.base = lookup.base;
  frame.fused = lookup.fused;
  frame.intrinsics = Resized(*intrinsics_, header->width, header->height);
  frame.base_from_optical = mountings_.at(waiting.frame_id);
  frame.image_frame_id = waiting.frame_id;
  return frame;
}

geo::CameraIntrinsics Resized(const geo::CameraIntrinsics& intrinsics, int width, int height) {
  const double x = static_cast<double>(width) / intrinsics.width;
  const double y = static_cast<double>(height) / intrinsics.height;
  geo::CameraIntrinsics resized = intrinsics;
  resized.fx *= x;
  resized.fy *= y;
  // (0, 0) is the first pixel's centre, but its outer corner is what stays in place.
  resized.cx = (intrinsics.cx + 0.5) * x - 0.5;
  resized.cy = (intrinsics.cy + 0.5) * y - 0.5;
  resized.width = width;
  resized.height = height;
  return resized;
}

}  // namespace livemap::vehicle
