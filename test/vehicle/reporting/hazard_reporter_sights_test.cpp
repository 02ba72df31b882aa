#include <gmock/gmock.h>

#include <cmath>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

/// A vehicle whose receiver is off by the same way all the time, whose heading is off, too, and
/// whose reporter waits for further sights.
class ReporterSightsTest : public HazardReporterTest {
 protected:
  ReporterSightsTest() {
    config_.position_source = PositionSource::kFused;
    config_.max_ground_sigma_m = 1.0;
    config_.settle_wait_s = 1.5;
    Restart();
  }

  void DriveTo(double time_s) {
    for (; driven_s_ <= time_s + 1e-9; driven_s_ += 0.1) {
      geo::TrackPose pose;
      pose.position = geo::LocalFrame(VehicleAt(driven_s_)).ToGeo({0.5, -0.3});
      pose.covariance_m2 = Eigen::Matrix2d::Identity();
      pose.course_rad = kBearingRad + 0.05;
      pose.course_variance_rad2 = 0.03 * 0.03;
      pose.speed_mps = kSpeedMps;
      reporter_->AddPose(StampNs(driven_s_), pose);
    }
  }

  /// A hazard that lies so far ahead and left of where the vehicle is at 3 s.
  void SeeAt(double time_s, const char* name, double forward_m, double left_m) {
    DriveTo(time_s);
    const double ahead_m = forward_m - kSpeedMps * (time_s - 3);
    See(time_s, {{name, 0.8F, BoxAt(ahead_m, left_m)}});
  }

  static geo::GeoPoint PlaceAt(double forward_m, double left_m) {
    const geo::GeoPoint ahead = geo::GeodesicDestination(VehicleAt(3), kBearingRad, forward_m);
    return geo::GeodesicDestination(ahead, kBearingRad - M_PI / 2, left_m);
  }

  double driven_s_ = 2.5;
};

TEST_F(ReporterSightsTest, AHazardThatCanWaitIsReportedOnceByAllItsSights) {
  // 24 m ahead it is too far away to be reported; that sight counts all the same.
  for (double time_s = 3; time_s < 4.15; time_s += 0.1) SeeAt(time_s, "pothole", 24, 1);
  ProcessWithPictures(5.5);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_GT(counters().sights_used, 6u);
  EXPECT_GT(counters().too_far, 2u);
  // Of the heading's error, which is 1 m at 20 m, little is left; the receiver's stays.
  const geo::GeoPoint as_located = geo::LocalFrame(PlaceAt(24, 1)).ToGeo({0.5, -0.3});
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position, as_located), 0.5);
  EXPECT_GT(reports[0].covariance_m2.trace(), 1.99);
  EXPECT_LT(reports[0].covariance_m2.trace(), 2.3);
  EXPECT_FALSE(reports[0].image.empty());
}

TEST_F(ReporterSightsTest, WhatIsUrgentIsReportedAtItsFirstSightNearEnough) {
  catalogue_ = protocol::HazardCatalogue::Parse("classes:\n  deer:\n    urgency: 1\n", "test");
  Restart();
  SeeAt(3.0, "deer", 12, 0);
  EXPECT_THAT(TakeDue(), SizeIs(1));
  EXPECT_EQ(reporter_->settling_reports(), 0u);
}

TEST_F(ReporterSightsTest, AReportWaitsNoLongerThanItMay) {
  SeeAt(3.0, "pothole", 12, 0);
  EXPECT_EQ(reporter_->settling_reports(), 1u);
  EXPECT_EQ(counters().reports_created, 0u);
  ProcessWithPictures(3.0 + config_.settle_wait_s - 0.01);
  EXPECT_THAT(TakeDue(), IsEmpty());
  ProcessWithPictures(3.0 + config_.settle_wait_s + 0.01);
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(ReporterSightsTest, AClockThatStandsStillHoldsNoReport) {
  SeeAt(3.0, "pothole", 12, 0);
  steady_s_ += 2 * config_.settle_wait_s + 0.01;
  ProcessWithPictures(3.0);
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(ReporterSightsTest, ASurePlaceDoesNotWait) {
  config_.settle_sigma_m = 0.5;
  Restart();
  SeeAt(3.0, "pothole", 5.5, 0);
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(ReporterSightsTest, WhatWaitsForSightsAtTheEndIsReported) {
  SeeAt(3.0, "pothole", 12, 0);
  reporter_->Finish(steady_s_);
  EXPECT_EQ(counters().reports_created, 1u);
  EXPECT_EQ(reporter_->settling_reports(), 0u);
}

TEST_F(ReporterSightsTest, TheReportShowsTheNewestSightAndOrdersNoPictureOfTheOthers) {
  SeeAt(3.0, "pothole", 12, 0);
  SeeAt(3.2, "pothole", 12, 0);
  EXPECT_EQ(counters().pictures_requested, 0u);
  EXPECT_EQ(counters().duplicates_suppressed, 1u);
  ProcessWithPictures(5);
  EXPECT_EQ(counters().pictures_requested, 1u);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_EQ(reports[0].stamp_ns, StampNs(3.2));
  EXPECT_FALSE(reports[0].image.empty());
}

TEST_F(ReporterSightsTest, WhatLeavesTheImageIsReportedAtOnce) {
  // At 16 m/s it is 5.6 m ahead at 3.4 s, and 2.4 m at 3.6 s.
  SeeAt(3.0, "pothole", 12, 0);
  SeeAt(3.2, "pothole", 12, 0);
  EXPECT_EQ(reporter_->settling_reports(), 1u);
  SeeAt(3.4, "pothole", 12, 0);
  EXPECT_EQ(reporter_->settling_reports(), 0u);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_EQ(reports[0].stamp_ns, StampNs(3.4));
}

TEST_F(ReporterSightsTest, WhatNewerImagesDoNotShowIsReportedSoon) {
  SeeAt(3.0, "pothole", 14, 0);
  See(3.03, {});
  EXPECT_EQ(reporter_->settling_reports(), 1u) << "the detector may have missed it once";
  See(3.1, {});
  EXPECT_EQ(reporter_->settling_reports(), 0u);
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(ReporterSightsTest, ADeepThingIsPlacedAtItsMiddleNotAtItsNearEdge) {
  catalogue_ = protocol::HazardCatalogue::Parse("classes: {wreck: {half_depth_m: 3}}", "test");
  config_.position_source = PositionSource::kFixes;
  config_.max_ground_sigma_m = 100;
  config_.settle_wait_s = 0;
  Restart();
  DriveFixes(0, 2.4);
  See(2.0, {{"wreck", 0.9F, BoxAt(12, 0)}});
  const auto reports = TakeDue();
  ASSERT_EQ(reports.size(), 1U);
  const auto middle = geo::GeodesicDestination(VehicleAt(2.0), kBearingRad, 15.0);
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position, middle), 0.1);
}

}  // namespace
}  // namespace livemap::vehicle
