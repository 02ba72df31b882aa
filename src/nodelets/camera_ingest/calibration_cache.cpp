#include "nodelets/camera_ingest/calibration_cache.h"

#include "common/clock.h"
#include "common/error.h"

namespace livemap::nodelets {
namespace {

// More cameras than one vehicle has: a publisher that makes up frame_ids must not fill the memory.
constexpr std::size_t kMaxCameras = 64;

}  // namespace

void CalibrationCache::Put(const sensor_msgs::CameraInfoConstPtr& info) {
  {
    const MutexLock lock(mutex_);
    if (by_frame_id_.size() >= kMaxCameras && by_frame_id_.count(info->header.frame_id) == 0)
      return;
    by_frame_id_[info->header.frame_id] = info;
  }
  arrived_.NotifyAll();
}

sensor_msgs::CameraInfoConstPtr CalibrationCache::Find(const std::string& frame_id, double wait_s) {
  const MutexLock lock(mutex_);
  const auto deadline = SteadyDeadline(wait_s);
  while (!closed_ && by_frame_id_.count(frame_id) == 0 && arrived_.WaitUntil(mutex_, deadline)) {
  }
  const auto found = by_frame_id_.find(frame_id);
  if (found == by_frame_id_.end()) {
    throw Error("there is no camera_info of frame_id '" + frame_id + "'");
  }
  return found->second;
}

void CalibrationCache::Close() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
  }
  arrived_.NotifyAll();
}

}  // namespace livemap::nodelets
