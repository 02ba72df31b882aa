#include "nodelets/change_frames.h"

#include "ros/hazard_conversions.h"

namespace livemap {

void ChangeFrames::AddImage(const sensor_msgs::ImageConstPtr& image, double now_s) {
  ++counters_.frames;
  if (waiting_.size() == config_.most_waiting) {
    waiting_.pop_front();
    ++counters_.displaced;
  }
  waiting_.push_back({image, now_s});
}

std::optional<ChangeFrames::Posed> ChangeFrames::Next(double now_s) {
  while (!waiting_.empty()) {
    const Waiting& waiting = waiting_.front();
    const std::int64_t stamp_ns = FromRosTime(waiting.image->header.stamp);
    const BasePoseSource::Lookup lookup = pose_.At(stamp_ns, now_s - waiting.arrival_s);
    // In their order: those behind it wait too.
    if (lookup.answer == BasePoseSource::Answer::kWait) return std::nullopt;
    const Posed posed{waiting.image, lookup.base};
    waiting_.pop_front();
    if (lookup.answer == BasePoseSource::Answer::kHopeless) {
      ++counters_.no_pose;
    } else if (last_taken_ &&
               GeodesicDistanceM(*last_taken_, posed.base.position) < config_.spacing_m) {
      ++counters_.near;
    } else {
      return posed;
    }
  }
  return std::nullopt;
}

}  // namespace livemap
