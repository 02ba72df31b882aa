#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>

#include "common/mutex.h"
#include "odometry/edge/edge_odometry.h"
#include "odometry/monocular/depth_learner.h"

namespace livemap::odometry {

/// Makes the depths of keyframes while later frames are followed: one at a time, on a thread of
/// its own at a low priority, or at once and handed over a fixed number of frames later, so that a
/// run can be repeated. All calls come from one thread, the frames'.
class KeyframeWorker {
 public:
  /// A frame that is to become a keyframe.
  struct Order {
    std::int64_t stamp_ns = 0;
    cv::Mat grey;     ///< CV_8UC1, nobody else's.
    cv::Mat smooth;   ///< The finest level of its pyramid, nobody else's.
    VoResult result;  ///< Where the camera was, in units of the map.
    double metres_per_unit = 1;
    PosedImage before{};  ///< As DepthLearner::Learn wants it; nobody else's.
  };
  struct Made {
    Order order;
    LearntDepths learnt;
  };

  /// `learner` must outlive the worker, and is the worker's while it is busy. With
  /// `delay_frames` > 0 there is no thread.
  KeyframeWorker(DepthLearner& learner, int delay_frames);
  /// Waits for what is in work.
  ~KeyframeWorker();
  KeyframeWorker(const KeyframeWorker&) = delete;
  KeyframeWorker& operator=(const KeyframeWorker&) = delete;

  /// A frame was given and has not been taken.
  bool busy() const { return busy_; }
  /// Only when it is not busy.
  void Give(Order order);
  /// Once per frame: what is done; none while it is not.
  std::optional<Made> Take();
  /// What is in work, for which it waits for `longest_s` at most; none when it is not busy, or is
  /// still at it.
  std::optional<Made> WaitAndTake(double longest_s);
  /// Waits for what is in work and forgets it.
  void Cancel();

 private:
  void Work();

  DepthLearner& learner_;
  const int delay_frames_;
  // The caller's own:
  bool busy_ = false;
  int frames_left_ = 0;

  Mutex mutex_;
  ConditionVariable changed_;
  std::optional<Order> order_ GUARDED_BY(mutex_);
  std::optional<Made> made_ GUARDED_BY(mutex_);
  bool closed_ GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace livemap::odometry
