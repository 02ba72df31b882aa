#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

/// The fused pose of base_link: a metre left of what the fixes say, and turned by 0.05 rad.
geo::TrackPose FusedPoseAt(double seconds) {
  geo::TrackPose pose;
  pose.position = geo::GeodesicDestination(VehicleAt(seconds), kBearingRad - M_PI / 2, 1.0);
  pose.covariance_m2 = 0.04 * Eigen::Matrix2d::Identity();
  pose.course_rad = kBearingRad + 0.05;
  pose.course_variance_rad2 = 1e-5;
  pose.speed_mps = kSpeedMps;
  return pose;
}

geo::GeoPoint AheadOf(const geo::TrackPose& pose, double forward_m) {
  return geo::GeodesicDestination(pose.position, pose.course_rad, forward_m);
}

TEST_F(HazardReporterTest, PlacesByTheFusedPoseAndItsHeadingWhereTheAntennaIsElsewhere) {
  config_.position_source = PositionSource::kFused;
  config_.antenna_x_m = 3;  // Of the receiver; the fused pose is that of base_link.
  Restart();
  DriveFixes(0, 4);
  for (const double time_s : {3.0, 3.1, 3.2}) {
    reporter_->AddPose(StampNs(time_s), FusedPoseAt(time_s));
  }
  See(3.15, {{"pothole", 0.8F, BoxAt(12, 0)}});
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position, AheadOf(FusedPoseAt(3.15), 12)), 0.02);
  EXPECT_LT(reports[0].covariance_m2.trace(), 0.7) << "of the fused pose, not of the fixes";
  EXPECT_EQ(counters().placed_by_fusion, 1u);
  EXPECT_EQ(counters().placed_by_fixes, 0u);
}

TEST_F(HazardReporterTest, WaitsForTheFusedPoseAndFallsBackToTheFixesWhenItDoesNotCome) {
  config_.position_source = PositionSource::kFused;
  config_.image_wait_s = 0;
  Restart();
  DriveFixes(0, 4);
  reporter_->AddPose(StampNs(2.0), FusedPoseAt(2.0));
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty()) << "it may come yet";
  ProcessWithPictures(3.0 + config_.fused_wait_s + 0.01);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  const geo::GeoPoint by_fixes = geo::GeodesicDestination(VehicleAt(3.0), kBearingRad, 12);
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position, by_fixes), 0.02);
  EXPECT_EQ(counters().placed_by_fixes, 1u);
  EXPECT_EQ(counters().held_back_no_fix, 0u);

  reporter_->AddFrame(FrameAt(3.3, {{"debris", 0.8F, BoxAt(12, 0)}}), 4.5);
  ProcessWithPictures(4.6);
  EXPECT_THAT(TakeDue(), IsEmpty());
  reporter_->AddPose(StampNs(3.3), FusedPoseAt(3.3));
  ProcessWithPictures(4.7);
  ASSERT_THAT(TakeDue(), SizeIs(1));
  EXPECT_EQ(counters().placed_by_fusion, 1u);
}

TEST_F(HazardReporterTest, AFusedHeadingThatIsUncertainWaitsForANearerView) {
  config_.position_source = PositionSource::kFused;
  config_.max_ground_sigma_m = 1.0;
  Restart();
  for (const double time_s : {3.0, 3.5}) {
    geo::TrackPose pose = FusedPoseAt(time_s);
    pose.course_variance_rad2 = 0.08 * 0.08;
    reporter_->AddPose(StampNs(time_s), pose);
  }
  See(3.0, {{"pothole", 0.8F, BoxAt(13.5, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty()) << "0.08 rad are 1.1 m there";
  EXPECT_EQ(counters().too_far, 1u);
  See(3.5, {{"pothole", 0.8F, BoxAt(5.5, 0)}});
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(HazardReporterTest, FixesThatStandInForFusedPosesWaitForANearerViewToo) {
  config_.max_ground_sigma_m = 0.5;
  config_.track.course_noise_m = 1.8;  // The course is 0.1 rad off and more.
  for (const PositionSource source : {PositionSource::kFixes, PositionSource::kFused}) {
    config_.position_source = source;
    const bool is_fused = source == PositionSource::kFused;
    config_.map.path = directory_.path() + (is_fused ? "/fused.sqlite3" : "/fixes.sqlite3");
    Restart();
    DriveFixes(0, 4);
    See(2.0, {{"pothole", 0.8F, BoxAt(9, 0)}});
    EXPECT_THAT(TakeDue(), SizeIs(is_fused ? 0 : 1))
        << "the fixes alone have nothing better to wait for";
  }
}

TEST_F(HazardReporterTest, FusedPosesWithoutFixesAreEnough) {
  config_.position_source = PositionSource::kFused;
  Restart();
  reporter_->AddPose(StampNs(3.0), FusedPoseAt(3.0));
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), SizeIs(1)) << "the receiver may have lost its fix: that is what it is for";
  geo::TrackPose bad = FusedPoseAt(3.1);
  bad.course_rad = std::numeric_limits<double>::quiet_NaN();
  reporter_->AddPose(StampNs(3.1), bad);
  EXPECT_EQ(counters().poses, 2u);
  EXPECT_EQ(counters().invalid_poses, 1u);
}

TEST_F(HazardReporterTest, DistanceIsThatOfTheDepthAtTheFootAndElseOfThePlane) {
  config_.use_depth = true;
  Restart();
  DriveFixes(0, 4);
  const imaging::Box box = BoxAt(12, 0);  // 10.5 m ahead of the camera, says the plane.
  placement::DepthImage depth;
  depth.depth = cv::Mat(400, 640, CV_32FC1, cv::Scalar(9.5F));
  reporter_->AddDepth(StampNs(3.0), depth);
  See(3.0, {{"pothole", 0.8F, box}});
  auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position,
                                   geo::GeodesicDestination(VehicleAt(3.0), kBearingRad, 11)),
            0.02);
  EXPECT_EQ(counters().distances_by_depth, 1u);

  depth.depth = cv::Mat(400, 640, CV_32FC1, cv::Scalar(0));
  reporter_->AddDepth(StampNs(3.4), depth);
  See(3.4, {{"debris", 0.8F, box}});
  reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position,
                                   geo::GeodesicDestination(VehicleAt(3.4), kBearingRad, 12)),
            0.02);
  EXPECT_EQ(counters().distances_by_depth, 1u);
}

TEST_F(HazardReporterTest, WaitsForTheDepthImageNoLongerThanItMay) {
  config_.use_depth = true;
  Restart();
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty());
  ProcessWithPictures(3.0 + config_.depth_wait_s + 0.01);
  EXPECT_THAT(TakeDue(), SizeIs(1)) << "by the plane";
  for (int i = 0; i < 200; ++i) reporter_->AddDepth(StampNs(10 + 0.1 * i), {});
  See(3.5, {{"debris", 0.8F, BoxAt(12, 0)}});
  reporter_->AddDepth(StampNs(3.5), {cv::Mat(400, 640, CV_32FC1, cv::Scalar(9.5F)), 1, nullptr});
  ProcessWithPictures(3.6);
  EXPECT_THAT(TakeDue(), SizeIs(1)) << "also after a clock that was set back";
  EXPECT_EQ(counters().distances_by_depth, 1u);
}

}  // namespace
}  // namespace livemap::vehicle
