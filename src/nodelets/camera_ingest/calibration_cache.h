#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <map>
#include <string>

#include "common/mutex.h"

namespace livemap::nodelets {

/// The newest calibration of each camera, by frame_id. Thread-safe.
class CalibrationCache {
 public:
  void Put(const sensor_msgs::CameraInfoConstPtr& info);
  /// Waits up to `wait_s` when there is none yet: the first camera_info may come just behind the
  /// first image. Throws Error when there is still none.
  sensor_msgs::CameraInfoConstPtr Find(const std::string& frame_id, double wait_s);
  /// Ends all waiting.
  void Close();

 private:
  Mutex mutex_;
  ConditionVariable arrived_;
  std::map<std::string, sensor_msgs::CameraInfoConstPtr> by_frame_id_ GUARDED_BY(mutex_);
  bool closed_ GUARDED_BY(mutex_) = false;
};

}  // namespace livemap::nodelets
