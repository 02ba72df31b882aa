#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "change/objects/changed_regions.h"
#include "geo/ground_projection.h"
#include "protocol/change_class.h"

namespace livemap::change {

/// An object that several pictures agree on.
struct ChangedObject {
  std::uint64_t id = 0;  ///< Rising from 1; of one tracker.
  protocol::ChangeClass change_class = protocol::ChangeClass::kNoChange;
  ChangeDirection direction = ChangeDirection::kUnknown;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< Map frame: east, north.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();
  double confidence = 0;  ///< Mean of its regions' times the share of pictures that show it.
  int seen = 0;           ///< Pictures that show it.
  int missed = 0;         ///< Pictures that should have, but do not.
  std::int64_t first_ns = 0;
  std::int64_t last_ns = 0;
  std::int64_t earlier_ns = 0;  ///< Of the picture that the last one was compared with.
};

/// Where a picture was taken.
struct ChangeFrame {
  std::int64_t stamp_ns = 0;
  std::int64_t earlier_ns = 0;  ///< Of the picture it was compared with.
  Eigen::Isometry3d map_from_base = Eigen::Isometry3d::Identity();  ///< map: ENU; base: REP 105.
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  geo::CameraIntrinsics camera;
  cv::Mat valid;  ///< CV_8UC1: 255 where the earlier picture is known; as AlignedPair's.
};

/// Turns regions of single pictures into objects on the ground. Nothing is ever said from one
/// picture: an object is confirmed when enough pictures, taken far enough apart, show it, and most
/// of those that look at it do. Not thread-safe.
class ChangeTracker {
 public:
  struct Config {
    int min_seen = 3;              ///< Pictures.
    double min_travel_m = 2;       ///< Between the first and the last of them.
    double min_share = 0.5;        ///< Seen of seen and missed.
    double gate_sigmas = 3;        ///< Regions this near, in standard deviations, are one object,
    double min_gate_m = 1.5;       ///< and in any case those nearer than this,
    double max_gate_m = 6;         ///< and in no case those further than this.
    double process_sigma_m = 0.5;  ///< Added to each sight's position: pose and foot are not exact.
    double max_range_m = 40;       ///< Further away nothing is placed or missed.
    double min_missed_m = 10;      ///< Nearer than this nothing is missed: it may be out of view.
    double min_direction_share = 0.6;  ///< Of the sights that know a direction.
    double passed_m = 5;               ///< Behind the vehicle by this, an object is passed,
    double forget_m = 60;              ///< and this far from it, it is forgotten.
    std::size_t max_tracks = 256;      ///< The least seen, longest unseen goes first.
    geo::GroundProjectionNoise ground;
  };

  explicit ChangeTracker(const Config& config);

  /// Takes one picture's regions in; returns the objects that it confirmed. Stamps must rise: an
  /// older picture is ignored.
  std::vector<ChangedObject> Add(const ChangeFrame& frame,
                                 const std::vector<ChangeRegion>& regions);
  /// The confirmed objects that the vehicle has passed, now that it is here: each once, with its
  /// last figures. Those it is far from are forgotten.
  std::vector<ChangedObject> LeaveBehind(const Eigen::Isometry3d& map_from_base);
  /// Forgets all objects; the next picture may have any stamp, and ids go on rising. Returns the
  /// confirmed ones that LeaveBehind has not told.
  std::vector<ChangedObject> Restart();
  /// All confirmed objects with their present figures, by id, until they are forgotten.
  std::vector<ChangedObject> Confirmed() const;

  std::size_t tracks() const { return tracks_.size(); }

 private:
  struct Track {
    ChangedObject event;
    std::vector<double> class_weight;  ///< By class: sum of confidences.
    double confidence_sum = 0;
    int appeared = 0;
    int vanished = 0;
    Eigen::Vector2d first_seen_from_m = Eigen::Vector2d::Zero();
    double travel_m = 0;
    bool confirmed = false;
    bool told_passed = false;
  };
  struct Sight {
    Eigen::Vector2d position_m;
    Eigen::Matrix2d covariance_m2;
    const ChangeRegion* region;
  };

  std::optional<Sight> Place(const ChangeFrame& frame, const ChangeRegion& region) const;
  Track* Nearest(const Sight& sight, const std::vector<bool>& taken);
  void Update(Track& track, const Sight& sight, const ChangeFrame& frame) const;
  /// Whether the picture should show the object, and does not.
  bool IsMissed(const Track& track, const ChangeFrame& frame,
                const std::vector<ChangeRegion>& regions) const;
  bool IsConfirmed(const Track& track) const;
  void LimitTracks();

  Config config_;
  std::vector<Track> tracks_;
  std::uint64_t next_id_ = 1;
  std::int64_t last_stamp_ns_ = 0;
};

}  // namespace livemap::change
