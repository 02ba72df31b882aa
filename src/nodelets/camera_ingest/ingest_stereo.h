#pragma once

#include <image_transport/image_transport.h>
#include <ros/node_handle.h>

#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/mutex.h"
#include "common/queues/frame_queue.h"
#include "imaging/stereo_depth.h"
#include "nodelets/camera_ingest/calibration_cache.h"
#include "nodelets/camera_ingest/frame_processor.h"
#include "nodelets/camera_ingest/stereo_pair_buffer.h"
#include "nodelets/diagnostics.h"
#include "nodelets/stamp_checks.h"
#include "ros/parameters/camera_ingest_parameters.h"

namespace livemap::nodelets {

/// The right camera of camera_ingest: takes `camera_right/image_raw` with
/// `camera_right/camera_info`, pairs it with the left images and publishes
/// `camera_rect/depth/image_raw` (32FC1, metres, NaN: unknown) with
/// `camera_rect/depth/camera_info`, stamp and frame_id those of the left image.
///
/// One worker of its own, so that left images never wait for depth. Works while somebody listens to
/// the depth: left images = published + dropped + bad + missing + waiting, at any moment.
class IngestStereo {
 public:
  /// `name` stands before what it says.
  IngestStereo(const ros_io::IngestConfig& config, ros::NodeHandle& node, std::string name);
  ~IngestStereo();

  /// A left image as it was published. Never blocks.
  void Take(const ProcessedFrame& left);
  /// Time went back: the right images of before are forgotten.
  void StartAnew() { rights_.Clear(); }
  /// Adds the figures, and what is wrong to the summary.
  void Diagnose(Diagnostics::Status& status);

 private:
  void Subscribe(ros::NodeHandle& node);
  void PutRight(IngestFrame right);
  void Work();
  /// False when the left image has no partner.
  bool PublishDepth(const ProcessedFrame& left);
  ProcessedFrame RectifyRight(const IngestFrame& right);
  imaging::StereoDepth& MatcherFor(const sensor_msgs::CameraInfo& left,
                                   const sensor_msgs::CameraInfo& right);
  void SayMissing(const std_msgs::Header& left) const;

  const ros_io::IngestConfig config_;
  const std::string name_;
  image_transport::CameraPublisher publisher_;
  CalibrationCache calibrations_;
  StampChecks stamps_;
  StereoPairBuffer rights_;
  FrameQueue<ProcessedFrame> queue_;

  FrameProcessor processor_;  // These three are the worker's.
  imaging::CameraCalibration left_, right_;
  std::unique_ptr<imaging::StereoDepth> matcher_;

  Mutex accounts_mutex_;  ///< Makes the queue's counters and the ones below one snapshot.
  std::uint64_t bad_ GUARDED_BY(accounts_mutex_) = 0;
  std::uint64_t missing_ GUARDED_BY(accounts_mutex_) = 0;
  CounterWatch bad_watch_ GUARDED_BY(accounts_mutex_);
  CounterWatch missing_watch_ GUARDED_BY(accounts_mutex_);
  /// Of the matching, since the last diagnostics.
  std::vector<double> milliseconds_ GUARDED_BY(accounts_mutex_);

  // Last: they use the rest. The worker begins when nothing can fail any more.
  ros::Subscriber image_subscriber_;
  ros::Subscriber info_subscriber_;
  std::thread worker_;
};

}  // namespace livemap::nodelets
