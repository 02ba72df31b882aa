#include "localization/localizer_feed.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <vector>

#include "test/localization/simulated_drive.h"

namespace livemap::localization {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;
using Verdict = GeoLocalizer::FixVerdict;

constexpr std::int64_t kBeginNs = 1'700'000'000'000'000'000;
const geo::GeoPoint kDatum{48.1, 11.5};

/// What arrives at a moment of the steady clock.
struct Arrival {
  double steady_s = 0;
  std::optional<geo::Fix> fix;
  std::optional<OdometrySample> odometry;
};

geo::Fix FixAt(double time_s) {
  const double wobble_m = 0.3 * std::sin(7 * time_s);
  geo::Fix fix;
  fix.stamp_ns = kBeginNs + Nanoseconds(time_s);
  fix.position = geo::LocalFrame(kDatum).ToGeo({10 * time_s + wobble_m, wobble_m});
  fix.covariance_m2 = 0.25 * Eigen::Matrix2d::Identity();
  return fix;
}

OdometrySample OdometryAt(double time_s) {
  OdometrySample sample;
  sample.stamp_ns = kBeginNs + Nanoseconds(time_s);
  sample.odom_from_base = ToIsometry({{10 * time_s, 0}, 0});
  return sample;
}

/// Fixes and odometry at 10 Hz that arrive so late after their stamps.
std::vector<Arrival> ArrivalsOfDrive(const std::function<double(int)>& fix_late_s,
                                     const std::function<double(int)>& odometry_late_s) {
  std::vector<Arrival> arrivals;
  for (int i = 0; i <= 120; ++i) {
    const double time_s = 0.1 * i;
    arrivals.push_back({time_s + fix_late_s(i), FixAt(time_s), std::nullopt});
    arrivals.push_back({time_s + odometry_late_s(i), std::nullopt, OdometryAt(time_s)});
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const Arrival& a, const Arrival& b) { return a.steady_s < b.steady_s; });
  return arrivals;
}

LocalizerConfig Config() {
  LocalizerConfig config;
  config.datum = kDatum;
  config.receiver.latency_s = 0;
  config.receiver.latency_sigma_s = 0;
  return config;
}

class FedLocalizer {
 public:
  FedLocalizer()
      : localizer(Config()),
        feed(
            {}, localizer,
            [this](const OdometrySample& sample) {
              const auto fused = localizer.Fused(sample.stamp_ns);
              if (!fused || fused->state == LocalizerState::kUninitialised) return;
              stamps_ns.push_back(sample.stamp_ns);
              easts_m.push_back(fused->map_from_base.position_m.x());
            },
            [this](const geo::Fix&, Verdict verdict) { verdicts.push_back(verdict); }) {}

  void Play(const std::vector<Arrival>& arrivals) {
    for (const Arrival& arrival : arrivals) {
      if (arrival.fix) feed.AddFix(*arrival.fix, arrival.steady_s);
      if (arrival.odometry) feed.AddOdometry(*arrival.odometry, arrival.steady_s);
    }
    feed.Advance(1e9);
  }

  GeoLocalizer localizer;
  std::vector<std::int64_t> stamps_ns;
  std::vector<double> easts_m;
  std::vector<Verdict> verdicts;
  LocalizerFeed feed;
};

TEST(LocalizerFeed, GivesTheSamePosesInWhateverOrderTheMessagesArrive) {
  FedLocalizer in_order;
  in_order.Play(ArrivalsOfDrive([](int) { return 0.0; }, [](int) { return 0.001; }));
  ASSERT_THAT(in_order.easts_m, Not(IsEmpty()));
  FedLocalizer odometry_late;
  odometry_late.Play(
      ArrivalsOfDrive([](int) { return 0.0; }, [](int i) { return i % 3 == 0 ? 0.14 : 0.06; }));
  FedLocalizer fixes_late;
  fixes_late.Play(
      ArrivalsOfDrive([](int i) { return i % 4 == 0 ? 0.14 : 0.05; }, [](int) { return 0.005; }));
  EXPECT_EQ(odometry_late.easts_m, in_order.easts_m);
  EXPECT_EQ(fixes_late.easts_m, in_order.easts_m);
}

TEST(LocalizerFeed, OdometryWaitsForFixesNoLongerThanItMay) {
  FedLocalizer run;
  run.Play(ArrivalsOfDrive([](int) { return 0.0; }, [](int) { return 0.001; }));
  const std::size_t before = run.stamps_ns.size();
  run.feed.AddOdometry(OdometryAt(12.1), 100.0);
  EXPECT_EQ(run.stamps_ns.size(), before) << "a fix of its moment may come";
  run.feed.Advance(100.14);
  EXPECT_EQ(run.stamps_ns.size(), before);
  run.feed.Advance(100.16);
  EXPECT_EQ(run.stamps_ns.size(), before + 1) << "none came";
}

TEST(LocalizerFeed, AReplayThatBeginsAgainGivesTheSamePosesAgain) {
  const auto arrivals = ArrivalsOfDrive([](int) { return 0.0; }, [](int) { return 0.001; });
  FedLocalizer run;
  run.Play(arrivals);
  const std::vector<double> first = run.easts_m;
  run.easts_m.clear();
  run.Play(arrivals);
  EXPECT_EQ(run.easts_m, first);
}

TEST(LocalizerFeed, AFixThatIsStampedWronglyOnceHarmsNothing) {
  FedLocalizer run;
  auto arrivals = ArrivalsOfDrive([](int) { return 0.0; }, [](int) { return 0.001; });
  geo::Fix wrong = FixAt(8.05);
  wrong.stamp_ns += 100LL * 365 * 86400 * 1'000'000'000;
  const auto middle = std::find_if(arrivals.begin(), arrivals.end(),
                                   [](const Arrival& arrival) { return arrival.steady_s > 8.05; });
  arrivals.insert(middle, {8.06, wrong, std::nullopt});
  run.Play(arrivals);
  EXPECT_EQ(run.localizer.counters().clock_resets, 0u);
  EXPECT_EQ(run.feed.fix_stamps().refused(), 1u);
  EXPECT_NEAR(run.easts_m.back(), 120, 0.5);
}

TEST(LocalizerFeed, OdometryThatIsStampedWronglyOnceHarmsNothing) {
  for (const double wrong_s : {100.0 * 365 * 86400, 365.0 * 86400, -365.0 * 86400, -7.0}) {
    FedLocalizer run;
    auto arrivals = ArrivalsOfDrive([](int) { return 0.0; }, [](int) { return 0.001; });
    OdometrySample wrong = OdometryAt(8.05);
    wrong.stamp_ns += Nanoseconds(wrong_s);
    const auto middle = std::find_if(arrivals.begin(), arrivals.end(), [](const Arrival& arrival) {
      return arrival.steady_s > 8.05;
    });
    arrivals.insert(middle, {8.06, std::nullopt, wrong});
    run.Play(arrivals);
    EXPECT_EQ(run.localizer.counters().clock_resets, 0u) << wrong_s;
    EXPECT_EQ(run.feed.odometry_stamps().refused(), 1u) << wrong_s;
    EXPECT_NEAR(run.easts_m.back(), 120, 0.5) << wrong_s;
  }
}

TEST(LocalizerFeed, OdometryThatIsRefusedOrLateIsNotTheNewest) {
  FedLocalizer run;
  EXPECT_FALSE(run.feed.newest_odometry_ns());
  run.feed.AddOdometry(OdometryAt(1.0), 1.0);
  run.feed.AddOdometry(OdometryAt(1.1), 1.1);
  for (const double wrong_s : {365.0 * 86400, -365.0 * 86400, -0.05}) {
    run.feed.AddOdometry(OdometryAt(1.1 + wrong_s), 1.2);
    EXPECT_EQ(run.feed.newest_odometry_ns(), OdometryAt(1.1).stamp_ns) << wrong_s;
  }
  run.feed.AddOdometry(OdometryAt(1.2), 1.3);
  EXPECT_EQ(run.feed.newest_odometry_ns(), OdometryAt(1.2).stamp_ns);
}

TEST(LocalizerFeed, ALoopOfTheClockGivesTheSamePosesAgainFromTheFirstMessageOn) {
  const auto arrivals = ArrivalsOfDrive([](int) { return 0.0; }, [](int) { return 0.001; });
  FedLocalizer run;
  const auto play = [&] {
    for (const Arrival& arrival : arrivals) {
      const std::int64_t now_ns = kBeginNs + Nanoseconds(arrival.steady_s);
      if (arrival.fix) run.feed.AddFix(*arrival.fix, arrival.steady_s, now_ns);
      if (arrival.odometry) run.feed.AddOdometry(*arrival.odometry, arrival.steady_s, now_ns);
    }
    run.feed.Advance(1e9);
  };
  play();
  const std::vector<double> first = run.easts_m;
  ASSERT_THAT(first, Not(IsEmpty()));
  run.easts_m.clear();
  play();
  EXPECT_EQ(run.easts_m, first);
  EXPECT_EQ(run.localizer.counters().clock_resets, 1u);
}

TEST(LocalizerFeed, LostOdometryIsBridgedByTheLastSpeed) {
  FedLocalizer run;
  run.Play(ArrivalsOfDrive([](int) { return 0.0; }, [](int) { return 0.001; }));
  const double before_m = run.easts_m.back();
  OdometrySample held = OdometryAt(12.0);
  held.lost = true;
  for (int i = 1; i <= 5; ++i) {
    held.stamp_ns = kBeginNs + Nanoseconds(12.0 + 0.1 * i);
    run.feed.AddOdometry(held, 200.0 + i);
    run.feed.Advance(200.5 + i);
  }
  EXPECT_NEAR(run.easts_m.back() - before_m, 5.0, 0.3) << "10 m/s for half a second";
  const auto fused = run.localizer.Fused(held.stamp_ns);
  ASSERT_TRUE(fused);
  EXPECT_GT(std::sqrt(fused->map_covariance(0, 0)), 0.5) << "and it says how little it knows";
}

TEST(LocalizerFeed, WhatHasNoStampIsCountedAndLeftOut) {
  FedLocalizer run;
  geo::Fix fix = FixAt(1);
  fix.stamp_ns = 0;
  run.feed.AddFix(fix, 1.0);
  OdometrySample sample = OdometryAt(1);
  sample.stamp_ns = 0;
  EXPECT_FALSE(run.feed.AddOdometry(sample, 1.0));
  EXPECT_EQ(run.localizer.counters().fixes_invalid, 1u);
  EXPECT_EQ(run.localizer.counters().odometry_invalid, 1u);
}

}  // namespace
}  // namespace livemap::localization
