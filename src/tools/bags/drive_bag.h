#pragma once

#include <livemap/DetectionArray.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <std_msgs/Header.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "datasets/camera_file.h"
#include "datasets/route.h"
#include "datasets/sensors/gnss_receiver_model.h"
#include "tools/bags/bag_writer.h"
#include "tools/common/command_line.h"

namespace livemap::tools {

/// What a drive needs beside its pictures.
struct DriveSetup {
  datasets::Route route;
  double speed_mps;
  datasets::CameraFile camera;
  datasets::GnssReceiverNoise noise;
  double fix_rate_hz;
  std::uint64_t seed;
  ros::Time start;  ///< Stamp of distance 0.
  /// Where the vehicle is at a time; empty: `speed_mps` along the route.
  std::function<geo::GeoPoint(double time_s)> place = nullptr;
  /// What the receiver errs beside `noise`, east and north, metres; called once per fix in order of
  /// time. Empty: nothing.
  std::function<Eigen::Vector2d(double time_s)> multipath_m = nullptr;
  BagWriter::Compression compression = BagWriter::Compression::kNone;
};

/// The flags that every drive shares; `Setup` reads them. Relative to the first frame's position.
std::vector<Flag> DriveFlags();
/// `needed_m` is the drive's length: a shorter route is an Error that says so.
DriveSetup ReadDriveSetup(const CommandLine& line, const std::string& camera_path,
                          double default_speed_mps);
void CheckRouteLength(const datasets::Route& route, double needed_m);
/// `--start-time`, default 2026-01-01T12:00:00Z.
ros::Time ReadStartTime(const CommandLine& line);

/// The topics of a real vehicle, written in time order: camera/image_raw/compressed,
/// camera/camera_info, fix, ground_truth/boxes, ground_truth/fix and tf_static.
class DriveBag {
 public:
  /// The receiver runs this long before the first and after the last picture.
  static constexpr double kLeadS = 1.0;

  DriveBag(const std::string& path, const DriveSetup& setup);

  /// The next frame. `image` is a whole JPEG; `boxes` are in its pixels. Returns the header of what
  /// was written.
  std_msgs::Header AddFrame(double time_s, const std::vector<std::uint8_t>& image,
                            const std::vector<livemap::Detection>& boxes);
  /// For topics of one's own: the fixes up to `time_s` are written, then `Writer()` may go on
  /// there.
  void AdvanceTo(double time_s);
  BagWriter& Writer() { return bag_; }
  ros::Time Stamp(double time_s) const { return setup_.start + ros::Duration(time_s); }
  /// Fixes go on for a second after `end_s`, so that the last frame's position is known.
  void Finish(double end_s);

 private:
  void WriteStaticTransforms();

  const DriveSetup setup_;
  BagWriter bag_;
  datasets::GnssReceiverModel receiver_;
  sensor_msgs::CameraInfo camera_info_;
  std::int64_t next_fix_ = 0;
  std::uint32_t frame_number_ = 0;
};

}  // namespace livemap::tools
