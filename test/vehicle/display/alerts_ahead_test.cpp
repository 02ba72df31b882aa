#include "vehicle/display/alerts_ahead.h"

#include <gtest/gtest.h>

namespace livemap::vehicle {
namespace {

const geo::GeoPoint kHazard{40.4433, -79.9436};

geo::GeoPoint North(double metres) { return geo::GeodesicDestination(kHazard, 0, metres); }

HazardAlert AheadAlert(int number, double distance_m,
                       HazardAlert::State state = HazardAlert::State::kApproach) {
  HazardAlert alert;
  alert.id.bytes[0] = static_cast<std::uint8_t>(number);
  alert.distance_m = distance_m;
  alert.time_s = distance_m / 10;
  alert.state = state;
  return alert;
}

TEST(AlertsAhead, DistanceFallsByTheWayThatIsDriven) {
  AlertsAhead ahead({});
  ahead.Move(North(0), 0);
  ahead.Take(AheadAlert(1, 200), 0);
  for (int second = 1; second <= 5; ++second) ahead.Move(North(20 * second), second);
  ASSERT_EQ(ahead.At(5).size(), 1U);
  EXPECT_NEAR(ahead.At(5)[0].distance_m, 100, 0.1);
  EXPECT_NEAR(ahead.At(5.5)[0].distance_m, 90, 0.1);  // By the speed.
  EXPECT_NEAR(ahead.At(5)[0].time_s, 5, 0.1);
}

TEST(AlertsAhead, AVehicleThatStandsComesNoNearer) {
  AlertsAhead ahead({});
  ahead.Move(North(0), 0);
  ahead.Move(North(10), 1);
  ahead.Take(AheadAlert(1, 100), 1);
  for (int i = 1; i <= 200; ++i) ahead.Move(North(10 + i % 2), 1 + 0.2 * i);
  EXPECT_NEAR(ahead.At(41)[0].distance_m, 100, 15);
  EXPECT_EQ(ahead.At(41)[0].distance_m, ahead.At(60)[0].distance_m);
  EXPECT_EQ(ahead.speed_mps(), 0);
}

TEST(AlertsAhead, AJumpOfTheReceiverIsNoWay) {
  AlertsAhead ahead({});
  ahead.Move(North(0), 0);
  ahead.Move(North(10), 1);
  ahead.Take(AheadAlert(1, 200), 1);
  ahead.Move(North(5000), 2);
  ahead.Move(North(5010), 3);
  EXPECT_NEAR(ahead.At(3)[0].distance_m, 200, 21);
}

TEST(AlertsAhead, TheNearestComesFirstUntilItIsPassed) {
  AlertsAhead ahead({});
  ahead.Take(AheadAlert(1, 200), 0);
  ahead.Take(AheadAlert(2, 100), 0);
  EXPECT_EQ(ahead.At(0)[0].id.bytes[0], 2);
  ahead.Take(AheadAlert(2, 0, HazardAlert::State::kPassed), 1);
  EXPECT_EQ(ahead.At(1)[0].id.bytes[0], 1);
  ahead.Take(AheadAlert(1, 0, HazardAlert::State::kCancelled), 1);
  EXPECT_TRUE(ahead.At(1).empty());
}

TEST(AlertsAhead, AnAlertThatNobodyEndsGoesWhenItLiesBehind) {
  AlertsAhead ahead({});
  ahead.Move(North(0), 0);
  ahead.Take(AheadAlert(1, 50), 0);
  for (int second = 1; second <= 9; ++second) ahead.Move(North(10 * second), second);
  EXPECT_TRUE(ahead.At(9).empty());
}

TEST(AlertsAhead, ItsMemoryIsBounded) {
  AlertsAhead::Config config;
  config.max_alerts = 2;
  AlertsAhead ahead(config);
  for (const int number : {1, 2, 3}) ahead.Take(AheadAlert(number, 100 * number), 0);
  ASSERT_EQ(ahead.At(0).size(), 2U);
  EXPECT_EQ(ahead.At(0)[1].id.bytes[0], 2);
}

}  // namespace
}  // namespace livemap::vehicle
