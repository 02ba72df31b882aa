#include "nodelets/change_detection/posed_frame_queue.h"

#include "ros/conversions/hazard_conversions.h"

namespace livemap::nodelets {

void PosedFrameQueue::AddImage(const sensor_msgs::ImageConstPtr& image, double now_s) {
  ++counters_.frames;
  if (waiting_.size() == config_.max_waiting) {
    waiting_.pop_front();
    ++counters_.displaced;
  }
  waiting_.push_back({image, now_s});
}

void PosedFrameQueue::AddDepth(const sensor_msgs::ImageConstPtr& depth) {
  depths_[ros_io::FromRosTime(depth->header.stamp)] = depth;
  if (depths_.size() > config_.max_waiting) depths_.erase(depths_.begin());
}

void PosedFrameQueue::StartAnew() {
  pose_.Reset();
  counters_.no_pose += waiting_.size();
  waiting_.clear();
  depths_.clear();
}

std::optional<PosedFrameQueue::Posed> PosedFrameQueue::Next(double now_s) {
  while (!waiting_.empty()) {
    const Waiting& waiting = waiting_.front();
    const std::int64_t stamp_ns = ros_io::FromRosTime(waiting.image->header.stamp);
    const double waited_s = now_s - waiting.arrival_s;
    const vehicle::VehiclePoseLookup::Lookup lookup = pose_.At(stamp_ns, waited_s);
    // In their order: those behind it wait too.
    if (lookup.answer == vehicle::VehiclePoseLookup::Answer::kWait) return std::nullopt;
    const bool hopeless = lookup.answer == vehicle::VehiclePoseLookup::Answer::kHopeless;
    const bool near =
        !hopeless && last_taken_ &&
        geo::GeodesicDistanceM(*last_taken_, lookup.base.position) < config_.spacing_m;
    const auto depth = depths_.find(stamp_ns);
    const bool has_depth = depth != depths_.end();
    if (!hopeless && !near && !has_depth && waited_s < config_.depth_wait_s) return std::nullopt;
    const Posed posed{waiting.image, has_depth ? depth->second : nullptr, lookup.base};
    waiting_.pop_front();
    if (!hopeless && !near) return posed;
    ++(hopeless ? counters_.no_pose : counters_.near);
  }
  return std::nullopt;
}

}  // namespace livemap::nodelets
