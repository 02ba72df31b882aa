#include "odometry/monocular/travel_direction.h"

#include <gtest/gtest.h>

#include <limits>

namespace livemap::odometry {
namespace {

/// A step of 0.5 m of a camera that moves `direction_rad` to the right of where it looks.
Eigen::Isometry3d StepTo(double direction_rad, double turn_rad = 0) {
  Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
  step.translation() = 0.5 * Eigen::Vector3d(std::sin(direction_rad), 0, std::cos(direction_rad));
  step.linear() = Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return step;
}

/// How many steps are taken before the car is said to slide; all of them when it is not.
int StepsUntilItSlides(TravelDirection& travel, int steps, double direction_rad,
                       double turn_rad = 0) {
  for (int i = 0; i < steps; ++i) {
    if (!travel.Add(StepTo(direction_rad, turn_rad))) return i;
  }
  return steps;
}

TEST(TravelDirection, ACameraThatLooksAsideMovesAsideAllTheTime) {
  TravelDirection travel({});
  EXPECT_EQ(StepsUntilItSlides(travel, 1000, 0.15), 1000);
}

TEST(TravelDirection, APathThatBeginsToSlideIsNoneOfACar) {
  TravelDirection travel({});
  ASSERT_EQ(StepsUntilItSlides(travel, 100, 0.02), 100);
  EXPECT_LE(StepsUntilItSlides(travel, 100, 0.12), 8) << "four metres";
  EXPECT_EQ(StepsUntilItSlides(travel, 100, 0.12), 100) << "what was known is forgotten";
}

TEST(TravelDirection, ASlowSlideIsNoticedToo) {
  TravelDirection travel({});
  int slid = 0;
  for (int i = 0; i < 300 && slid == 0; ++i) {
    if (!travel.Add(StepTo(0.002 * i))) slid = i;
  }
  EXPECT_GT(slid, 0);
  EXPECT_LT(0.002 * slid, 0.2);
}

TEST(TravelDirection, ATurnMovesTheCameraAside) {
  TravelDirection travel({});
  ASSERT_EQ(StepsUntilItSlides(travel, 100, 0), 100);
  // A radius of 10 m; the camera is 2 m before the axle.
  EXPECT_EQ(StepsUntilItSlides(travel, 30, 0.2, 0.05), 30);
  EXPECT_EQ(StepsUntilItSlides(travel, 100, 0), 100);
}

TEST(TravelDirection, ReversingIsNoSliding) {
  TravelDirection travel({});
  ASSERT_EQ(StepsUntilItSlides(travel, 100, 0.05), 100);
  EXPECT_EQ(StepsUntilItSlides(travel, 100, 0.05 + M_PI), 100);
}

TEST(TravelDirection, StepsThatAreNoNumbersAreASlide) {
  TravelDirection travel({});
  ASSERT_EQ(StepsUntilItSlides(travel, 100, 0), 100);
  EXPECT_LT(StepsUntilItSlides(travel, 10, std::numeric_limits<double>::quiet_NaN()), 10);
}

}  // namespace
}  // namespace livemap::odometry
