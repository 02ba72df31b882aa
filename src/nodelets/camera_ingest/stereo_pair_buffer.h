#pragma once

#include <ros/time.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "common/mutex.h"
#include "nodelets/camera_ingest/frame_processor.h"

namespace livemap::nodelets {

/// The right camera's images, kept until the left image of the same moment asks for its own.
/// Thread-safe.
class StereoPairBuffer {
 public:
  struct Counters {
    std::uint64_t in = 0;
    std::uint64_t unpaired = 0;  ///< That no left image asked for.
  };

  /// `tolerance_s`: how far the stamps of a pair may differ, 0: not at all; `wait_s`: how long a
  /// left image waits for its partner; `capacity`: how many are kept, the oldest goes.
  StereoPairBuffer(double tolerance_s, double wait_s, std::size_t capacity)
      : tolerance_(tolerance_s), wait_s_(wait_s), capacity_(capacity) {}

  /// Keeps an image, also one that comes late. A stamp by which time was set back (IsSetBack)
  /// forgets all before.
  void Put(IngestFrame frame);
  /// The partner of a left image of this stamp, the nearest one; older ones are forgotten. Waits
  /// while it may still come, but not for a camera that has been silent since the last one waited
  /// in vain. None when there is none.
  std::optional<IngestFrame> Take(ros::Time stamp);
  /// Forgets all images.
  void Clear();
  /// Ends all waiting.
  void Close();
  Counters counters() const;

 private:
  /// Whether an image that is kept, or the end, leaves nothing to wait for.
  bool IsDecided(ros::Time stamp) const REQUIRES(mutex_);
  void Forget(std::size_t count) REQUIRES(mutex_);

  const ros::Duration tolerance_;
  const double wait_s_;
  const std::size_t capacity_;
  mutable Mutex mutex_;
  ConditionVariable arrived_;
  std::deque<IngestFrame> frames_ GUARDED_BY(mutex_);  ///< In the order of their stamps.
  Counters counters_ GUARDED_BY(mutex_);
  bool silent_ GUARDED_BY(mutex_) = false;
  bool closed_ GUARDED_BY(mutex_) = false;
};

}  // namespace livemap::nodelets
