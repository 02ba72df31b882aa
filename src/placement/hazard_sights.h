#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "geo/ground_projection.h"
#include "geo/vehicle_pose.h"
#include "geo/wgs84.h"
#include "placement/hazard_placement.h"

namespace livemap::placement {

/// What one image says of where a hazard's foot is.
struct HazardSight {
  std::int64_t stamp_ns = 0;
  /// Of base_link; its course is the heading.
  geo::TrackPose base;
  /// What of `base` other images of the pass do not share, standard deviation per axis, m: the
  /// scatter of fixes; and the share of the heading's variance. 0 for fused poses.
  double own_position_sigma_m = 0;
  double own_heading_share = 0;
  /// Middle of the box's lower edge as the camera model counts pixels (ContactPixel).
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  geo::CameraIntrinsics intrinsics;
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  geo::GroundProjectionNoise noise;
  /// The foot in base_link with its covariance, by the road's plane or by depth.
  geo::GroundPoint foot;
  /// Set where `foot` is by depth: the error that all depths of the pass share, standard deviation
  /// as a share of the distance.
  std::optional<double> depth_sigma_share;
};

/// A hazard's place from its sights.
struct SightsPlace {
  PlacedHazard place;
  /// Covariance without the error of position that all sights share, east-north, m^2: how well the
  /// place is known from the vehicle.
  Eigen::Matrix2d seen_from_vehicle_m2 = Eigen::Matrix2d::Identity();
  std::size_t sights = 0;
  /// Squared residuals over their degrees of freedom: about 1 where the errors are as stated.
  double scatter = 1;
};

/// Finds the place of one hazard from all sights of one pass, by robust least squares over place,
/// shared error of position and heading, pitch and height of the camera, and scale of the depth.
/// docs/explanation/tracking-and-placement.md has the equations. What the sights share does not
/// average out: the covariance keeps it. One sight gives what PlaceHazard gives. Not thread-safe.
class HazardSights {
 public:
  struct Config {
    /// Sights kept; beyond it the one whose foot is known least goes.
    int max_sights = 24;
    /// A sight nearer than this to the last one, along the vehicle's way, tells nothing new, m.
    double min_way_m = 0.25;
    /// Sights so far apart have errors of their own; nearer ones count in proportion, m.
    double independent_way_m = 1.0;
    /// Error of the vehicle's way between two sights, standard deviation, share of the way.
    double way_sigma_share = 0.03;
    /// How much the error of the heading changes on the way, standard deviation, rad/m.
    double heading_sigma_rad_per_m = 0.0005;
    /// Share of the pitch's variance that is the same in all sights: the mounting's, not the
    /// suspension's.
    double lasting_pitch_share = 0.5;
    /// Where Cauchy's loss begins to doubt a sight, in standard deviations.
    double cauchy_scale = 2.4;
    int iterations = 6;
  };

  explicit HazardSights(const Config& config) : config_(config) {}

  /// False, and nothing changes, when a number of the sight is not finite or a covariance is none,
  /// or when the vehicle has not moved on since the last sight.
  bool Add(const HazardSight& sight);
  /// None without a sight.
  const std::optional<SightsPlace>& Place() const { return place_; }
  /// Squared Mahalanobis distance (two degrees of freedom) of a sight from where this hazard is
  /// expected to be seen; none without a sight, or where the sight is unusable.
  std::optional<double> Distance2(const HazardSight& sight) const;
  std::size_t size() const { return sights_.size(); }

 private:
  /// Place (east, north), the shared error of position and heading in units of its standard
  /// deviations (3), pitch, height and scale of depth in units of theirs.
  static constexpr int kUnknowns = 8;
  using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
  using Information = Eigen::Matrix<double, kUnknowns, kUnknowns>;
  struct Kept {
    HazardSight sight;
    Eigen::Vector2d base_m = Eigen::Vector2d::Zero();  // East-north in frame_.
    double way_m = 0;                                  // Driven since the first sight.
    double share = 1;                                  // Of a sight with errors of its own.
  };
  /// One sight, linear at a point: place_m = rows * unknowns + an error of covariance own_m2.
  struct Linear {
    Eigen::Vector2d place_m;
    Eigen::Matrix<double, 2, kUnknowns> rows;
    Eigen::Matrix2d own_m2;
  };
  /// Error of the poses that all sights share: that of the pose which places the hazard best. A
  /// wrong heading turns the way of the other poses about that one, and so moves all sights alike.
  struct SharedPose {
    Eigen::Matrix2d position_m2 = Eigen::Matrix2d::Zero();
    double heading_rad2 = 0;
    Eigen::Matrix3d root = Eigen::Matrix3d::Zero();  // Of their covariance.
    Eigen::Vector2d base_m = Eigen::Vector2d::Zero();
    double way_m = 0;
    double scatter_gain = 1;  // How often the fixes' scatter counts.
  };

  /// Normal equations of the sights.
  struct Equations {
    Information information = Information::Zero();
    Unknowns right = Unknowns::Zero();
    double squares = 0;   // Weighted, of the residuals.
    double freedom = -2;  // Their degrees: the place takes two.
  };

  Kept ToKept(const HazardSight& sight) const;
  void DropLeastCertain();
  SharedPose FindSharedPose() const;
  double FixScatterGain() const;
  Linear Linearise(const Kept& kept, const SharedPose& shared, const Unknowns& at) const;
  Equations Accumulate(const Unknowns& at) const;
  void Solve();
  void KeepPlace(double scatter);

  Config config_;
  std::optional<geo::LocalFrame> frame_;  // At the first sight's vehicle.
  std::vector<Kept> sights_;              // In the order of their arrival.
  SharedPose shared_;
  Unknowns solution_ = Unknowns::Zero();
  Information covariance_ = Information::Identity();  // Of solution_.
  std::optional<SightsPlace> place_;
};

}  // namespace livemap::placement
