#pragma once

#include <string>

#include "imaging/camera_device.h"
#include "imaging/stereo_depth.h"
#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// Where the vehicle's images come from.
enum class IngestSource { kTopic, kDevice, kVideo, kFolder };
enum class IngestAtEnd { kStay, kLoop, kShutdown };

/// Defaults of the camera_ingest nodelet; config/camera_ingest.yaml explains each.
struct IngestConfig {
  IngestSource source = IngestSource::kTopic;
  std::string transport = "compressed";  ///< Of a topic: "raw" or "compressed".
  std::string uri;                       ///< Device, video file or image folder.
  imaging::DeviceConfig device;          ///< Size 0: the calibration's.
  double rate_hz = 10;                   ///< Folder, and video that names no rate.
  std::string stamps = "wall";           ///< "wall" or "file_order" (start + number / rate).
  IngestAtEnd at_end = IngestAtEnd::kStay;
  std::string frame_id = "camera_optical_frame";  ///< Of sources that name none.
  std::string camera_info_url;       ///< Calibration YAML of sources that bring none, "file://...".
  int output_width = 0;              ///< Pixels, 0 = as the input or by aspect ratio.
  int output_height = 0;             ///< Pixels.
  int queue_size = 2;                ///< Frames that may wait for the worker.
  int subscriber_queue_size = 1000;  ///< Messages; only ever filled while a callback cannot run.
  double calibration_wait_s = 1.0;   ///< How long a frame waits for the first camera_info.
  double max_megapixels = 20;        ///< Larger images are refused before they are decoded.
  double max_stamp_ahead_s = 5.0;    ///< Of the clock: see StampGate::Config.
  double diagnostics_period_s = 1.0;

  bool stereo = false;         ///< Depth from a right camera on camera_right/.
  double stereo_sync_s = 0;    ///< How far the stamps of a pair may differ.
  double stereo_wait_s = 0.2;  ///< How long a left image's depth waits for the right one.
  imaging::StereoConfig matching;
};

/// Reads and checks all of them; throws Error.
IngestConfig ReadIngestConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
