#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "datasets/camera_file.h"
#include "imaging/rectifier.h"
#include "recordings/recorded_track.h"
#include "tools/bags/bag_writer.h"

namespace livemap::tools {

/// What a recording needs beside its pictures.
struct RecordingSetup {
  imaging::CameraCalibration calibration;
  datasets::CameraMounting mounting;
  recordings::RecordedTrack track;
  double default_sigma_m = 3;  ///< Per axis, of positions that state none.
};

/// Writes what a person recorded as a drive, in time order: camera/image_raw/compressed,
/// camera/camera_info, fix, gps/velocity where the receiver states speed and course, and tf_static.
class RecordingBag {
 public:
  /// `begin_ns` is the stamp of the first frame. The track's positions are written from kLeadS
  /// before it on.
  RecordingBag(const std::string& path, RecordingSetup setup, std::int64_t begin_ns);

  /// The next frame: a whole JPEG. Stamps increase.
  void AddFrame(std::int64_t stamp_ns, const std::vector<std::uint8_t>& jpeg);
  /// The positions go on for kLeadS after the last frame.
  void Finish();

  /// Positions written so far.
  std::size_t fixes() const { return fixes_; }

 private:
  static constexpr double kLeadS = 3;

  void WriteFixesUntil(std::int64_t stamp_ns);

  const RecordingSetup setup_;
  BagWriter bag_;
  sensor_msgs::CameraInfo info_;
  std::size_t next_position_ = 0;
  std::size_t fixes_ = 0;
  std::uint32_t frames_ = 0;
  std::int64_t last_frame_ns_ = 0;
};

}  // namespace livemap::tools
