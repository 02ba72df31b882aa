#pragma once

#include <ros/time.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "common/mutex.h"
#include "imaging/frame_source.h"
#include "nodelets/camera_ingest/frame_processor.h"
#include "ros/parameters/camera_ingest_parameters.h"

namespace livemap::nodelets {

/// None when the configuration names a topic. Throws Error when the source cannot be opened.
std::unique_ptr<imaging::FrameSource> OpenSource(const ros_io::IngestConfig& config);

/// A frame of a source as one that came in.
IngestFrame ToIngestFrame(imaging::SourceFrame frame, const std_msgs::Header& header);

/// Reads a device, video or folder on its own thread at its rate and stamps the frames. Like a
/// camera it does not wait for whoever takes them. The destructor stops it.
class IngestReader {
 public:
  /// `take` gets every frame; `miss` the reason why one could not be read.
  IngestReader(const ros_io::IngestConfig& config, std::unique_ptr<imaging::FrameSource> source,
               std::function<void(IngestFrame)> take, std::function<void(const std::string&)> miss);
  ~IngestReader();

  /// The file or folder has no more frames.
  bool ended() const { return ended_; }

 private:
  void Run();
  /// At the end of the frames: false when reading is over.
  bool GoOn();
  /// Lets the time of the frames pass that are missing before one of so many steps. False when
  /// stopped while sleeping.
  bool PassMissing(int steps, std::int64_t& number, ros::WallTime& next);
  /// Stamp of the frame of this number, which a camera took so long ago: see the parameter
  /// `stamps`.
  ros::Time StampOf(std::int64_t number, double age_s);
  /// False when stopped while sleeping.
  bool SleepUntil(ros::WallTime wanted);

  const ros_io::IngestConfig config_;
  const std::unique_ptr<imaging::FrameSource> source_;
  const std::function<void(IngestFrame)> take_;
  const std::function<void(const std::string&)> miss_;
  const ros::Duration period_;
  ros::Time first_stamp_;  ///< The thread's.
  Mutex mutex_;
  ConditionVariable stop_requested_;
  bool stopped_ GUARDED_BY(mutex_) = false;
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

}  // namespace livemap::nodelets
