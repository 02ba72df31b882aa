#include "vehicle/positioning/pose_track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using Answer = FixTrack::Answer;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// 10 m/s to the east, turning through north.
geo::TrackPose PoseAt(double seconds) {
  geo::TrackPose pose;
  pose.position = geo::GeodesicDestination(kStart, M_PI / 2, 10 * seconds);
  pose.covariance_m2 = (1 + seconds) * Eigen::Matrix2d::Identity();
  pose.course_rad = std::remainder(0.2 * seconds - 0.1, 2 * M_PI);
  pose.course_variance_rad2 = 1e-4;
  return pose;
}

TEST(PoseTrack, InterpolatesPositionAndHeadingThroughNorth) {
  PoseTrack track({});
  EXPECT_TRUE(track.Add(StampNs(0.4), PoseAt(0.4)));
  geo::TrackPose later = PoseAt(0.6);
  later.course_rad += 2 * M_PI;
  EXPECT_TRUE(track.Add(StampNs(0.6), later));
  const auto lookup = track.At(StampNs(0.5));
  ASSERT_EQ(lookup.answer, Answer::kReady);
  EXPECT_LT(geo::GeodesicDistanceM(lookup.pose.position, PoseAt(0.5).position), 1e-3);
  EXPECT_NEAR(std::remainder(lookup.pose.course_rad, 2 * M_PI), 0.0, 1e-9);
  EXPECT_NEAR(lookup.pose.covariance_m2(0, 0), 1.5, 1e-9);
}

TEST(PoseTrack, CarriesNothingOnAndBridgesNoGap) {
  PoseTrack track({});
  EXPECT_EQ(track.At(StampNs(1)).answer, Answer::kWait);
  track.Add(StampNs(1), PoseAt(1));
  EXPECT_EQ(track.At(StampNs(1)).answer, Answer::kReady);
  EXPECT_EQ(track.At(StampNs(1.01)).answer, Answer::kWait);
  EXPECT_EQ(track.At(StampNs(0.9)).answer, Answer::kHopeless);
  track.Add(StampNs(1.6), PoseAt(1.6));
  EXPECT_EQ(track.At(StampNs(1.3)).answer, Answer::kHopeless) << "0.6 s between the poses";
}

TEST(PoseTrack, PosesThatComeLaterDoNotChangeAnAnswerThatWasReady) {
  PoseTrack track({});
  for (int i = 0; i <= 10; ++i) track.Add(StampNs(0.1 * i), PoseAt(0.1 * i));
  const geo::TrackPose before = track.At(StampNs(0.93)).pose;
  geo::TrackPose swerved = PoseAt(1.1);
  swerved.course_rad = 2;
  track.Add(StampNs(1.1), swerved);
  const geo::TrackPose after = track.At(StampNs(0.93)).pose;
  EXPECT_EQ(after.position.latitude_deg, before.position.latitude_deg);
  EXPECT_EQ(after.position.longitude_deg, before.position.longitude_deg);
  EXPECT_EQ(after.course_rad, before.course_rad);
}

TEST(PoseTrack, RefusesWhatCannotBe) {
  PoseTrack track({});
  ASSERT_TRUE(track.Add(StampNs(1), PoseAt(1)));
  EXPECT_FALSE(track.Add(StampNs(1), PoseAt(1))) << "not later";
  EXPECT_FALSE(track.Add(StampNs(0.5), PoseAt(0.5))) << "a little earlier";
  EXPECT_FALSE(track.Add(0, PoseAt(1.1)));
  geo::TrackPose pose = PoseAt(1.1);
  pose.course_rad = kNan;
  EXPECT_FALSE(track.Add(StampNs(1.1), pose));
  pose = PoseAt(1.1);
  pose.position.latitude_deg = 91;
  EXPECT_FALSE(track.Add(StampNs(1.1), pose));
  pose = PoseAt(1.1);
  pose.covariance_m2(0, 1) = pose.covariance_m2(1, 0) = 5;
  EXPECT_FALSE(track.Add(StampNs(1.1), pose)) << "no covariance";
  pose = PoseAt(1.1);
  pose.course_variance_rad2 = kNan;
  EXPECT_FALSE(track.Add(StampNs(1.1), pose));
  EXPECT_EQ(track.newest_ns(), StampNs(1));
}

TEST(PoseTrack, BeginsAgainWhenTheClockIsSetBack) {
  PoseTrack track({});
  track.Add(StampNs(20), PoseAt(20));
  EXPECT_TRUE(track.Add(StampNs(2), PoseAt(2), StampNs(2)));
  EXPECT_EQ(track.newest_ns(), StampNs(2));
  EXPECT_EQ(track.At(StampNs(20)).answer, Answer::kWait);
}

TEST(PoseTrack, OneStampOfThePastOrFutureChangesNothing) {
  constexpr double kYearS = 365 * 86400.0;
  PoseTrack track({});
  track.Add(StampNs(20), PoseAt(20));
  EXPECT_FALSE(track.Add(StampNs(2), PoseAt(2)));
  EXPECT_FALSE(track.Add(StampNs(kYearS), PoseAt(20.1), StampNs(20.1)));
  EXPECT_FALSE(track.Add(StampNs(kYearS), PoseAt(20.1)));
  EXPECT_TRUE(track.Add(StampNs(20.2), PoseAt(20.2), StampNs(20.2)));
}

}  // namespace
}  // namespace livemap::vehicle
