#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "geo/ground_projection.h"
#include "perception/detection/hazard_detection.h"

namespace livemap::perception {

/// The camera and the vehicle's motion at one image; what lets a box be carried to the next image.
struct CameraMotion {
  geo::CameraIntrinsics intrinsics;
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  /// Pose of base_link (on the road, z up) in any frame that stands still.
  Eigen::Isometry3d world_from_base = Eigen::Isometry3d::Identity();
};

/// What the tracker gets of one image.
struct TrackerFrame {
  std::int64_t stamp_ns = 0;
  cv::Size image_size;
  /// Also those far below the model's thresholds, down to `low_share` of them.
  std::vector<HazardDetection> detections;
  std::optional<CameraMotion> motion;  ///< None: boxes are carried on by their own velocity.
};

/// One object, reported once.
struct ObjectEvent {
  std::int64_t stamp_ns = 0;  ///< Of the image with its best view.
  cv::Size image_size;
  HazardDetection detection;  ///< There.
  double evidence = 0;        ///< When it was reported, as a multiple of the class's threshold.
  int sights = 0;             ///< Images in which it was recognised so far.
};

/// Follows objects from image to image, and reports each once, when it is sure and at its best
/// view. Not thread-safe.
///
/// Association goes in two rounds as in ByteTrack (Zhang et al. 2022): detections above their
/// class's threshold first, what is below it then to the tracks that are left. Within a round the
/// cheapest pair within the gate is taken first: gates seldom overlap, so that an optimal
/// assignment would choose the same pairs. A pair's cost is the squared Mahalanobis distance of the
/// box's foot from where it is expected, plus that of the logarithms of width and height.
///
/// The expected place: the foot of the box lies on the road (z = 0 of base_link), which the motion
/// of the camera carries to the next image; without motion, the box's velocity in the image.
class ObjectTracker {
 public:
  struct Config {
    /// Detections down to this share of their class's threshold take part, 0..1.
    double low_share = 0.5;
    /// An object is sure when its evidence reaches this multiple of its class's threshold.
    double sure = 1.0;
    /// Evidence is the best confidence plus this share of the others'.
    double repeat_gain = 0.15;
    /// Greatest cost of a pair (squared standard deviations, four degrees of freedom).
    double gate = 9.0;
    /// How well a box's foot is placed, standard deviation: px, and share of the box's side.
    double pixel_sigma_px = 4.0;
    double side_sigma = 0.15;
    double pitch_sigma_rad = 0.005;    ///< Of the camera's pitch from image to image.
    double motion_sigma_m = 0.5;       ///< Of the way between two images,
    double motion_sigma_share = 0.08;  ///< and as a share of it.
    double size_sigma = 0.5;           ///< Of the logarithms of width and height.
    /// Without motion: how far a box may leave its expected place, share of its side per image.
    double drift_sigma = 0.5;
    /// A track that was not seen for this time or this way ends, s and m.
    double max_unseen_s = 1.5;
    double max_unseen_m = 25.0;
    /// Longest time from being sure to being reported, s, and that of single classes: 0 is at once.
    double max_delay_s = 2.0;
    std::map<std::string, double> class_max_delay_s{
        {"debris", 0.0}, {"deer", 0.0}, {"stopped_accident", 0.0}};
    /// A view is past its best when the quality has fallen below this share of the best.
    double past_best_share = 0.8;
    /// Views nearer than this are equally good; farther ones lose, m.
    double good_range_m = 15.0;
    /// Boxes whose mean side (root of the area) is at least this are equally good, px.
    double good_side_px = 16.0;
    /// A view that the image's edge cuts counts this much.
    double cut_share = 0.5;
    /// Tracks that live at once; when there are more, the one with the least evidence goes.
    int max_tracks = 200;
  };

  struct Counters {
    std::uint64_t frames = 0;
    std::uint64_t refused = 0;    ///< Boxes that are none: NaN, empty, no class of the model.
    std::uint64_t late = 0;       ///< Images that came after a newer one: they change nothing.
    std::uint64_t resets = 0;     ///< Times that time was set back.
    std::uint64_t tracks = 0;     ///< Begun.
    std::uint64_t forgotten = 0;  ///< Because of max_tracks.
    std::uint64_t events = 0;
  };

  /// `thresholds` by class index. Throws Error when a number of `config` is out of range.
  ObjectTracker(const Config& config, std::vector<float> thresholds);

  /// The objects that are to be reported now. An image that is not newer than the last one is late
  /// and changes nothing; a stamp by which time was set back (IsSetBack) begins anew.
  std::vector<ObjectEvent> Add(const TrackerFrame& frame);
  /// Time was set back: living tracks are dropped, without events.
  void StartAnew();
  /// The end of the drive: what is sure and not reported yet.
  std::vector<ObjectEvent> Finish();

  /// Stamps of the best views of tracks that were not reported yet, which may be asked for.
  std::vector<std::int64_t> BestViews() const;
  const Counters& counters() const { return counters_; }
  std::size_t living() const { return tracks_.size(); }

 private:
  struct Track {
    HazardDetection last;
    std::int64_t last_ns = 0;
    std::optional<CameraMotion> last_motion;
    Eigen::Vector2d velocity_px_s = Eigen::Vector2d::Zero();
    bool velocity_known = false;
    double best_confidence = 0;
    double sum_confidence = 0;
    int sights = 0;
    ObjectEvent best;
    double best_quality = 0;
    double quality = 0;  ///< Of the newest view.
    std::optional<std::int64_t> sure_ns;
    bool reported = false;
  };
  /// Where a track's box is expected.
  struct Expected {
    Eigen::Vector2d foot_px = Eigen::Vector2d::Zero();
    double width_px = 0;
    double flat_height_px = 0;     ///< If the object lies on the road.
    double upright_height_px = 0;  ///< If it stands.
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
    double way_m = 0;
    bool behind = false;  ///< The object is beside or behind the camera by now.
  };

  bool IsUsable(const HazardDetection& detection) const;
  Expected Expect(const Track& track, const TrackerFrame& frame) const;
  std::optional<Expected> ExpectByMotion(const Track& track, const CameraMotion& motion) const;
  Expected ExpectByVelocity(const Track& track, const TrackerFrame& frame) const;
  double Cost(const Track& track, const Expected& expected, const HazardDetection& found) const;
  /// One round; erases what it assigned from `detections`, and marks the tracks in `seen`.
  void Associate(const TrackerFrame& frame, const std::vector<Expected>& expected,
                 std::vector<HazardDetection>& detections, std::vector<bool>& seen);
  void See(Track& track, const HazardDetection& found, const TrackerFrame& frame) const;
  void Begin(const HazardDetection& found, const TrackerFrame& frame);
  double Quality(const HazardDetection& found, const TrackerFrame& frame) const;
  double Evidence(const Track& track) const;
  double MaxDelayS(const std::string& class_name) const;
  bool IsDue(Track& track, bool seen, bool gone, std::int64_t now_ns) const;
  ObjectEvent Report(Track& track);

  Config config_;
  std::vector<float> thresholds_;
  std::vector<Track> tracks_;
  std::optional<std::int64_t> newest_ns_;
  Counters counters_;
};

}  // namespace livemap::perception
