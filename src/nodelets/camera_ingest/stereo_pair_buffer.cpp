#include "nodelets/camera_ingest/stereo_pair_buffer.h"

#include <algorithm>
#include <utility>

#include "common/clock.h"
#include "common/stamp_gate.h"

namespace livemap::nodelets {
namespace {

std::int64_t StampNs(const IngestFrame& frame) {
  return static_cast<std::int64_t>(frame.header().stamp.toNSec());
}

ros::Duration Between(ros::Time a, ros::Time b) { return a < b ? b - a : a - b; }

}  // namespace

void StereoPairBuffer::Put(IngestFrame frame) {
  {
    const MutexLock lock(mutex_);
    ++counters_.in;
    silent_ = false;
    const auto is_before = [](const IngestFrame& one, const IngestFrame& other) {
      return one.header().stamp < other.header().stamp;
    };
    if (!frames_.empty() && IsSetBack(StampNs(frame), StampNs(frames_.back()))) {
      Forget(frames_.size());
    }
    if (frames_.size() == capacity_) Forget(1);
    const auto place = std::upper_bound(frames_.begin(), frames_.end(), frame, is_before);
    frames_.insert(place, std::move(frame));
  }
  arrived_.NotifyAll();
}

std::optional<IngestFrame> StereoPairBuffer::Take(ros::Time stamp) {
  const MutexLock lock(mutex_);
  const auto deadline = SteadyDeadline(wait_s_);
  while (!silent_ && !IsDecided(stamp) && arrived_.WaitUntil(mutex_, deadline)) {
  }
  silent_ = !IsDecided(stamp);

  while (!frames_.empty() && frames_.front().header().stamp + tolerance_ < stamp) Forget(1);
  while (frames_.size() > 1 &&
         Between(frames_[1].header().stamp, stamp) <= Between(frames_[0].header().stamp, stamp)) {
    Forget(1);
  }
  if (frames_.empty() || Between(frames_.front().header().stamp, stamp) > tolerance_) {
    return std::nullopt;
  }
  std::optional<IngestFrame> partner(std::move(frames_.front()));
  frames_.pop_front();
  return partner;
}

void StereoPairBuffer::Clear() {
  const MutexLock lock(mutex_);
  Forget(frames_.size());
}

void StereoPairBuffer::Close() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
  }
  arrived_.NotifyAll();
}

StereoPairBuffer::Counters StereoPairBuffer::counters() const {
  const MutexLock lock(mutex_);
  return counters_;
}

bool StereoPairBuffer::IsDecided(ros::Time stamp) const {
  return closed_ || (!frames_.empty() && frames_.back().header().stamp + tolerance_ >= stamp);
}

void StereoPairBuffer::Forget(std::size_t count) {
  counters_.unpaired += count;
  frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(count));
}

}  // namespace livemap::nodelets
