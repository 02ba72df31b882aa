#include "simulation/motion/vehicle_motion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace livemap::simulation {
namespace {

WorldDescription StraightWithCrossings(const std::vector<double>& crossings_m) {
  WorldDescription world;
  world.pieces = {{3000, 0, 0}};
  world.crossings_m = crossings_m;
  return world;
}

DrivingStyle Style(double speed_mps, double seconds, bool stops = false) {
  DrivingStyle style;
  style.speed_mps = speed_mps;
  style.seconds = seconds;
  style.stops = stops;
  return style;
}

/// Seconds during which the vehicle moves slower than a centimetre per second.
double StandsS(const VehicleMotion& motion, double seconds) {
  double stands_s = 0;
  for (double t = 0; t < seconds; t += 0.01) stands_s += motion.SpeedMps(t) < 0.01 ? 0.01 : 0;
  return stands_s;
}

TEST(VehicleMotion, OpenRoadIsDrivenAtTheSpeedAimedAt) {
  const Street street(StraightWithCrossings({}), 3, 3000, true);
  const VehicleMotion motion(street, Style(8, 140), 20);
  EXPECT_NEAR(motion.AlongM(0), 20, 1e-3);
  EXPECT_NEAR(motion.AlongM(140) - 20, 8 * 140, 0.02 * 8 * 140);
  EXPECT_NEAR(motion.AlongM(0) - motion.AlongM(-1), motion.SpeedMps(0), 0.1);
  EXPECT_NEAR(motion.AlongM(141) - motion.AlongM(140), motion.SpeedMps(140), 0.3);
}

TEST(VehicleMotion, CurvesAreDrivenWithBoundedLateralAcceleration) {
  WorldDescription world = StraightWithCrossings({});
  // As tight as roads may be: 48 m.
  world.pieces = {{300, 0, 0}, {113.1, 90, 0}, {300, 0, 0}, {113.1, -90, 0}, {900, 0, 0}};
  const Street street(world, 3, 1000, true);
  const VehicleMotion motion(street, Style(16, 70), 0);
  double most = 0;
  double slowest = 1e9;
  for (double t = 0; t < 60; t += 0.05) {
    const double turn = street.line().HeadingRad(motion.AlongM(t + 0.1)) -
                        street.line().HeadingRad(motion.AlongM(t - 0.1));
    most = std::max(most, std::abs(turn / 0.2) * motion.SpeedMps(t));
    slowest = std::min(slowest, motion.SpeedMps(t));
  }
  EXPECT_LT(most, 1.1 * kLateralMps2);
  EXPECT_GT(most, 0.8 * kLateralMps2) << "no slower than it must";
  EXPECT_LT(slowest, 10.5);
}

TEST(VehicleMotion, AccelerationIsBoundedAndTheVehicleNeverRollsBack) {
  const Street street(WorldDescription(), 4, 3000, true);
  const VehicleMotion motion(street, Style(13, 150, true), 0);
  double most = 0;
  for (double t = -1; t < 151; t += 0.05) {
    ASSERT_GE(motion.AlongM(t + 0.05), motion.AlongM(t)) << t;
    most = std::max(most, std::abs(motion.SpeedMps(t + 0.05) - motion.SpeedMps(t)) / 0.05);
  }
  EXPECT_LT(most, 1.1 * kLongitudinalMps2);
  EXPECT_GT(most, 0.9 * kLongitudinalMps2) << "the drive has stops";
}

TEST(VehicleMotion, StopsBeforeEverySecondCrossingOnlyWhenAskedTo) {
  const Street street(StraightWithCrossings({100, 200, 300, 400}), 3, 1000, true);
  const VehicleMotion stopping(street, Style(8, 90, true), 0);
  const VehicleMotion passing(street, Style(8, 90), 0);
  EXPECT_NEAR(StandsS(stopping, 90), 2 * kStandstillS, 0.8);
  EXPECT_EQ(StandsS(passing, 90), 0);
  for (double t = 0; t < 90; t += 0.1) {
    if (stopping.SpeedMps(t) > 0.01) continue;
    const double along = stopping.AlongM(t);
    EXPECT_NEAR(along, along < 300 ? 190 : 390, 0.6);
  }
}

TEST(VehicleMotion, CrossingsAreDrivenALittleSlower) {
  const Street street(StraightWithCrossings({200}), 3, 1000, true);
  const VehicleMotion motion(street, Style(8, 60), 0);
  for (double t = 0; t < 60; t += 0.1) {
    const double away_m = std::abs(motion.AlongM(t) - 200);
    if (away_m < 2) {
      EXPECT_LT(motion.SpeedMps(t), 6.6);
    }
    if (away_m > 40) {
      EXPECT_GT(motion.SpeedMps(t), 7.1);
    }
  }
}

TEST(VehicleMotion, BrakingLowersTheFront) {
  const Street street(StraightWithCrossings({100, 200}), 3, 1000, true);
  const VehicleMotion stopping(street, Style(8, 60, true), 0);
  double braking_pitch = 0;
  double pulling_pitch = 0;
  int braking = 0;
  int pulling = 0;
  for (double t = 0; t < 60; t += 0.02) {
    const double gain = (stopping.SpeedMps(t + 0.1) - stopping.SpeedMps(t - 0.1)) / 0.2;
    // x of base_link points down where the front is low.
    const double down = -stopping.WorldFromBase(t).linear()(2, 0);
    if (gain < -1.3) braking_pitch += down, ++braking;
    if (gain > 1.3) pulling_pitch += down, ++pulling;
  }
  ASSERT_GT(braking, 50);
  ASSERT_GT(pulling, 50);
  // 1.5 m/s^2 each way at 0.0035 rad, springs' swaying averaged out.
  EXPECT_NEAR(braking_pitch / braking - pulling_pitch / pulling, 0.0105, 0.003);
}

TEST(VehicleMotion, StateIsTheChangeOfThePose) {
  const Street street(WorldDescription(), 6, 1000, true);
  const VehicleMotion motion(street, Style(10, 60), 0);
  for (double t = 1; t < 60; t += 7.3) {
    const VehicleKinematics state = motion.StateAt(t);
    EXPECT_NEAR(state.velocity_mps.x(), motion.SpeedMps(t), 0.5);
    const Eigen::Isometry3d later = motion.WorldFromBase(t + 0.02);
    const Eigen::Vector3d guess = state.world_from_base.translation() +
                                  0.02 * (state.world_from_base.linear() * state.velocity_mps);
    EXPECT_LT((later.translation() - guess).norm(), 0.002) << t;
    const double turned =
        std::atan2(later.linear()(1, 0), later.linear()(0, 0)) -
        std::atan2(state.world_from_base.linear()(1, 0), state.world_from_base.linear()(0, 0));
    EXPECT_NEAR(std::remainder(turned, 2 * M_PI) / 0.02, state.turn_rate_radps.z(), 0.02) << t;
  }
}

TEST(VehicleMotion, AnyTimeMayBeAskedInAnyOrder) {
  const Street street(WorldDescription(), 6, 1000, true);
  const VehicleMotion one(street, Style(9, 60, true), 0);
  const VehicleMotion other(street, Style(9, 60, true), 0);
  const Eigen::Matrix4d late = one.WorldFromBase(40).matrix();
  const Eigen::Matrix4d early = one.WorldFromBase(3).matrix();
  EXPECT_EQ(other.WorldFromBase(3).matrix(), early);
  EXPECT_EQ(other.WorldFromBase(40).matrix(), late);
}

}  // namespace
}  // namespace livemap::simulation
