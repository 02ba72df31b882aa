#pragma once

#include <sensor_msgs/Image.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>

#include "vehicle/positioning/vehicle_pose_lookup.h"

namespace livemap::nodelets {

/// Images that wait for the position of their moment, and which of them are looked at: one per
/// `spacing_m` of road. `now_s` is the clock of ros::Time. Not thread-safe.
class PosedFrameQueue {
 public:
  struct Config {
    double spacing_m = 1;          ///< Between two images that are looked at.
    std::size_t max_waiting = 30;  ///< Then the oldest goes; as many depth images are kept.
    double depth_wait_s = 0;       ///< How long an image waits for its depth image; 0: none comes.
    vehicle::VehiclePoseLookup::Config pose;
  };

  /// frames = waiting + displaced + no_pose + near + those that Next gave.
  struct Counters {
    std::uint64_t frames = 0;     ///< All that came.
    std::uint64_t displaced = 0;  ///< Too many waited.
    std::uint64_t no_pose = 0;    ///< No position or course of their moment came.
    std::uint64_t near = 0;       ///< Within spacing_m of the last one that was taken.
  };

  struct Posed {
    sensor_msgs::ImageConstPtr image;
    sensor_msgs::ImageConstPtr depth;  ///< Of its stamp; null when none came.
    geo::TrackPose base;               ///< Of base_link.
  };

  explicit PosedFrameQueue(const Config& config) : config_(config), pose_(config.pose) {}

  /// `now_ns` is the clock of the stamps; 0: it is not known.
  void AddFix(const geo::Fix& fix, std::int64_t now_ns = 0) { pose_.AddFix(fix, now_ns); }
  void AddPose(std::int64_t stamp_ns, const geo::TrackPose& pose, std::int64_t now_ns = 0) {
    pose_.AddPose(stamp_ns, pose, now_ns);
  }
  /// The clock was set back: all that waits is forgotten, the images as no_pose.
  void StartAnew();
  void AddImage(const sensor_msgs::ImageConstPtr& image, double now_s);
  /// Before or after its image.
  void AddDepth(const sensor_msgs::ImageConstPtr& depth);

  /// The next image whose position is known and that is far enough from the last one taken; none
  /// when there is none now. Who looks at it says so by Taken.
  std::optional<Posed> Next(double now_s);
  void Taken(const Posed& posed) { last_taken_ = posed.base.position; }

  const Counters& counters() const { return counters_; }
  std::size_t waiting() const { return waiting_.size(); }

 private:
  struct Waiting {
    sensor_msgs::ImageConstPtr image;
    double arrival_s = 0;
  };

  Config config_;
  vehicle::VehiclePoseLookup pose_;
  std::deque<Waiting> waiting_;
  std::map<std::int64_t, sensor_msgs::ImageConstPtr> depths_;  ///< By stamp, ns.
  std::optional<geo::GeoPoint> last_taken_;
  Counters counters_;
};

}  // namespace livemap::nodelets
