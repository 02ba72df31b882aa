#include "vehicle/reporting/notice_sequence_tracker.h"

#include <algorithm>

namespace livemap::vehicle {

bool NoticeSequenceTracker::Add(std::uint64_t previous, std::uint64_t sequence) {
  if (previous <= known_) {
    CloseTo(sequence);
    return true;
  }
  ahead_[previous] = std::max(ahead_[previous], sequence);
  // The newest are of least use: the zone tells them again with what was missed before them.
  if (ahead_.size() > kMaxAhead) ahead_.erase(std::prev(ahead_.end()));
  return false;
}

void NoticeSequenceTracker::CloseTo(std::uint64_t sequence) {
  known_ = std::max(known_, sequence);
  while (!ahead_.empty() && ahead_.begin()->first <= known_) {
    known_ = std::max(known_, ahead_.begin()->second);
    ahead_.erase(ahead_.begin());
  }
}

}  // namespace livemap::vehicle
