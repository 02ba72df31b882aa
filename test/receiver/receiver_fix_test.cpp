#include "receiver/receiver_fix.h"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>

namespace livemap::receiver {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

ReceiverReport GoodReport() {
  ReceiverReport report;
  report.device = "/dev/ttyACM0";
  report.mode = ReceiverReport::kSpace;
  report.stamp_ns = 1'795'653'934'190'000'000;
  report.latitude_deg = -27.6;
  report.longitude_deg = -48.5;
  report.height_m = 15;
  report.east_error_m = 1.96 * 2;
  report.north_error_m = 1.96 * 3;
  report.up_error_m = 1.96 * 5;
  report.speed_mps = 10;
  report.course_deg = 90;
  report.climb_mps = -0.5;
  report.speed_error_mps = 1.96 * 0.2;
  report.course_error_deg = 1.96 * 1;
  report.climb_error_mps = 1.96 * 0.3;
  return report;
}

FixVerdict VerdictOf(const ReceiverReport& report) { return FixOf(report, {}).verdict; }

TEST(ReceiverFix, HasTimePlaceHeightAndTheStandardDeviationsOfTheErrors) {
  const ReceiverReport report = GoodReport();
  const JudgedFix judged = FixOf(report, {});
  ASSERT_EQ(judged.verdict, FixVerdict::kFix);
  EXPECT_EQ(judged.fix->stamp_ns, report.stamp_ns);
  EXPECT_EQ(judged.fix->position.latitude_deg, -27.6);
  EXPECT_EQ(judged.fix->position.longitude_deg, -48.5);
  EXPECT_EQ(judged.fix->height_m, 15);
  EXPECT_TRUE(judged.fix->plane_sigma_m->isApprox(Eigen::Vector2d(2, 3)));
  EXPECT_NEAR(*judged.fix->up_sigma_m, 5, 1e-12);
  EXPECT_EQ(judged.fix->quality, FixQuality::kPlain);
}

TEST(ReceiverFix, TakesErrorsOfOneSigmaAsTheyAreWhenTold) {
  ReceiverConfig config;
  config.error_sigmas = 1;
  EXPECT_TRUE(
      FixOf(GoodReport(), config).fix->plane_sigma_m->isApprox(Eigen::Vector2d(3.92, 5.88)));
}

TEST(ReceiverFix, SharesARadialErrorOutWhereNoOtherIsStated) {
  ReceiverReport report = GoodReport();
  report.east_error_m = kNotStated;
  report.radial_error_m = 2.448 * 4;
  EXPECT_TRUE(FixOf(report, {}).fix->plane_sigma_m->isApprox(Eigen::Vector2d(4, 4)));
}

TEST(ReceiverFix, KnowsNoUncertaintyWhereTheReceiverStatesNoneOrNonsense) {
  for (const double error : {kNotStated, 0.0, -3.0, -kInfinity}) {
    ReceiverReport report = GoodReport();
    report.east_error_m = report.up_error_m = error;
    const JudgedFix judged = FixOf(report, {});
    ASSERT_TRUE(judged.fix) << error;
    EXPECT_FALSE(judged.fix->plane_sigma_m) << error;
    EXPECT_FALSE(judged.fix->up_sigma_m) << error;
    EXPECT_TRUE(judged.fix->height_m) << error;
  }
}

TEST(ReceiverFix, HasNoHeightInThePlaneOrWhereTheHeightCannotBe) {
  ReceiverReport plane = GoodReport();
  plane.mode = ReceiverReport::kPlane;
  EXPECT_FALSE(FixOf(plane, {}).fix->height_m);
  for (const double height : {kNotStated, kInfinity, 1e6, -1e6}) {
    ReceiverReport report = GoodReport();
    report.height_m = height;
    EXPECT_FALSE(FixOf(report, {}).fix->height_m) << height;
    EXPECT_FALSE(FixOf(report, {}).fix->up_sigma_m) << height;
  }
}

TEST(ReceiverFix, IsNoneWithoutAModeThatSaysSo) {
  for (const int mode : {0, 1, 4, 77, -1}) {
    ReceiverReport report = GoodReport();
    report.mode = mode;
    EXPECT_EQ(VerdictOf(report), FixVerdict::kNoFix) << mode;
  }
}

TEST(ReceiverFix, IsRefusedWhereItsPlaceCannotBe) {
  for (const auto& [latitude, longitude] : std::initializer_list<std::pair<double, double>>{
           {kNotStated, 1}, {1, kNotStated}, {91, 1}, {1, 181}, {kInfinity, 1}, {0, 0}}) {
    ReceiverReport report = GoodReport();
    report.latitude_deg = latitude;
    report.longitude_deg = longitude;
    EXPECT_EQ(VerdictOf(report), FixVerdict::kBadPosition) << latitude << " " << longitude;
  }
}

TEST(ReceiverFix, IsRefusedWithoutTimeWhenSimulatedAndWhenItMayBeAnywhere) {
  for (const std::int64_t stamp :
       {std::int64_t{0}, std::int64_t{-1}, std::numeric_limits<std::int64_t>::max()}) {
    ReceiverReport report = GoodReport();
    report.stamp_ns = stamp;
    EXPECT_EQ(VerdictOf(report), FixVerdict::kNoTime);
  }
  ReceiverReport simulated = GoodReport();
  simulated.status = ReceiverReport::kSimulated;
  EXPECT_EQ(VerdictOf(simulated), FixVerdict::kSimulated);
  ReceiverReport vague = GoodReport();
  vague.east_error_m = 1e5;
  EXPECT_EQ(VerdictOf(vague), FixVerdict::kTooUncertain);
}

TEST(ReceiverFix, KnowsHowItWasMade) {
  for (const auto& [status, quality] : std::initializer_list<std::pair<int, FixQuality>>{
           {0, FixQuality::kPlain},
           {ReceiverReport::kPlain, FixQuality::kPlain},
           {ReceiverReport::kDifferential, FixQuality::kDifferential},
           {ReceiverReport::kRtkFixed, FixQuality::kRtk},
           {ReceiverReport::kRtkFloating, FixQuality::kRtk},
           {ReceiverReport::kDeadReckoning, FixQuality::kPlain},
           {99, FixQuality::kPlain}}) {
    ReceiverReport report = GoodReport();
    report.status = status;
    EXPECT_EQ(FixOf(report, {}).fix->quality, quality) << status;
  }
}

TEST(ReceiverVelocity, PointsAlongTheCourseWithErrorsAlongAndAcrossIt) {
  const JudgedVelocity judged = VelocityOf(GoodReport(), {});
  ASSERT_TRUE(judged.velocity);
  EXPECT_TRUE(judged.velocity->plane_mps.isApprox(Eigen::Vector2d(10, 0)));
  EXPECT_EQ(judged.velocity->climb_mps, -0.5);
  EXPECT_NEAR(*judged.velocity->climb_sigma_mps, 0.3, 1e-12);
  const Eigen::Matrix2d covariance = *judged.velocity->plane_covariance;
  EXPECT_NEAR(covariance(0, 0), 0.2 * 0.2, 1e-12) << "eastwards, along";
  EXPECT_NEAR(covariance(1, 1), std::pow(10 * geo::kRadiansPerDegree, 2), 1e-9) << "across";
  EXPECT_NEAR(covariance(0, 1), 0, 1e-12);
}

TEST(ReceiverVelocity, TurnsItsErrorsWithTheCourse) {
  ReceiverReport report = GoodReport();
  report.course_deg = 45;
  report.course_error_deg = 1e-5;
  const Eigen::Matrix2d covariance = *VelocityOf(report, {}).velocity->plane_covariance;
  EXPECT_GT(covariance(0, 1), 0.9 * covariance(0, 0)) << "north-east alike";
  EXPECT_GT(covariance.determinant(), 0);
}

TEST(ReceiverVelocity, IsAsUncertainAcrossAsAlongWithoutAnErrorOfTheCourse) {
  ReceiverReport report = GoodReport();
  report.course_error_deg = kNotStated;
  EXPECT_TRUE(VelocityOf(report, {})
                  .velocity->plane_covariance->isApprox(0.04 * Eigen::Matrix2d::Identity()));
}

TEST(ReceiverVelocity, HasTheErrorOfTheDataSheetWhereThatIsGiven) {
  ReceiverConfig config;
  config.velocity_sigma_mps = 0.1;
  for (const double error : {kNotStated, 42.0}) {
    ReceiverReport report = GoodReport();
    report.speed_error_mps = error;
    EXPECT_TRUE(VelocityOf(report, config)
                    .velocity->plane_covariance->isApprox(0.01 * Eigen::Matrix2d::Identity()))
        << error;
  }
}

TEST(ReceiverVelocity, IsNoneAndUncertainByTheSpeedWithoutACourse) {
  ReceiverReport report = GoodReport();
  report.course_deg = kNotStated;
  report.speed_mps = 0.4;
  const JudgedVelocity judged = VelocityOf(report, {});
  EXPECT_TRUE(judged.velocity->plane_mps.isZero());
  EXPECT_TRUE(
      judged.velocity->plane_covariance->isApprox((0.04 + 0.08) * Eigen::Matrix2d::Identity()));
}

TEST(ReceiverVelocity, HasNoCovarianceWithoutAnErrorOfTheSpeed) {
  for (const double error : {kNotStated, 0.0, -1.0, kInfinity}) {
    ReceiverReport report = GoodReport();
    report.speed_error_mps = error;
    EXPECT_FALSE(VelocityOf(report, {}).velocity->plane_covariance) << error;
  }
}

TEST(ReceiverVelocity, IsRefusedWhereItCannotBe) {
  for (const auto& [speed, course] : std::initializer_list<std::pair<double, double>>{
           {-1, 90}, {101, 90}, {kInfinity, 90}, {10, -1}, {10, 361}, {10, kInfinity}}) {
    ReceiverReport report = GoodReport();
    report.speed_mps = speed;
    report.course_deg = course;
    const JudgedVelocity judged = VelocityOf(report, {});
    EXPECT_TRUE(judged.refused) << speed << " " << course;
    EXPECT_FALSE(judged.velocity) << speed << " " << course;
    EXPECT_TRUE(FixOf(report, {}).fix) << "the position stands";
  }
}

TEST(ReceiverVelocity, IsAbsentWithoutFixOrSpeed) {
  ReceiverReport without_fix = GoodReport();
  without_fix.mode = ReceiverReport::kNone;
  EXPECT_FALSE(VelocityOf(without_fix, {}).velocity);
  EXPECT_FALSE(VelocityOf(without_fix, {}).refused);
  ReceiverReport without_speed = GoodReport();
  without_speed.speed_mps = kNotStated;
  EXPECT_FALSE(VelocityOf(without_speed, {}).velocity);
  EXPECT_FALSE(VelocityOf(without_speed, {}).refused);
}

}  // namespace
}  // namespace livemap::receiver
