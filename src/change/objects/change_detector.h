#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "change/memory/place_memory.h"
#include "change/methods/change_method.h"
#include "change/objects/change_tracker.h"
#include "change/registration/registration.h"

namespace livemap::change {

/// A picture of the present drive and where it was taken.
struct ChangeDetectorFrame {
  std::int64_t stamp_ns = 0;
  cv::Mat bgr;    ///< CV_8UC3, rectified, of the camera's size.
  cv::Mat depth;  ///< Empty, or CV_32FC1 of its size: m ahead; 0 and NaN are unknown.
  geo::CameraIntrinsics camera;  ///< Of this picture.
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  geo::GeoPoint position;                                   ///< Of base_link.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< Of position, east-north axes.
  double heading_rad = 0;  ///< Of base_link's x axis, clockwise from true north.
};

/// An object that changed, on the earth.
struct PlacedChange {
  ChangedObject event;  ///< Its position_m is relative to a place that only the watch knows.
  geo::GeoPoint position;
  /// East-north axes; with the position of the vehicle, which all its pictures share.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();
};

/// Remembers the street picture by picture, and says what changed since earlier drives (thesis
/// 4.3): the nearest earlier pictures by position and heading, the best of them by matches,
/// registration, the method, regions, objects on the ground. Not
/// thread-safe.
class ChangeDetector {
 public:
  struct Config {
    std::string drive_id;  ///< Of the present drive: its own pictures are not compared with.
    PlaceMemory::Config memory;
    FeatureConfig features;
    RegistrationConfig registration;
    ChangeRegionConfig regions;
    ChangeTracker::Config tracker;
    double remember_spacing_m = 2;    ///< Between two pictures that are remembered.
    double max_position_sigma_m = 5;  ///< Per axis; a picture placed worse is not used at all.
    std::size_t partners = 2;         ///< Earlier pictures that are tried, the best one first.
    int jpeg_quality = 90;            ///< Of remembered pictures, 1 to 100.
    std::uint64_t seed = 1;           ///< Of registration.
  };

  /// What laid the earlier picture onto the present one.
  enum class RegisteredBy {
    kDepth,     ///< Each pixel by its depth: the only way that fits near and far things at once.
    kEdges,     ///< RegisterByEdges.
    kFeatures,  ///< RegisterByHomography.
  };

  enum class Outcome {
    kUncertain,       ///< The position is too uncertain.
    kNothingEarlier,  ///< No earlier drive passed here, looking that way.
    kRefused,         ///< No earlier picture could be registered: `why`.
    kCompared,
  };

  struct Answer {
    Outcome outcome = Outcome::kNothingEarlier;
    bool remembered = false;
    std::string why;          ///< Of kRefused: of the best partner.
    std::string store_error;  ///< The picture could not be remembered.
    // What follows is of kCompared.
    RegisteredBy registered_by = RegisteredBy::kEdges;
    AlignedPair pair;
    cv::Mat classes;  ///< CV_8UC1: ChangeClass, or kLeftOutPixel where nothing earlier is known.
    std::vector<ChangeRegion> regions;
    PlaceFrame earlier;                 ///< The partner.
    std::size_t newly_confirmed = 0;    ///< By this picture.
    std::vector<PlacedChange> objects;  ///< All that are confirmed, as they are known now.
    // Of every outcome but kUncertain.
    std::vector<PlacedChange> passed;  ///< Confirmed and left behind by now: each once.
  };

  /// Opens the memory; throws as PlaceMemory does, and Error for a drive id that is none. `now_ns`
  /// names a corrupt index that is set aside.
  ChangeDetector(const Config& config, std::unique_ptr<ChangeMethod> method, std::int64_t now_ns);

  /// Compares and remembers one picture. A stamp that goes back begins the objects anew. Throws
  /// Error for a picture that is not as ChangeDetectorFrame says, or when the method fails.
  Answer Look(const ChangeDetectorFrame& picture);

  /// The drive is over: all confirmed objects that no answer told as passed.
  std::vector<PlacedChange> EndDrive();

  const PlaceMemory& memory() const { return memory_; }

 private:
  struct Partner {
    PlaceFrame frame;
    WarpedPicture warped;
    RegisteredBy registered_by;
  };

  /// Where the camera was and looked.
  PlaceFrame FrameOf(const ChangeDetectorFrame& picture) const;
  std::optional<Partner> FindPartner(const PlaceFrame& frame, const ChangeDetectorFrame& picture,
                                     const FeaturedView& view, Answer& answer);
  /// By depth where there is one, else by edges, else by features; none with the reasons in `why`.
  std::optional<Partner> Register(const PlaceRecord& record, const ChangeDetectorFrame& picture,
                                  const FeaturedView& view, std::string& why) const;
  void Compare(const ChangeDetectorFrame& picture, const Partner& partner,
               const Eigen::Isometry3d& map_from_base, Answer& answer);
  void Remember(const ChangeDetectorFrame& picture, const PlaceFrame& frame,
                const ImageFeatures& features, Answer& answer);
  /// Where base_link is in the map, which begins anew far from the old one.
  Eigen::Isometry3d MapFromBase(const ChangeDetectorFrame& picture);
  /// Begins the objects anew; those that nobody was told of are told with the next answer.
  void Restart();
  void Place(const std::vector<ChangedObject>& events, std::vector<PlacedChange>& placed) const;

  Config config_;
  std::unique_ptr<ChangeMethod> method_;
  PlaceMemory memory_;
  ChangeTracker tracker_;
  std::optional<geo::LocalFrame> map_;  ///< East and north, in which objects are followed.
  Eigen::Matrix2d covariance_m2_ = Eigen::Matrix2d::Zero();  ///< Of the vehicle, as last known.
  std::vector<PlacedChange> passed_;                         ///< To be told with the next answer.
  std::optional<geo::GeoPoint> last_remembered_;
  std::int64_t last_stamp_ns_ = 0;
};

}  // namespace livemap::change
