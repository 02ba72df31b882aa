#include "vehicle/alerts/course_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/time.h"

namespace livemap::vehicle {
namespace {

/// Drives with constant speed and curvature, 5 positions a second.
CourseFilter Driven(double speed_mps, double curvature, double time_s) {
  CourseFilter filter{CourseFilter::Config()};
  Eigen::Vector2d place_m(0, 0);
  double course_rad = 0;
  constexpr double kStepS = 0.2;
  for (int i = 0; i * kStepS <= time_s; ++i) {
    CourseFilter::Sample sample;
    sample.stamp_ns = Nanoseconds(100 + i * kStepS);
    sample.place_m = place_m;
    sample.stated_sigma_m = 1.5;
    filter.Add(sample);
    course_rad += 0.5 * curvature * speed_mps * kStepS;
    place_m += speed_mps * kStepS * Eigen::Vector2d(std::sin(course_rad), std::cos(course_rad));
    course_rad += 0.5 * curvature * speed_mps * kStepS;
  }
  return filter;
}

TEST(CourseFilterTest, LearnsCourseAndSpeedOnAStraightRoad) {
  const CourseFilter filter = Driven(14, 0, 10);
  ASSERT_TRUE(filter.known());
  EXPECT_NEAR(filter.state()[CourseFilter::kCourse], 0, 0.01);
  EXPECT_NEAR(filter.state()[CourseFilter::kSpeed], 14, 0.2);
  EXPECT_NEAR(filter.state()[CourseFilter::kCurvature], 0, 0.001);
  EXPECT_NEAR(filter.period_s(), 0.2, 0.02);
  EXPECT_GT(filter.modes()[0].weight, 0.5) << "the road is steady";
}

TEST(CourseFilterTest, LearnsTheCurvatureOfABend) {
  const CourseFilter filter = Driven(10, 1.0 / 60, 8);
  ASSERT_TRUE(filter.known());
  EXPECT_NEAR(filter.state()[CourseFilter::kCurvature], 1.0 / 60, 0.006);
  EXPECT_GT(filter.modes()[1].weight, Driven(10, 0, 8).modes()[1].weight) << "the road bends";
}

TEST(CourseFilterTest, AStandingVehicleKeepsItsCourse) {
  CourseFilter filter = Driven(10, 0, 10);
  const double north_m = filter.state()[CourseFilter::kNorth];
  for (int i = 1; i <= 300; ++i) {
    CourseFilter::Sample sample;
    sample.stamp_ns = Nanoseconds(110 + 0.2 * i);
    sample.place_m = {0.3 * std::sin(i), north_m + 3 + 0.3 * std::cos(1.7 * i)};
    sample.stated_sigma_m = 1.5;
    filter.Add(sample);
  }
  ASSERT_TRUE(filter.known());
  EXPECT_LT(filter.state()[CourseFilter::kSpeed], 1);
  EXPECT_NEAR(filter.state()[CourseFilter::kCourse], 0, 0.3);
}

TEST(CourseFilterTest, RefusesWhatIsNotFiniteOrNotNewer) {
  CourseFilter filter = Driven(10, 0, 5);
  CourseFilter::Sample sample;
  sample.stamp_ns = Nanoseconds(200);
  sample.place_m = {std::numeric_limits<double>::quiet_NaN(), 0};
  EXPECT_FALSE(filter.Add(sample));
  sample.place_m = {0, std::numeric_limits<double>::infinity()};
  EXPECT_FALSE(filter.Add(sample));
  sample.place_m = {0, 50};
  sample.stated_sigma_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(filter.Add(sample));
  sample.stated_sigma_m = 1;
  sample.stamp_ns = Nanoseconds(101);
  EXPECT_FALSE(filter.Add(sample));
  EXPECT_TRUE(filter.known());
}

TEST(CourseFilterTest, ALongGapBeginsAnew) {
  CourseFilter filter = Driven(10, 0, 5);
  CourseFilter::Sample sample;
  sample.stamp_ns = Nanoseconds(130);
  sample.place_m = {0, 300};
  EXPECT_TRUE(filter.Add(sample));
  EXPECT_FALSE(filter.known());
}

TEST(CourseFilterTest, PositionsThatFitNothingBeginAnew) {
  CourseFilter filter = Driven(10, 0, 10);
  for (int i = 1; i <= 3; ++i) {
    CourseFilter::Sample sample;
    sample.stamp_ns = Nanoseconds(110 + 0.2 * i);
    sample.place_m = {500, 0};
    EXPECT_TRUE(filter.Add(sample));
  }
  EXPECT_FALSE(filter.known());
}

/// Of a vehicle that has braked by 2 m/s^2 for 0.6 s, after a steady drive northwards.
double PushAfterBraking(bool with_velocities) {
  CourseFilter filter{CourseFilter::Config()};
  double north_m = 0;
  double speed_mps = 14;
  for (int i = 0; i <= 53; ++i) {
    CourseFilter::Sample sample;
    sample.stamp_ns = Nanoseconds(100 + i * 0.2);
    sample.place_m = {0.3 * std::sin(2.1 * i), north_m + 0.3 * std::cos(3.7 * i)};
    sample.stated_sigma_m = 1.5;
    filter.Add(sample);
    if (with_velocities) filter.AddVelocity({{0.1 * std::cos(1.3 * i), speed_mps}, 0.15});
    if (i >= 50) speed_mps -= 0.4;
    north_m += 0.2 * speed_mps;
  }
  return filter.state()[CourseFilter::kAcceleration];
}

TEST(CourseFilterTest, AVelocityTellsBrakingSooner) {
  EXPECT_LT(PushAfterBraking(true), -1.2);
  EXPECT_GT(PushAfterBraking(false), PushAfterBraking(true) + 0.5);
}

TEST(CourseFilterTest, AVelocityTellsTheCourseOfASlowVehicle) {
  CourseFilter filter = Driven(3, 0, 10);
  const double before = filter.covariance()(CourseFilter::kCourse, CourseFilter::kCourse);
  EXPECT_TRUE(filter.AddVelocity({{0, 3}, 0.15}));
  EXPECT_LT(filter.covariance()(CourseFilter::kCourse, CourseFilter::kCourse), 0.7 * before);
}

TEST(CourseFilterTest, AVelocityThatCannotBeChangesNothing) {
  CourseFilter unknown{CourseFilter::Config()};
  EXPECT_FALSE(unknown.AddVelocity({{0, 3}, 0.15})) << "no position yet";
  CourseFilter filter = Driven(14, 0, 10);
  const CourseFilter::State before = filter.state();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(filter.AddVelocity({{0, nan}, 0.15}));
  EXPECT_FALSE(filter.AddVelocity({{0, 14}, nan}));
  EXPECT_EQ(filter.state(), before);
  EXPECT_TRUE(filter.AddVelocity({{-14, 0}, 0.15})) << "a finite one is taken...";
  EXPECT_NEAR(filter.state()[CourseFilter::kSpeed], 14, 0.5) << "...but does not count";
  EXPECT_NEAR(filter.state()[CourseFilter::kCourse], 0, 0.05);
}

TEST(CourseFilterTest, AMeasuredCourseCountsFromTheFirstPosition) {
  CourseFilter filter{CourseFilter::Config()};
  CourseFilter::Sample sample;
  sample.stamp_ns = Nanoseconds(100);
  sample.course_rad = 1.5;
  sample.course_variance_rad2 = 1e-4;
  EXPECT_TRUE(filter.Add(sample));
  ASSERT_TRUE(filter.known());
  EXPECT_DOUBLE_EQ(filter.state()[CourseFilter::kCourse], 1.5);
}

}  // namespace
}  // namespace livemap::vehicle
