#include "localization/odometry_track.h"

#include <gtest/gtest.h>

#include "test/localization/simulated_drive.h"

namespace livemap::localization {
namespace {

constexpr std::int64_t kFirstNs = 1'700'000'000'000'000'000;

TEST(OdometryTrack, AWrongFirstSpeedIsForgottenOnceStepsAgree) {
  OdometryTrack track({}, 0.5);
  // A first step of 6 m within a tenth of a second, then 10 m/s.
  track.Add(kFirstNs, ToIsometry({{0, 0}, 0}), std::nullopt);
  double way_m = 6;
  int resets = 0;
  for (int i = 1; i <= 50; ++i, way_m += 1) {
    resets += track.Add(kFirstNs + i * 100'000'000LL, ToIsometry({{way_m, 0}, 0}), std::nullopt) ==
                      OdometryTrack::Verdict::kReset
                  ? 1
                  : 0;
  }
  EXPECT_LE(resets, 2);
  EXPECT_NEAR(track.VelocityAt(track.newest_ns()).norm(), 10, 0.1);
}

TEST(OdometryTrack, AStopWhileTheOdometryWasLostIsNotCarriedOnForEver) {
  OdometryTrack track({}, 0.5);
  for (int i = 0; i <= 20; ++i) {
    track.Add(kFirstNs + i * 100'000'000LL, ToIsometry({{2.0 * i, 0}, 0}), std::nullopt);
  }
  for (int i = 21; i <= 40; ++i) {
    track.AddLost(kFirstNs + i * 100'000'000LL, ToIsometry({{40, 0}, 0}));
  }
  for (int i = 41; i <= 60; ++i) {
    track.Add(kFirstNs + i * 100'000'000LL, ToIsometry({{40, 0}, 0}), std::nullopt);
  }
  EXPECT_LT(track.VelocityAt(track.newest_ns()).norm(), 0.1);
}

TEST(OdometryTrack, ASingleJumpLeavesTheSpeedAsItWas) {
  OdometryTrack track({}, 0.5);
  for (int i = 0; i <= 50; ++i) {
    const double jump_m = i >= 25 ? 5 : 0;
    const OdometryTrack::Verdict verdict = track.Add(
        kFirstNs + i * 100'000'000LL, ToIsometry({{1.0 * i + jump_m, 0}, 0}), std::nullopt);
    EXPECT_EQ(verdict, i == 25 ? OdometryTrack::Verdict::kReset : OdometryTrack::Verdict::kAccepted)
        << i;
  }
}

}  // namespace
}  // namespace livemap::localization
