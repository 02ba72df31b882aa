#include "vehicle/positioning/fix_track.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using Answer = FixTrack::Answer;
using Verdict = FixTrack::Verdict;

geo::Fix FixOf(double seconds, const geo::GeoPoint& position, double sigma_m = 0.1) {
  return {StampNs(seconds), true, position, Eigen::Matrix2d::Identity() * sigma_m * sigma_m};
}

/// Where a vehicle is that has driven straight on for some seconds.
geo::GeoPoint Straight(double bearing_rad, double speed_mps, double seconds) {
  return geo::GeodesicDestination(kStart, bearing_rad, speed_mps * seconds);
}

double AngleBetween(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2 * M_PI));
}

/// A track of a straight drive from 0 to `last_s`.
FixTrack Drive(double bearing_rad, double speed_mps, double period_s, double last_s) {
  FixTrack track{FixTrack::Config{}};
  for (double time_s = 0; time_s <= last_s + 1e-9; time_s += period_s) {
    EXPECT_EQ(track.Add(FixOf(time_s, Straight(bearing_rad, speed_mps, time_s))),
              Verdict::kAccepted);
  }
  return track;
}

class FixTrackCourse : public ::testing::TestWithParam<double> {};

TEST_P(FixTrackCourse, InterpolatesPositionAndCourseOfAStraightDrive) {
  const double bearing = GetParam();
  const FixTrack track = Drive(bearing, 16.0, 1.0, 5.0);
  const auto lookup = track.At(StampNs(2.37));
  ASSERT_EQ(lookup.answer, Answer::kReady);
  EXPECT_LT(geo::GeodesicDistanceM(lookup.pose.position, Straight(bearing, 16.0, 2.37)), 0.001);
  EXPECT_LT(AngleBetween(lookup.pose.course_rad, bearing), 1e-4);
  EXPECT_NEAR(lookup.pose.speed_mps, 16.0, 1e-3);
}

TEST_P(FixTrackCourse, CarriesThePositionOnAShortTimeBeyondTheNewestFix) {
  const double bearing = GetParam();
  const FixTrack track = Drive(bearing, 16.0, 0.2, 5.0);
  const auto lookup = track.At(StampNs(5.5));
  ASSERT_EQ(lookup.answer, Answer::kExtrapolated);
  EXPECT_LT(geo::GeodesicDistanceM(lookup.pose.position, Straight(bearing, 16.0, 5.5)), 0.001);
  EXPECT_LT(AngleBetween(lookup.pose.course_rad, bearing), 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Bearings, FixTrackCourse,
                         ::testing::Values(0.0, 0.5, M_PI / 2, 2.5, M_PI, -2.0, -M_PI / 2, -0.1));

TEST(FixTrack, ExtrapolationMakesThePositionLessCertain) {
  const FixTrack track = Drive(1.0, 16.0, 1.0, 5.0);
  const double at_fix = track.At(StampNs(5.0)).pose.covariance_m2.trace();
  const double soon = track.At(StampNs(5.2)).pose.covariance_m2.trace();
  const double later = track.At(StampNs(5.9)).pose.covariance_m2.trace();
  EXPECT_LT(at_fix, soon);
  EXPECT_LT(soon, later);
}

TEST(FixTrack, StaleFixIsWaitedFor) {
  const FixTrack track = Drive(1.0, 16.0, 1.0, 5.0);
  EXPECT_EQ(track.At(StampNs(6.01)).answer, Answer::kWait);
}

TEST(FixTrack, MomentBeforeTheFirstFixIsNeverKnown) {
  const FixTrack track = Drive(1.0, 16.0, 1.0, 5.0);
  EXPECT_EQ(track.At(StampNs(-0.1)).answer, Answer::kHopeless);
}

TEST(FixTrack, LongGapIsNotInterpolated) {
  FixTrack track = Drive(1.0, 16.0, 1.0, 5.0);
  track.Add(FixOf(9.0, Straight(1.0, 16.0, 9.0)));
  EXPECT_EQ(track.At(StampNs(7.0)).answer, Answer::kHopeless);
}

TEST(FixTrack, WithoutAnyMotionTheCourseIsUnknown) {
  FixTrack track{FixTrack::Config{}};
  EXPECT_EQ(track.At(StampNs(0)).answer, Answer::kWait);
  for (int second = 0; second < 5; ++second) track.Add(FixOf(second, kStart));
  EXPECT_EQ(track.At(StampNs(4)).answer, Answer::kWait);
  EXPECT_TRUE(std::isnan(track.Newest()->course_rad));
}

TEST(FixTrack, NoiseOfAStandingVehicleIsNoCourse) {
  std::mt19937_64 random{3};
  std::normal_distribution<double> noise(0, 0.5);
  const geo::LocalFrame frame(kStart);
  FixTrack track{FixTrack::Config{}};
  int claimed = 0;
  for (double time_s = 0; time_s < 60; time_s += 0.2) {
    track.Add(FixOf(time_s, frame.ToGeo({noise(random), noise(random)}), 0.5));
    claimed += track.At(StampNs(time_s)).answer == Answer::kWait ? 0 : 1;
  }
  EXPECT_EQ(claimed, 0);
}

TEST(FixTrack, StandingVehicleKeepsTheCourseItArrivedWith) {
  FixTrack track = Drive(0.7, 10.0, 0.2, 5.0);
  for (double time_s = 5.2; time_s < 25; time_s += 0.2) {
    track.Add(FixOf(time_s, Straight(0.7, 10.0, 5.0)));
  }
  const auto lookup = track.At(StampNs(20.1));
  ASSERT_EQ(lookup.answer, Answer::kReady);
  EXPECT_LT(AngleBetween(lookup.pose.course_rad, 0.7), 0.05);
  EXPECT_LT(lookup.pose.speed_mps, 0.01);
}

TEST(FixTrack, CourseInACurveLagsLessThanItsStatedUncertaintySays) {
  // 10 m/s on a circle of 50 m: 0.2 rad/s.
  const geo::LocalFrame frame(kStart);
  FixTrack track{FixTrack::Config{}};
  for (double time_s = 0; time_s < 12; time_s += 0.1) {
    const double angle = 0.2 * time_s;
    track.Add(FixOf(time_s, frame.ToGeo({50 * (1 - std::cos(angle)), 50 * std::sin(angle)})));
  }
  for (const double moment_s : {6.03, 11.9}) {
    const geo::TrackPose pose = track.At(StampNs(moment_s)).pose;
    const double lag_rad = AngleBetween(pose.course_rad, 0.2 * moment_s);
    EXPECT_LT(lag_rad, 0.15) << moment_s;
    EXPECT_LT(lag_rad, 2 * std::sqrt(pose.course_variance_rad2)) << moment_s;
  }
}

TEST(FixTrack, FixesThatComeLaterDoNotChangeAnAnswerThatWasReady) {
  std::mt19937_64 random{5};
  std::normal_distribution<double> noise(0, 0.5);
  const geo::LocalFrame frame(kStart);
  std::vector<geo::Fix> fixes;
  for (double time_s = 0; time_s < 12; time_s += 0.2) {
    const double way_m = time_s < 3 ? 0 : 8 * (time_s - 3);  // Stands at first.
    fixes.push_back(FixOf(time_s, frame.ToGeo({noise(random), way_m + noise(random)}), 0.5));
  }
  for (const double moment_s : {1.3, 2.9, 3.3, 5.1, 8.05, 10.4}) {
    FixTrack track{FixTrack::Config{}};
    std::optional<geo::TrackPose> first;
    for (const geo::Fix& fix : fixes) {
      track.Add(fix);
      const auto lookup = track.At(StampNs(moment_s));
      if (lookup.answer != Answer::kReady) continue;
      if (!first) first = lookup.pose;
      EXPECT_EQ(lookup.pose.course_rad, first->course_rad) << moment_s;
      EXPECT_EQ(lookup.pose.covariance_m2, first->covariance_m2) << moment_s;
      EXPECT_EQ(lookup.pose.position.latitude_deg, first->position.latitude_deg) << moment_s;
    }
    EXPECT_TRUE(first) << moment_s;
  }
}

TEST(FixTrack, StatedUncertaintyOfTheCourseHoldsUnderNoise) {
  std::mt19937_64 random{11};
  std::normal_distribution<double> noise(0, 0.5);
  const geo::LocalFrame frame(kStart);
  double normalised = 0;
  int count = 0;
  for (int drive = 0; drive < 40; ++drive) {
    FixTrack track{FixTrack::Config{}};
    for (double time_s = 0; time_s < 8; time_s += 0.2) {
      track.Add(FixOf(time_s, frame.ToGeo({noise(random), 16 * time_s + noise(random)}), 0.5));
    }
    const auto lookup = track.At(StampNs(5.1));
    ASSERT_EQ(lookup.answer, Answer::kReady);
    normalised +=
        std::pow(AngleBetween(lookup.pose.course_rad, 0), 2) / lookup.pose.course_variance_rad2;
    ++count;
  }
  // The mean of squared normalised errors is 1 when the variance is honest; the stated one also
  // covers turning, which this drive does not do.
  EXPECT_LT(normalised / count, 1.6);
  EXPECT_GT(normalised / count, 0.02);
}

TEST(FixTrack, WhatIsNoPositionIsRefused) {
  FixTrack track = Drive(1.0, 16.0, 1.0, 2.0);
  geo::Fix fix = FixOf(3.0, Straight(1.0, 16.0, 3.0));
  fix.has_fix = false;
  EXPECT_EQ(track.Add(fix), Verdict::kNoFix);
  EXPECT_EQ(track.Add(FixOf(3.0, {std::nan(""), 0})), Verdict::kInvalid);
  EXPECT_EQ(track.Add(FixOf(3.0, {95, 0})), Verdict::kInvalid);
  fix = FixOf(3.0, Straight(1.0, 16.0, 3.0));
  fix.covariance_m2 = Eigen::Matrix2d::Constant(std::nan(""));
  EXPECT_EQ(track.Add(fix), Verdict::kInvalid);
  fix.covariance_m2 = -Eigen::Matrix2d::Identity();
  EXPECT_EQ(track.Add(fix), Verdict::kInvalid);
  fix.covariance_m2 = (Eigen::Matrix2d() << 1, 5, 5, 1).finished();
  EXPECT_EQ(track.Add(fix), Verdict::kInvalid);
  fix.covariance_m2 = Eigen::Matrix2d::Identity() * 1e9;
  EXPECT_EQ(track.Add(fix), Verdict::kInvalid) << "a fix to 30 km is none";
  EXPECT_EQ(track.Add(FixOf(2.0, Straight(1.0, 16.0, 2.0))), Verdict::kOutOfOrder);
  EXPECT_EQ(track.newest_ns(), StampNs(2.0));
}

TEST(FixTrack, UnknownCovarianceBecomesTheDefault) {
  FixTrack track{FixTrack::Config{}};
  geo::Fix fix = FixOf(0, kStart);
  fix.covariance_m2.reset();
  ASSERT_EQ(track.Add(fix), Verdict::kAccepted);
  fix.stamp_ns += 1'000'000'000;
  ASSERT_EQ(track.Add(fix), Verdict::kAccepted);
  EXPECT_NEAR(track.Newest()->covariance_m2(0, 0), 9.0, 1e-5);
}

TEST(FixTrack, SingleJumpIsNotBelieved) {
  FixTrack track = Drive(1.0, 16.0, 1.0, 3.0);
  EXPECT_EQ(track.Add(FixOf(4.0, Straight(1.0, 16.0, 400.0))), Verdict::kJump);
  EXPECT_EQ(track.Add(FixOf(5.0, Straight(1.0, 16.0, 5.0))), Verdict::kAccepted);
  const auto lookup = track.At(StampNs(4.5));
  ASSERT_EQ(lookup.answer, Answer::kReady);
  EXPECT_LT(geo::GeodesicDistanceM(lookup.pose.position, Straight(1.0, 16.0, 4.5)), 0.01);
}

TEST(FixTrack, JumpThatLastsStartsTheTrackAnew) {
  FixTrack track = Drive(1.0, 16.0, 1.0, 3.0);
  EXPECT_EQ(track.Add(FixOf(4.0, Straight(1.0, 16.0, 404.0))), Verdict::kJump);
  EXPECT_EQ(track.Add(FixOf(5.0, Straight(1.0, 16.0, 405.0))), Verdict::kJump);
  EXPECT_EQ(track.Add(FixOf(6.0, Straight(1.0, 16.0, 406.0))), Verdict::kRestarted);
  EXPECT_EQ(track.At(StampNs(3.5)).answer, Answer::kHopeless) << "nothing is drawn across the jump";
  EXPECT_EQ(track.At(StampNs(5.5)).answer, Answer::kReady);
}

TEST(FixTrack, ScatteredJumpsDoNotStartTheTrackAnew) {
  FixTrack track = Drive(1.0, 16.0, 1.0, 3.0);
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(track.Add(FixOf(4.0 + i, Straight(i * 1.0, 16.0, 500.0))), Verdict::kJump);
  }
}

TEST(FixTrack, ClockSetBackStartsTheTrackAnew) {
  for (const double round_s : {40.0, 5.0}) {
    FixTrack track = Drive(1.0, 16.0, 1.0, round_s);
    EXPECT_EQ(track.Add(FixOf(0.0, kStart), StampNs(0.0)),
              round_s > 5 ? Verdict::kRestarted : Verdict::kBadStamp);
    for (int i = 1; i < 5; ++i) track.Add(FixOf(0.1 * i, kStart), StampNs(0.1 * i));
    EXPECT_EQ(track.newest_ns(), StampNs(0.4)) << round_s;
    EXPECT_EQ(track.At(StampNs(0.5)).answer, Answer::kWait) << "the old course is forgotten too";
  }
}

TEST(FixTrack, StampsThatGoBackWithoutAClockStartTheTrackAnewOnceThreeAgree) {
  FixTrack track = Drive(1.0, 16.0, 1.0, 20.0);
  EXPECT_EQ(track.Add(FixOf(2.0, kStart)), Verdict::kBadStamp);
  EXPECT_EQ(track.Add(FixOf(2.1, kStart)), Verdict::kBadStamp);
  EXPECT_EQ(track.newest_ns(), StampNs(20.0));
  EXPECT_EQ(track.Add(FixOf(2.2, kStart)), Verdict::kRestarted);
}

TEST(FixTrack, AFixOfTheFutureChangesNothing) {
  constexpr double kYearS = 365 * 86400.0;
  FixTrack track = Drive(1.0, 16.0, 1.0, 3.0);
  EXPECT_EQ(track.Add(FixOf(kYearS, Straight(1.0, 16.0, 4.0)), StampNs(4.0)), Verdict::kBadStamp);
  EXPECT_EQ(track.Add(FixOf(kYearS, Straight(1.0, 16.0, 4.0))), Verdict::kBadStamp);
  EXPECT_EQ(track.Add(FixOf(4.0, Straight(1.0, 16.0, 4.0)), StampNs(4.0)), Verdict::kAccepted);
  EXPECT_EQ(track.At(StampNs(3.5)).answer, Answer::kReady);
}

TEST(FixTrack, AWrongFirstFixIsNeverShown) {
  FixTrack track{FixTrack::Config{}};
  EXPECT_EQ(track.Add(FixOf(0, {35.7, 139.7})), Verdict::kAccepted);
  EXPECT_FALSE(track.Newest()) << "nobody agrees with it yet";
  EXPECT_EQ(track.Add(FixOf(1, Straight(1.0, 16.0, 1.0))), Verdict::kJump);
  EXPECT_FALSE(track.Newest());
  EXPECT_EQ(track.Add(FixOf(2, Straight(1.0, 16.0, 2.0))), Verdict::kAccepted);
  EXPECT_EQ(track.newest_ns(), StampNs(2));
  EXPECT_EQ(track.At(StampNs(1.5)).answer, Answer::kReady);
}

TEST(FixTrack, NullIslandIsRefused) {
  FixTrack track = Drive(1.0, 16.0, 1.0, 3.0);
  for (int i = 4; i < 10; ++i) EXPECT_EQ(track.Add(FixOf(i, {0, 0})), Verdict::kInvalid);
  EXPECT_EQ(track.newest_ns(), StampNs(3));
}

TEST(FixTrack, WorksAcrossTheAntimeridian) {
  const geo::GeoPoint start{-16.5, 179.9995};
  FixTrack track{FixTrack::Config{}};
  for (int second = 0; second < 12; ++second) {
    track.Add(FixOf(second, geo::GeodesicDestination(start, M_PI / 2, 16.0 * second)));
  }
  for (const double time_s : {2.5, 3.4, 6.5}) {
    const auto lookup = track.At(StampNs(time_s));
    ASSERT_EQ(lookup.answer, Answer::kReady);
    EXPECT_LT(geo::GeodesicDistanceM(lookup.pose.position,
                                     geo::GeodesicDestination(start, M_PI / 2, 16.0 * time_s)),
              0.01);
  }
}

/// Fixes 0.1 s apart whose errors are new at each, of a straight drive to the east.
FixTrack ScatteredDrive(double sigma_m, unsigned seed, double last_s) {
  FixTrack track{FixTrack::Config{}};
  std::mt19937 random(seed);
  std::normal_distribution<double> error_m(0, sigma_m);
  const geo::LocalFrame frame(kStart);
  for (int i = 0; i <= static_cast<int>(last_s * 10 + 0.5); ++i) {
    const double east_m = 8.0 * 0.1 * i + error_m(random);
    track.Add(FixOf(0.1 * i, frame.ToGeo({east_m, error_m(random)}), sigma_m));
  }
  return track;
}

TEST(FixTrack, FixesThatScatterWidelyMakeTheCourseAsUncertainAsItIs) {
  double squares = 0;
  int known = 0;
  constexpr int kDrives = 200;
  for (unsigned seed = 1; seed <= kDrives; ++seed) {
    const auto lookup = ScatteredDrive(1.5, seed, 4.0).At(StampNs(3.95));
    if (lookup.answer != Answer::kReady) continue;
    ++known;
    const double error_rad = AngleBetween(lookup.pose.course_rad, M_PI / 2);
    squares += error_rad * error_rad / lookup.pose.course_variance_rad2;
  }
  // With a fixed scatter of 0.5 m the mean square is 4, and many courses are 0.3 rad off.
  EXPECT_GT(known, kDrives / 4);
  EXPECT_LT(squares / known, 1.5);
}

TEST(FixTrack, TheFirstFixesOfATrackScatterAsTheyState) {
  const auto first = ScatteredDrive(1.5, 1, 0.5).At(StampNs(0.45));
  EXPECT_EQ(first.answer, Answer::kWait) << "0.5 s of fixes that are 1.5 m off tell no course";
  EXPECT_EQ(ScatteredDrive(0.1, 1, 0.5).At(StampNs(0.45)).answer, Answer::kReady);
}

TEST(FixTrack, FixesTooSeldomToShowTheirScatterAreNotTakenByTheirWord) {
  FixTrack track{FixTrack::Config{}};
  for (double time_s = 0; time_s <= 3; time_s += 1) {
    track.Add(FixOf(time_s, Straight(1.0, 8.0, time_s), 5.0));
  }
  EXPECT_EQ(track.At(StampNs(1.5)).answer, Answer::kReady) << "their errors hardly change";
}

TEST(FixTrack, FixesThatHardlyScatterLeaveTheCourseAsItWas) {
  const auto sure = ScatteredDrive(0.01, 1, 4.0).At(StampNs(3.95));
  ASSERT_EQ(sure.answer, Answer::kReady);
  const auto exact = Drive(M_PI / 2, 8.0, 0.1, 4.0).At(StampNs(3.95));
  EXPECT_NEAR(sure.pose.course_variance_rad2, exact.pose.course_variance_rad2, 1e-4);
}

}  // namespace
}  // namespace livemap::vehicle
