#include "placement/hazard_sights.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace livemap::placement {
namespace {

constexpr geo::GeoPoint kStart{40.4433, -79.9436};
constexpr double kCourseRad = 0.7;
constexpr double kSpeedMps = 10;
constexpr double kWayM = 14;  // Of a pass, in images a metre apart.
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Errors of one pass, in units of their standard deviations unless it says otherwise.
struct PassErrors {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double heading_rad = 0;
  double pitch_rad = 0;
  double height_m = 0;
};

/// A vehicle that drives straight on towards a hazard, and what its camera sees of it.
class HazardSightsTest : public ::testing::Test {
 protected:
  HazardSightsTest() {
    mounting_.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    mounting_.translation() = Eigen::Vector3d(1.5, 0, 1.5);
    pose_.covariance_m2 << 2.0, 0.3, 0.3, 1.0;
    pose_.course_rad = kCourseRad;
    pose_.course_variance_rad2 = 0.02 * 0.02;
    pose_.speed_mps = kSpeedMps;
  }

  geo::GeoPoint Hazard() const { return geo::GeodesicDestination(Ahead(20), kCourseRad + 1.57, 2); }
  static geo::GeoPoint Ahead(double way_m) {
    return geo::GeodesicDestination(kStart, kCourseRad, way_m);
  }

  /// After `way_m` of the vehicle's way; the pixel is off by `pixel_error_px`, the suspension
  /// nods by `nod_rad`.
  HazardSight SightAfter(double way_m, const PassErrors& errors = {},
                         const Eigen::Vector2d& pixel_error_px = Eigen::Vector2d::Zero(),
                         double nod_rad = 0) const {
    HazardSight sight;
    sight.stamp_ns = std::llround(way_m / kSpeedMps * 1e9);
    sight.base = pose_;
    // A wrong heading turns the way, too, here about where the pass ends.
    const double to_end_m = kWayM - way_m;
    const Eigen::Vector2d turned_m = errors.heading_rad * to_end_m *
                                     Eigen::Vector2d(-std::cos(kCourseRad), std::sin(kCourseRad));
    sight.base.position = geo::LocalFrame(Ahead(way_m)).ToGeo(errors.position_m + turned_m);
    sight.base.course_rad += errors.heading_rad;
    sight.intrinsics = {500, 500, 319.5, 199.5, 640, 400};
    sight.base_from_optical = mounting_;
    sight.noise = noise_;
    const Eigen::Vector2d enu_m = geo::LocalFrame(Ahead(way_m)).ToEnu(Hazard());
    const Eigen::Vector3d in_base_m(
        std::sin(kCourseRad) * enu_m.x() + std::cos(kCourseRad) * enu_m.y(),
        -std::cos(kCourseRad) * enu_m.x() + std::sin(kCourseRad) * enu_m.y(), 0);
    Eigen::Isometry3d true_mounting = mounting_;
    true_mounting.translation().z() += errors.height_m;
    true_mounting.linear() =
        Eigen::AngleAxisd(errors.pitch_rad + nod_rad, Eigen::Vector3d::UnitY()) *
        mounting_.linear();
    const Eigen::Vector3d optical_m = true_mounting.inverse() * in_base_m;
    sight.pixel = {500 * optical_m.x() / optical_m.z() + 319.5 + pixel_error_px.x(),
                   500 * optical_m.y() / optical_m.z() + 199.5 + pixel_error_px.y()};
    const auto foot =
        geo::ProjectToGround(sight.pixel, sight.intrinsics, sight.base_from_optical, noise_);
    if (foot) sight.foot = *foot;
    return sight;
  }

  Eigen::Vector2d ErrorOf(const geo::GeoPoint& place) const {
    return geo::LocalFrame(Hazard()).ToEnu(place);
  }

  Eigen::Isometry3d mounting_ = Eigen::Isometry3d::Identity();
  geo::GroundProjectionNoise noise_{3.0, 0.006, 0.03, 200};
  geo::TrackPose pose_;
  HazardSights::Config config_;
};

TEST_F(HazardSightsTest, OneSightGivesWhatPlaceHazardGives) {
  pose_.position_course << 0.005, -0.01;
  HazardSights sights(config_);
  EXPECT_FALSE(sights.Place());
  const HazardSight sight = SightAfter(8, {}, {2, -1});
  ASSERT_TRUE(sights.Add(sight));
  const PlacedHazard alone = PlaceHazard(sight.base, Eigen::Vector2d::Zero(), sight.foot);
  const SightsPlace& place = *sights.Place();
  EXPECT_LT(geo::GeodesicDistanceM(place.place.position, alone.position), 1e-3);
  EXPECT_TRUE(place.place.covariance_m2.isApprox(alone.covariance_m2, 1e-3))
      << place.place.covariance_m2 << "\n\n"
      << alone.covariance_m2;
  EXPECT_LT(place.seen_from_vehicle_m2.trace(), alone.covariance_m2.trace());
}

TEST_F(HazardSightsTest, ExactSightsGiveTheExactPlaceFromFarAndNear) {
  HazardSights sights(config_);
  for (double way_m = 0; way_m < 16; way_m += 1) ASSERT_TRUE(sights.Add(SightAfter(way_m)));
  EXPECT_LT(ErrorOf(sights.Place()->place.position).norm(), 1e-3);
  EXPECT_EQ(sights.Place()->sights, 16u);
}

TEST_F(HazardSightsTest, MoreSightsMakeThePlaceSurerButNotTheReceiver) {
  HazardSights sights(config_);
  sights.Add(SightAfter(0));
  const SightsPlace first = *sights.Place();
  for (double way_m = 1; way_m < 16; way_m += 1) sights.Add(SightAfter(way_m));
  const SightsPlace last = *sights.Place();
  EXPECT_LT(last.seen_from_vehicle_m2.trace(), first.seen_from_vehicle_m2.trace() / 20);
  EXPECT_GE(last.place.covariance_m2.trace(), pose_.covariance_m2.trace() * 0.999);
  EXPECT_LT(last.place.covariance_m2.trace(), pose_.covariance_m2.trace() * 1.1);
}

TEST_F(HazardSightsTest, StatedCovarianceIsTheErrorOver200Passes) {
  // Errors of the sizes that the sights state; seeds that no setting was chosen on.
  double seen_nees = 0;
  double total_nees = 0;
  double squares_m2 = 0;
  double nearest_squares_m2 = 0;
  constexpr int kPasses = 200;
  for (int seed = 1; seed <= kPasses; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    const auto draw = [&](double sigma) { return sigma * normal(random); };
    PassErrors errors;
    const Eigen::Matrix2d root = pose_.covariance_m2.llt().matrixL();
    errors.position_m = root * Eigen::Vector2d(draw(1), draw(1));
    errors.heading_rad = draw(std::sqrt(pose_.course_variance_rad2));
    errors.pitch_rad = draw(noise_.pitch_sigma_rad * std::sqrt(config_.lasting_pitch_share));
    errors.height_m = draw(noise_.height_sigma_m);
    const double nod_sigma = noise_.pitch_sigma_rad * std::sqrt(1 - config_.lasting_pitch_share);
    HazardSights sights(config_);
    HazardSight newest;
    for (double way_m = 0; way_m < 15; way_m += 1) {
      newest = SightAfter(way_m, errors, {draw(3), draw(3)}, draw(nod_sigma));
      sights.Add(newest);
    }
    const SightsPlace& place = *sights.Place();
    const Eigen::Vector2d error = ErrorOf(place.place.position);
    const Eigen::Vector2d seen = error - errors.position_m;
    total_nees += error.dot(place.place.covariance_m2.inverse() * error) / 2 / kPasses;
    seen_nees += seen.dot(place.seen_from_vehicle_m2.inverse() * seen) / 2 / kPasses;
    squares_m2 += seen.squaredNorm();
    const PlacedHazard alone = PlaceHazard(newest.base, Eigen::Vector2d::Zero(), newest.foot);
    nearest_squares_m2 += (ErrorOf(alone.position) - errors.position_m).squaredNorm();
  }
  RecordProperty("seen_nees", std::to_string(seen_nees));
  RecordProperty("total_nees", std::to_string(total_nees));
  EXPECT_GT(total_nees, 0.8);
  EXPECT_LT(total_nees, 1.25);
  EXPECT_GT(seen_nees, 0.7);
  EXPECT_LT(seen_nees, 1.3);
  EXPECT_LT(squares_m2, nearest_squares_m2) << "all sights beat the nearest one alone";
}

TEST_F(HazardSightsTest, OneWrongSightPullsLittle) {
  HazardSights sights(config_);
  for (double way_m = 4; way_m < 14; way_m += 1) {
    sights.Add(
        SightAfter(way_m, {}, way_m == 10 ? Eigen::Vector2d(40, 20) : Eigen::Vector2d(0, 0)));
  }
  EXPECT_LT(ErrorOf(sights.Place()->place.position).norm(), 0.3);
}

TEST_F(HazardSightsTest, AStandingVehicleLearnsNothingNewAndMemoryIsBounded) {
  HazardSights sights(config_);
  ASSERT_TRUE(sights.Add(SightAfter(5)));
  EXPECT_FALSE(sights.Add(SightAfter(5)));
  EXPECT_FALSE(sights.Add(SightAfter(5.1)));
  EXPECT_EQ(sights.size(), 1u);
  for (double way_m = 5.3; way_m < 16; way_m += 0.3) sights.Add(SightAfter(way_m));
  EXPECT_EQ(sights.size(), static_cast<std::size_t>(config_.max_sights));
}

TEST_F(HazardSightsTest, ScatterBeyondTheStatedMakesThePlaceLessSure) {
  noise_ = {3.0, 0.0005, 0.001, 200};
  pose_.course_variance_rad2 = 0;
  double as_stated_m2 = 0;
  double wilder_m2 = 0;
  double scatter = 0;
  constexpr int kPasses = 20;
  for (int seed = 1; seed <= kPasses; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    HazardSights as_stated(config_);
    HazardSights wilder(config_);
    for (double way_m = 2; way_m < 15; way_m += 1) {
      const Eigen::Vector2d pixel(normal(random), normal(random));
      as_stated.Add(SightAfter(way_m, {}, pixel * 2));
      wilder.Add(SightAfter(way_m, {}, pixel * 9));
    }
    as_stated_m2 += as_stated.Place()->seen_from_vehicle_m2.trace();
    wilder_m2 += wilder.Place()->seen_from_vehicle_m2.trace();
    scatter += wilder.Place()->scatter / kPasses;
  }
  EXPECT_GT(scatter, 1.2);
  EXPECT_GT(wilder_m2, 1.3 * as_stated_m2);
}

TEST_F(HazardSightsTest, ANearerPoseCountsMoreAndNoWeightIsNegative) {
  HazardSights sights(config_);
  pose_.covariance_m2 = Eigen::Matrix2d::Identity() * 9.0;
  sights.Add(SightAfter(8, {{3, 0}, 0, 0, 0}));
  pose_.covariance_m2 = Eigen::Matrix2d::Identity() * 1.0;
  sights.Add(SightAfter(9, {{0, 0}, 0, 0, 0}));
  const Eigen::Vector2d error = ErrorOf(sights.Place()->place.position);
  EXPECT_GT(error.x(), -0.05);
  EXPECT_LT(error.x(), 1.0);
  EXPECT_LT(sights.Place()->place.covariance_m2.trace(), 2.5);
}

TEST_F(HazardSightsTest, DistanceTellsTheSameHazardFromAnother) {
  HazardSights sights(config_);
  EXPECT_FALSE(sights.Distance2(SightAfter(5)));
  for (double way_m = 2; way_m < 10; way_m += 1) sights.Add(SightAfter(way_m));
  EXPECT_LT(*sights.Distance2(SightAfter(11, {}, {2, 2})), 6);
  // 60 pixels beside it.
  EXPECT_GT(*sights.Distance2(SightAfter(11, {}, {60, 0})), 20);
}

TEST_F(HazardSightsTest, FixScatterOfOneSecondCountsOnce) {
  // Ten sights between two fixes share their error; the place is no surer than by one.
  pose_.covariance_m2 = Eigen::Matrix2d::Identity();
  pose_.course_variance_rad2 = 0;
  HazardSights sights(config_);
  for (double way_m = 6; way_m < 15; way_m += 1) {
    HazardSight sight = SightAfter(way_m);
    sight.own_position_sigma_m = 0.9;
    sights.Add(sight);
  }
  EXPECT_GT(sights.Place()->place.covariance_m2.trace(), 1.8);
}

TEST_F(HazardSightsTest, ADepthIsUsedAndItsScaleDoesNotAverageOut) {
  pose_.covariance_m2.setZero();
  pose_.course_variance_rad2 = 0;
  HazardSights sights(config_);
  for (double way_m = 4; way_m < 14; way_m += 1) {
    HazardSight sight = SightAfter(way_m);
    // Each depth 3 % too long.
    const Eigen::Vector2d camera_m = mounting_.translation().head<2>();
    sight.foot.position_m = camera_m + 1.03 * (sight.foot.position_m - camera_m);
    sight.foot.covariance_m2 = Eigen::Matrix2d::Identity() * 0.01;
    sight.depth_sigma_share = 0.03;
    sights.Add(sight);
  }
  const Eigen::Vector2d error = ErrorOf(sights.Place()->place.position);
  const double sigma_m = std::sqrt(sights.Place()->place.covariance_m2.trace());
  EXPECT_LT(error.norm(), 3 * sigma_m);
  EXPECT_LT(error.norm(), 0.3);
}

TEST_F(HazardSightsTest, WhatIsNoNumberIsRefusedAndChangesNothing) {
  HazardSights sights(config_);
  ASSERT_TRUE(sights.Add(SightAfter(4)));
  const geo::GeoPoint before = sights.Place()->place.position;
  std::vector<HazardSight> broken(9, SightAfter(8));
  broken[0].pixel.x() = kNaN;
  broken[1].foot.position_m.y() = kNaN;
  broken[2].foot.covariance_m2(0, 0) = -1;
  broken[3].base.position.latitude_deg = kNaN;
  broken[4].base.covariance_m2(1, 1) = kNaN;
  broken[5].base.course_variance_rad2 = -1;
  broken[6].own_heading_share = 2;
  broken[7].depth_sigma_share = kNaN;
  broken[8].intrinsics.fx = 0;
  for (const HazardSight& sight : broken) {
    EXPECT_FALSE(sights.Add(sight));
    EXPECT_FALSE(sights.Distance2(sight));
  }
  EXPECT_EQ(sights.size(), 1u);
  EXPECT_EQ(sights.Place()->place.position.latitude_deg, before.latitude_deg);
}

}  // namespace
}  // namespace livemap::placement
