#include "localization/geo_localizer.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/error.h"
#include "test/localization/simulated_drive.h"

namespace livemap::localization {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kPi = 3.14159265358979323846;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Fixes without a shared part, the datum of the drive: errors are comparable with truth.
LocalizerConfig ConfigOf(const SimulatedDrive& drive) {
  LocalizerConfig config;
  config.datum = drive.datum;
  config.receiver.shared_sigma_m = 0;
  config.receiver.antenna_m = drive.antenna_m;
  return config;
}

struct Outcome {
  std::optional<FusedPose> last;
  PlanarPose truth;
  double error_m = kNan;
  double heading_error_rad = kNan;
  double worst_m = 0;          // After the first 10 s.
  double map_from_odom_m = 0;  // Error of the vehicle placed by MapFromOdom.
  LocalizerCounters counters;
  LatencyEstimate latency;
  double scale = 1;
  double yaw_bias_rps = 0;
};

Outcome Drive(const SimulatedDrive& drive, const LocalizerConfig& config) {
  GeoLocalizer localizer(config);
  Outcome outcome;
  Simulate(drive, localizer, [&](double time_s, std::int64_t stamp_ns, const PlanarPose& truth) {
    outcome.last = localizer.Fused(stamp_ns);
    outcome.truth = truth;
    if (!outcome.last || outcome.last->state == LocalizerState::kUninitialised) return;
    outcome.error_m = (outcome.last->map_from_base.position_m - truth.position_m).norm();
    if (time_s > 10) outcome.worst_m = std::max(outcome.worst_m, outcome.error_m);
    outcome.heading_error_rad =
        std::abs(WrapAngle(kPi / 2 - truth.yaw_rad - outcome.last->heading_rad));
  });
  outcome.counters = localizer.counters();
  outcome.latency = localizer.latency();
  outcome.scale = localizer.odometry_scale();
  outcome.yaw_bias_rps = localizer.yaw_bias_rps();
  return outcome;
}

Outcome Drive(const SimulatedDrive& drive) { return Drive(drive, ConfigOf(drive)); }

SimulatedMotion ChangingSpeed(double time_s) { return {10 + 6 * std::sin(0.5 * time_s), 0}; }

TEST(GeoLocalizer, FollowsAStraightRoad) {
  const Outcome outcome = Drive({});
  ASSERT_TRUE(outcome.last);
  EXPECT_EQ(outcome.last->state, LocalizerState::kOk);
  EXPECT_LT(outcome.worst_m, 0.8);
  EXPECT_LT(outcome.heading_error_rad, 0.01);
  EXPECT_EQ(outcome.counters.fixes_refused, 0U);
}

TEST(GeoLocalizer, FollowsCurvesAndFindsScaleBiasAndAntenna) {
  SimulatedDrive drive;
  drive.length_s = 90;
  drive.motion = [](double time_s) {
    return SimulatedMotion{10 + 4 * std::sin(0.4 * time_s), 0.3 * std::sin(0.2 * time_s)};
  };
  drive.scale = 1 / 1.02;
  drive.yaw_bias_rps = 0.001;
  drive.antenna_m = {1.5, -0.6};
  const Outcome outcome = Drive(drive);
  EXPECT_LT(outcome.worst_m, 0.8);
  EXPECT_LT(outcome.heading_error_rad, 0.015);
  EXPECT_NEAR(outcome.scale, 1.02, 0.004);
  EXPECT_NEAR(outcome.yaw_bias_rps, 0.001, 0.0006);
}

TEST(GeoLocalizer, StandingVehicleHasAPositionButNoHeading) {
  SimulatedDrive drive;
  drive.motion = [](double) { return SimulatedMotion{}; };
  const Outcome outcome = Drive(drive);
  ASSERT_TRUE(outcome.last);
  EXPECT_EQ(outcome.last->state, LocalizerState::kUninitialised);
  EXPECT_TRUE(std::isnan(outcome.last->heading_rad));
  EXPECT_LT((outcome.last->map_from_base.position_m - outcome.truth.position_m).norm(), 1.0);
  EXPECT_GT(outcome.last->covariance_m2(0, 0), 0.1);
}

TEST(GeoLocalizer, StartsWhenTheVehicleStartsAndKeepsTheHeadingInAStop) {
  SimulatedDrive drive;
  drive.length_s = 80;
  drive.motion = [](double time_s) {
    return SimulatedMotion{time_s > 20 && time_s < 40 ? 8.0 : 0.0, 0};
  };
  const Outcome outcome = Drive(drive);
  ASSERT_TRUE(outcome.last);
  EXPECT_EQ(outcome.last->state, LocalizerState::kOk);
  EXPECT_LT(outcome.error_m, 0.5);
  EXPECT_LT(outcome.heading_error_rad, 0.05);
}

TEST(GeoLocalizer, RefusesOutliersAlsoAtTheStart) {
  SimulatedDrive drive;
  drive.fix_error = [](double time_s) {
    const int count = static_cast<int>(std::lround(time_s * 10));
    return Eigen::Vector2d(count % 10 == 1 ? 30 : 0, count % 10 == 4 ? -30 : 0);
  };
  const Outcome outcome = Drive(drive);
  EXPECT_LT(outcome.worst_m, 0.8);
  EXPECT_NEAR(static_cast<double>(outcome.counters.fixes_refused), 80, 2);
}

TEST(GeoLocalizer, BridgesADropOutAndSaysSo) {
  SimulatedDrive drive;
  drive.length_s = 40;
  drive.scale = 0.99;
  drive.fix_error = [](double time_s) -> std::optional<Eigen::Vector2d> {
    if (time_s > 30) return std::nullopt;
    return Eigen::Vector2d::Zero();
  };
  const Outcome outcome = Drive(drive);
  ASSERT_TRUE(outcome.last);
  EXPECT_EQ(outcome.last->state, LocalizerState::kDeadReckoning);
  EXPECT_LT(outcome.error_m, 2);
  EXPECT_LT(outcome.error_m * outcome.error_m, 9 * outcome.last->covariance_m2.trace());
}

TEST(GeoLocalizer, ComesBackAfterALongTunnelInBoundedMemory) {
  SimulatedDrive drive;
  drive.length_s = 200;
  drive.motion = [](double time_s) { return SimulatedMotion{15, 0.05 * std::sin(0.1 * time_s)}; };
  drive.fix_error = [](double time_s) -> std::optional<Eigen::Vector2d> {
    if (time_s > 30 && time_s < 170) return std::nullopt;
    return Eigen::Vector2d::Zero();
  };
  const Outcome outcome = Drive(drive);
  EXPECT_EQ(outcome.last->state, LocalizerState::kOk);
  EXPECT_LT(outcome.error_m, 1);
}

TEST(GeoLocalizer, FindsTheLatencyWhereTheSpeedChanges) {
  SimulatedDrive drive;
  drive.length_s = 90;
  drive.latency_s = 0.2;
  drive.motion = ChangingSpeed;
  drive.fix_sigma_m = 0.3;
  LocalizerConfig config = ConfigOf(drive);
  config.receiver.latency_s = 0;
  config.receiver.latency_sigma_s = 0.2;
  const Outcome outcome = Drive(drive, config);
  EXPECT_TRUE(outcome.latency.observed);
  EXPECT_NEAR(outcome.latency.value_s, 0.2, 0.02);
  EXPECT_LT(outcome.latency.sigma_s, 0.02);
}

TEST(GeoLocalizer, ClaimsNoLatencyAtConstantSpeed) {
  SimulatedDrive drive;
  drive.length_s = 90;
  drive.latency_s = 0.2;
  drive.fix_sigma_m = 0.3;
  LocalizerConfig config = ConfigOf(drive);
  config.receiver.latency_s = 0.1;
  config.receiver.latency_sigma_s = 0.1;
  const Outcome outcome = Drive(drive, config);
  EXPECT_FALSE(outcome.latency.observed);
  EXPECT_NEAR(outcome.latency.value_s, 0.1, 0.03);
  EXPECT_GT(outcome.latency.sigma_s, 0.08);
  // The way that hides in the latency is in the covariance: 0.1 s at 10 m/s.
  EXPECT_GT(outcome.last->covariance_m2.trace(), 0.64);
}

TEST(GeoLocalizer, BelievesTheScatterMoreThanAReceiverThatStatesTooLittle) {
  SimulatedDrive drive;
  TestNoise noise(5);
  drive.fix_error = [&noise](double) { return Eigen::Vector2d(2 * noise.Normal2()); };
  drive.length_s = 60;
  const Outcome outcome = Drive(drive);
  EXPECT_GT(outcome.counters.fixes_used, 500U);
  EXPECT_LT(outcome.error_m, 2);
}

TEST(GeoLocalizer, BelievesNoFixToBeBetterThanItMayBe) {
  // Reflections that last for some seconds, of which the receiver's 0.5 m say nothing.
  SimulatedDrive drive;
  drive.fix_error = [](double time_s) {
    return std::optional<Eigen::Vector2d>(1.5 * Eigen::Vector2d(std::sin(time_s), 0));
  };
  LocalizerConfig config = ConfigOf(drive);
  const Outcome believing = Drive(drive, config);
  config.receiver.min_sigma_m = 1.5;
  config.receiver.shared_sigma_m = 1;
  config.receiver.shared_time_s = 5;
  const Outcome careful = Drive(drive, config);
  EXPECT_LT(careful.worst_m, 1.5);
  EXPECT_GT(careful.last->covariance_m2.trace(), 1.5 * believing.last->covariance_m2.trace());
}

TEST(GeoLocalizer, OdometryResetKeepsTheMap) {
  SimulatedDrive drive;
  drive.motion = ChangingSpeed;
  drive.odometry_resets = [](double time_s) { return std::abs(time_s - 25) < 1e-6; };
  GeoLocalizer localizer(ConfigOf(drive));
  double worst_m = 0;
  Simulate(drive, localizer, [&](double time_s, std::int64_t stamp_ns, const PlanarPose& truth) {
    if (time_s < 10) return;
    const auto fused = localizer.Fused(stamp_ns);
    ASSERT_TRUE(fused);
    worst_m = std::max(worst_m, (fused->map_from_base.position_m - truth.position_m).norm());
  });
  EXPECT_EQ(localizer.counters().odometry_resets, 1U);
  EXPECT_EQ(localizer.counters().restarts, 0U);
  EXPECT_LT(worst_m, 1.0);
}

TEST(GeoLocalizer, MapFromOdomPlacesTheVehicle) {
  SimulatedDrive drive;
  drive.scale = 0.98;
  drive.way_sigma_m = 0;
  drive.yaw_sigma_rad = 0;
  GeoLocalizer localizer(ConfigOf(drive));
  double odometry_m = 0;
  Simulate(drive, localizer, [&](double time_s, std::int64_t, const PlanarPose& truth) {
    odometry_m = 0.98 * 10 * time_s;
    if (time_s < 20) return;
    const auto map_from_odom = localizer.MapFromOdom();
    ASSERT_TRUE(map_from_odom);
    const Eigen::Vector3d place_m = *map_from_odom * Eigen::Vector3d(odometry_m, 0, 0);
    EXPECT_LT((place_m.head<2>() - truth.position_m).norm(), 0.8);
  });
}

TEST(GeoLocalizer, StartsAnewWhenMostFixesAreRefusedForLong) {
  SimulatedDrive drive;
  drive.length_s = 90;
  // The map was fixed 200 m off, by a spoofed or reflected signal.
  drive.fix_error = [](double time_s) { return Eigen::Vector2d(time_s < 20 ? 200 : 0, 0); };
  const Outcome outcome = Drive(drive);
  EXPECT_EQ(outcome.counters.restarts, 1U);
  EXPECT_LT(outcome.error_m, 1.5);
}

TEST(GeoLocalizer, IsHonestAboutItsErrors) {
  double nees = 0;
  double heading_nees = 0;
  constexpr int kRuns = 40;
  for (int run = 0; run < kRuns; ++run) {
    TestNoise noise(static_cast<std::uint64_t>(run) + 100);
    SimulatedDrive drive;
    drive.seed = static_cast<std::uint64_t>(run) + 1;
    drive.length_s = 25;
    drive.motion = [](double time_s) {
      return SimulatedMotion{10 + 5 * std::sin(0.5 * time_s), 0.1 * std::cos(0.3 * time_s)};
    };
    drive.scale = 1 / (1 + 0.02 * noise.Normal());
    drive.yaw_bias_rps = 0.001 * noise.Normal();
    drive.latency_s = std::max(0.0, 0.08 + 0.04 * noise.Normal());
    drive.latency_s = 0.02 * std::round(drive.latency_s / 0.02);
    const Outcome outcome = Drive(drive);
    ASSERT_TRUE(outcome.last);
    const Eigen::Vector2d error_m =
        outcome.last->map_from_base.position_m - outcome.truth.position_m;
    nees += error_m.dot(outcome.last->covariance_m2.inverse() * error_m) / (2 * kRuns);
    heading_nees += outcome.heading_error_rad * outcome.heading_error_rad /
                    outcome.last->heading_variance_rad2 / kRuns;
  }
  EXPECT_GT(nees, 0.5);
  EXPECT_LT(nees, 1.6);
  EXPECT_GT(heading_nees, 0.4);
  EXPECT_LT(heading_nees, 1.8);
}

TEST(GeoLocalizer, WorksAcrossTheAntimeridianAndNearThePole) {
  for (const geo::GeoPoint datum :
       {geo::GeoPoint{-17, 179.9999}, geo::GeoPoint{89.9995, 20}, geo::GeoPoint{0, 0}}) {
    SimulatedDrive drive;
    drive.datum = datum;
    GeoLocalizer localizer(ConfigOf(drive));
    const geo::LocalFrame frame(datum);
    Simulate(drive, localizer, [&](double time_s, std::int64_t stamp_ns, const PlanarPose& truth) {
      if (time_s < 20) return;
      const auto fused = localizer.Fused(stamp_ns);
      ASSERT_TRUE(fused);
      const geo::GeoPoint here = frame.ToGeo(truth.position_m);
      EXPECT_LT(geo::GeodesicDistanceM(fused->position, here), 1.0);
      // Heading is against true north here, not at the datum.
      const geo::GeoPoint ahead = frame.ToGeo((truth * PlanarPose{{20, 0}, 0}).position_m);
      const geo::GeoPoint by_heading = geo::GeodesicDestination(here, fused->heading_rad, 20);
      EXPECT_LT(geo::GeodesicDistanceM(ahead, by_heading), 0.5);
    });
  }
}

TEST(GeoLocalizer, GivesTheSameAnswersAgain) {
  SimulatedDrive drive;
  drive.motion = ChangingSpeed;
  const Outcome first = Drive(drive);
  const Outcome second = Drive(drive);
  EXPECT_EQ(first.error_m, second.error_m);
  EXPECT_EQ(first.last->heading_variance_rad2, second.last->heading_variance_rad2);
}

TEST(GeoLocalizer, RefusesWhatCannotBe) {
  LocalizerConfig config;
  config.datum = geo::GeoPoint{48, 11};
  GeoLocalizer localizer{config};
  using Fix = GeoLocalizer::FixVerdict;
  using Odometry = OdometryTrack::Verdict;
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  geo::Fix fix;
  fix.stamp_ns = 10 * kSecond_ns;
  fix.position = {48, 11};
  EXPECT_EQ(localizer.AddFix(fix), Fix::kWithoutOdometry);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  EXPECT_EQ(localizer.AddOdometry(0, pose), Odometry::kInvalid);
  EXPECT_EQ(localizer.AddOdometry(9 * kSecond_ns, pose), Odometry::kAccepted);
  EXPECT_EQ(localizer.AddOdometry(11 * kSecond_ns, pose), Odometry::kAccepted);
  EXPECT_EQ(localizer.AddOdometry(11 * kSecond_ns, pose), Odometry::kOutOfOrder);
  pose.translation().x() = kNan;
  EXPECT_EQ(localizer.AddOdometry(12 * kSecond_ns, pose), Odometry::kInvalid);
  pose = Eigen::Isometry3d::Identity();
  pose.linear() *= 2;
  EXPECT_EQ(localizer.AddOdometry(12 * kSecond_ns, pose), Odometry::kInvalid);
  EXPECT_EQ(localizer.AddOdometry(12 * kSecond_ns, Eigen::Isometry3d::Identity(),
                                  Eigen::Matrix3d(-Eigen::Matrix3d::Identity())),
            Odometry::kInvalid);
  for (const geo::GeoPoint bad :
       {geo::GeoPoint{kNan, 11}, geo::GeoPoint{48, 181}, geo::GeoPoint{1e300, 11},
        geo::GeoPoint{48, std::numeric_limits<double>::infinity()}, geo::GeoPoint{0, 0}}) {
    geo::Fix broken = fix;
    broken.position = bad;
    EXPECT_EQ(localizer.AddFix(broken), Fix::kInvalid);
  }
  geo::Fix broken = fix;
  broken.covariance_m2 = Eigen::Matrix2d::Constant(kNan);
  EXPECT_EQ(localizer.AddFix(broken), Fix::kInvalid);
  broken.covariance_m2 = Eigen::Matrix2d(1e9 * Eigen::Matrix2d::Identity());
  EXPECT_EQ(localizer.AddFix(broken), Fix::kInvalid);
  broken = fix;
  broken.has_fix = false;
  EXPECT_EQ(localizer.AddFix(broken), Fix::kAbsent);
  EXPECT_EQ(localizer.AddFix(fix), Fix::kKept);
  EXPECT_EQ(localizer.AddFix(fix), Fix::kOutOfOrder);
  fix.stamp_ns = 11 * kSecond_ns;
  fix.position = {-48, -169};  // The other side of the earth.
  EXPECT_EQ(localizer.AddFix(fix), Fix::kInvalid);
  fix.stamp_ns = 15 * kSecond_ns;
  fix.position = {48, 11};
  EXPECT_EQ(localizer.AddFix(fix), Fix::kWaiting);
  fix.stamp_ns = 99 * kSecond_ns;
  EXPECT_EQ(localizer.AddFix(fix), Fix::kWithoutOdometry);
  EXPECT_EQ(localizer.counters().fixes_invalid, 8U);
  EXPECT_EQ(localizer.counters().odometry_invalid, 4U);
  EXPECT_FALSE(localizer.Fused(1));
  EXPECT_FALSE(localizer.Fused(std::numeric_limits<std::int64_t>::min()));
  EXPECT_FALSE(localizer.Fused(std::numeric_limits<std::int64_t>::max()));
  EXPECT_FALSE(localizer.MapFromOdom());
}

/// How far base_link is from the truth at the end of a drive whose first fixes lie elsewhere, m.
double ErrorAfterWrongFirstFixes(int wrong, const geo::GeoPoint& elsewhere,
                                 const LocalizerConfig& config, double& datum_error_m) {
  GeoLocalizer localizer{config};
  constexpr std::int64_t kStartNs = 1'700'000'000'000'000'000;
  const geo::GeoPoint start{48.1, 11.5};
  const geo::LocalFrame truth(start);
  for (int i = 0; i <= 600; ++i) {
    const std::int64_t stamp_ns = kStartNs + i * 100'000'000LL;
    localizer.AddOdometry(stamp_ns, ToIsometry({{i * 1.0, 0}, 0}));
    geo::Fix fix;
    fix.stamp_ns = stamp_ns;
    fix.position = i < wrong ? elsewhere : truth.ToGeo({i * 1.0, 0});
    fix.covariance_m2 = Eigen::Matrix2d::Identity();
    localizer.AddFix(fix);
  }
  const auto fused = localizer.Fused(kStartNs + 60'000'000'000);
  if (!fused || !localizer.datum()) return std::numeric_limits<double>::infinity();
  datum_error_m = geo::GeodesicDistanceM(*localizer.datum(), start);
  return geo::GeodesicDistanceM(fused->position, truth.ToGeo({600.0, 0}));
}

TEST(GeoLocalizer, WrongFirstFixesDoNotDecideWhereTheMapIs) {
  LocalizerConfig config;
  config.receiver.latency_s = config.receiver.latency_sigma_s = 0;
  const std::pair<geo::GeoPoint, std::vector<int>> cases[] = {
      {{0, 0}, {0, 1, 2, 3, 5, 20}}, {{35.7, 139.7}, {2, 20}}, {{48.3, 11.5}, {2, 20}}};
  for (const auto& [elsewhere, counts] : cases) {
    for (const int wrong : counts) {
      double datum_error_m = 0;
      EXPECT_LT(ErrorAfterWrongFirstFixes(wrong, elsewhere, config, datum_error_m), 1.0)
          << wrong << " fixes at " << elsewhere.latitude_deg;
      // Within reach of the plane a datum is as good as another.
      EXPECT_LT(datum_error_m, 30e3) << wrong << " fixes at " << elsewhere.latitude_deg;
      if (wrong <= 2) {
        EXPECT_LT(datum_error_m, 10) << elsewhere.latitude_deg;
      }
    }
  }
}

TEST(GeoLocalizer, ADatumThatWasGivenStays) {
  LocalizerConfig config;
  config.receiver.latency_s = config.receiver.latency_sigma_s = 0;
  config.datum = geo::GeoPoint{35.7, 139.7};
  double datum_error_m = 0;
  EXPECT_TRUE(std::isinf(ErrorAfterWrongFirstFixes(0, {0, 0}, config, datum_error_m)));
}

TEST(GeoLocalizer, BeginsAgainWhenTheClockIsSetBack) {
  SimulatedDrive drive;
  GeoLocalizer localizer(ConfigOf(drive));
  const auto nothing = [](double, std::int64_t, const PlanarPose&) {};
  drive.length_s = 40;
  Simulate(drive, localizer, nothing);
  drive.seed = 2;
  Simulate(drive, localizer, nothing);
  EXPECT_EQ(localizer.counters().clock_resets, 1U);
  EXPECT_EQ(localizer.state(), LocalizerState::kOk);
}

TEST(LocalizerConfig, NamesTheValueThatIsWrong) {
  LocalizerConfig config;
  Check(config);
  config.receiver.latency_s = -1;
  EXPECT_THAT([&] { GeoLocalizer{config}; }, ThrowsMessage<Error>(HasSubstr("'latency_s' is -1")));
  config.receiver.latency_s = 0;
  config.window_s = kNan;
  EXPECT_THAT([&] { GeoLocalizer{config}; }, ThrowsMessage<Error>(HasSubstr("'window_s' is nan")));
}

/// How far off the heading is in its stated standard deviations, at most, where reflections slide
/// across the street by 5.5 m in the first 28 m, as on a simulated one.
double WorstHeadingInSlidingReflections(const LocalizerConfig& config) {
  SimulatedDrive drive;
  drive.length_s = 20;
  drive.latency_s = 0;
  drive.motion = [](double) { return SimulatedMotion{8, 0}; };
  drive.fix_error = [left = Rotation2(drive.start_yaw_rad).col(1).eval()](double time_s) {
    const double aside_m =
        time_s < 3.5 ? 4 - 5.5 * time_s / 3.5 : -1.5 * std::exp((3.5 - time_s) / 4);
    return std::optional<Eigen::Vector2d>(aside_m * left);
  };
  GeoLocalizer localizer(config);
  double worst = 0;
  Simulate(drive, localizer, [&](double, std::int64_t stamp_ns, const PlanarPose& truth) {
    const auto fused = localizer.Fused(stamp_ns);
    if (!fused || fused->state == LocalizerState::kUninitialised) return;
    const double error_rad = WrapAngle(kPi / 2 - truth.yaw_rad - fused->heading_rad);
    worst = std::max(worst, std::abs(error_rad) / std::sqrt(fused->heading_variance_rad2));
  });
  return worst;
}

TEST(GeoLocalizer, ReflectionsThatSlideTurnTheHeadingByWhatALargerSharedErrorStates) {
  LocalizerConfig config;
  config.datum = SimulatedDrive().datum;
  config.receiver.latency_s = config.receiver.latency_sigma_s = 0;
  config.receiver.min_sigma_m = 1.5;
  config.receiver.shared_time_s = 5;
  const double before = WorstHeadingInSlidingReflections(config);
  config.receiver.min_sigma_m = 2;
  config.receiver.shared_sigma_m = 1.5;
  config.start_yaw_sigma_rad = 0.08;
  const double now = WorstHeadingInSlidingReflections(config);
  EXPECT_GT(before, 3);
  EXPECT_LT(now, 0.8 * before);
  EXPECT_LT(now, 3);
}

}  // namespace
}  // namespace livemap::localization
