#include "vehicle/positioning/vehicle_pose_lookup.h"

#include <gtest/gtest.h>

#include <cmath>

#include "placement/hazard_placement.h"
#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using PoseAnswer = VehiclePoseLookup::Answer;

VehiclePoseLookup Driven(const VehiclePoseLookup::Config& config, double to_s) {
  VehiclePoseLookup lookup(config);
  for (int tenth = 0; tenth <= std::lround(10 * to_s); ++tenth) lookup.AddFix(FixAt(0.1 * tenth));
  return lookup;
}

geo::TrackPose FusedAt(double seconds) {
  geo::TrackPose pose;
  pose.position = VehicleAt(seconds);
  pose.covariance_m2 = 0.04 * Eigen::Matrix2d::Identity();
  pose.course_rad = kBearingRad;
  pose.course_variance_rad2 = 1e-4;
  return pose;
}

TEST(VehiclePoseLookup, WaitsForAFixAfterTheImageThenCarriesOn) {
  const VehiclePoseLookup lookup = Driven({}, 3);
  EXPECT_EQ(lookup.At(StampNs(2.95), 0).answer, PoseAnswer::kReady);
  const VehiclePoseLookup::Lookup later = lookup.At(StampNs(3.05), 0.29);
  EXPECT_EQ(later.answer, PoseAnswer::kWait);
  EXPECT_FALSE(later.unknown) << "it is known, and may be known better";
  EXPECT_EQ(lookup.At(StampNs(3.05), 0.3).answer, PoseAnswer::kReady);
}

TEST(VehiclePoseLookup, WaitsForAnyPositionOnlySoLong) {
  const VehiclePoseLookup lookup = Driven({}, 3);
  EXPECT_EQ(lookup.At(StampNs(6), 4.9).answer, PoseAnswer::kWait);
  EXPECT_TRUE(lookup.At(StampNs(6), 4.9).unknown);
  EXPECT_EQ(lookup.At(StampNs(6), 5).answer, PoseAnswer::kHopeless);
  EXPECT_EQ(lookup.At(StampNs(-1), 0).answer, PoseAnswer::kHopeless) << "before the first fix";
  EXPECT_EQ(lookup.At(StampNs(6), 1, {0, 0.3, 1}).answer, PoseAnswer::kHopeless) << "less patient";
}

TEST(VehiclePoseLookup, TheFixesCountWhereTheFusedPoseDoesNotCome) {
  VehiclePoseLookup::Config config;
  config.use_fused = true;
  VehiclePoseLookup lookup = Driven(config, 3);
  lookup.AddPose(StampNs(1), FusedAt(1));
  EXPECT_TRUE(lookup.At(StampNs(1), 0).fused);
  EXPECT_EQ(lookup.At(StampNs(2), 0.9).answer, PoseAnswer::kWait);
  EXPECT_FALSE(lookup.At(StampNs(2), 0.9).unknown) << "the fixes know it";
  const VehiclePoseLookup::Lookup by_fixes = lookup.At(StampNs(2), 1);
  EXPECT_EQ(by_fixes.answer, PoseAnswer::kReady);
  EXPECT_FALSE(by_fixes.fused);
  EXPECT_EQ(lookup.At(StampNs(2), 0, {0, 0.3, 5}).answer, PoseAnswer::kReady) << "in a hurry";
  EXPECT_EQ(lookup.At(StampNs(0.5), 0).answer, PoseAnswer::kReady) << "no fused pose will come";
}

TEST(VehiclePoseLookup, NothingWaitsForFusedPosesThatDoNotCome) {
  VehiclePoseLookup::Config config;
  config.use_fused = true;
  VehiclePoseLookup lookup = Driven(config, 6);
  EXPECT_EQ(lookup.At(StampNs(3), 0).answer, PoseAnswer::kReady) << "none has ever come";
  lookup.AddPose(StampNs(3), FusedAt(3));
  EXPECT_EQ(lookup.At(StampNs(4.9), 0).answer, PoseAnswer::kWait) << "they come";
  EXPECT_EQ(lookup.At(StampNs(5.1), 0).answer, PoseAnswer::kReady) << "they have ended";
}

TEST(VehiclePoseLookup, APlaceFromBaseLinkIsThatFromTheAntenna) {
  VehiclePoseLookup::Config config;
  config.antenna_x_m = -1.5;
  config.antenna_y_m = 0.4;
  const VehiclePoseLookup lookup = Driven(config, 3);
  const FixTrack::Lookup antenna = lookup.fixes().At(StampNs(2));
  const VehiclePoseLookup::Lookup base = lookup.At(StampNs(2), 0);
  ASSERT_EQ(base.answer, PoseAnswer::kReady);
  const geo::GroundPoint ground{{14, -2}, 0.09 * Eigen::Matrix2d::Identity()};
  const auto by_antenna = placement::PlaceHazard(antenna.pose, {-1.5, 0.4}, ground);
  const auto by_base = placement::PlaceHazard(base.base, {0, 0}, ground);
  EXPECT_LT(geo::GeodesicDistanceM(by_antenna.position, by_base.position), 1e-4);
  EXPECT_LT((by_antenna.covariance_m2 - by_base.covariance_m2).norm(),
            1e-9 * by_antenna.covariance_m2.norm());
}

}  // namespace
}  // namespace livemap::vehicle
