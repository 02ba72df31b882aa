#include "vehicle/alerts/driver_alerts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>

#include "common/error.h"
#include "common/time.h"

namespace livemap::vehicle {
namespace {

using State = HazardAlert::State;

constexpr double kStepS = 0.2;
const geo::GeoPoint kHome{49.2, 7.0};

const char kCatalogue[] = R"(
classes:
  pothole: {label: Pothole, urgency: 3}
  debris: {label: Debris, urgency: 1}
)";

Uuid AlertedId(std::uint8_t number) {
  Uuid id;
  id.bytes[15] = number;
  return id;
}

/// A vehicle on a plane that starts northwards at the origin, with exact fixes.
class DriverAlertsTest : public testing::Test {
 protected:
  explicit DriverAlertsTest(const DriverAlerts::Config& config = {})
      : alerts_(config, protocol::HazardCatalogue::Parse(kCatalogue, "test")) {}

  void PutHazard(std::uint8_t number, double east_m, double north_m,
                 const std::string& class_name = "pothole",
                 std::optional<double> altitude_m = std::nullopt) {
    ASSERT_TRUE(alerts_.Put(
        {AlertedId(number), class_name, frame_.ToGeo({east_m, north_m}), 1.0, altitude_m}));
  }

  void Note(const std::vector<HazardAlert>& told) {
    for (const HazardAlert& alert : told) told_.emplace_back(time_s_, alert);
  }

  void Fix() {
    geo::TrackPose pose;
    pose.position = frame_.ToGeo(place_m_);
    pose.covariance_m2 = 1.5 * 1.5 * Eigen::Matrix2d::Identity();
    pose.course_rad = std::numeric_limits<double>::quiet_NaN();
    Note(alerts_.Add(Nanoseconds(1000 + time_s_), pose, false, altitude_m_));
  }

  void Drive(double length_m, double speed_mps, double curvature = 0) {
    for (double driven_m = 0; driven_m < length_m; driven_m += speed_mps * kStepS) {
      const double turn_rad = 0.5 * curvature * speed_mps * kStepS;
      course_rad_ += turn_rad;
      place_m_ +=
          speed_mps * kStepS * Eigen::Vector2d(std::sin(course_rad_), std::cos(course_rad_));
      course_rad_ += turn_rad;
      time_s_ += kStepS;
      Fix();
    }
  }

  void Stand(double seconds) {
    for (double stood_s = 0; stood_s < seconds; stood_s += kStepS) {
      time_s_ += kStepS;
      Fix();
    }
  }

  /// What was told about a hazard, in order.
  std::vector<State> StatesOf(std::uint8_t number) const {
    std::vector<State> states;
    for (const auto& [time_s, alert] : told_) {
      if (alert.id == AlertedId(number)) states.push_back(alert.state);
    }
    return states;
  }

  DriverAlerts alerts_;
  geo::LocalFrame frame_{kHome};
  Eigen::Vector2d place_m_ = Eigen::Vector2d::Zero();
  double course_rad_ = 0;
  double time_s_ = 0;
  std::optional<double> altitude_m_;
  std::vector<std::pair<double, HazardAlert>> told_;
};

TEST_F(DriverAlertsTest, WarnsOnceAndInTimeOfWhatLiesAhead) {
  PutHazard(1, 0, 400);
  Drive(500, 14);
  ASSERT_EQ(StatesOf(1), (std::vector<State>{State::kApproach, State::kPassed}));
  const double reached_s = 400 / 14.0;
  const auto& [time_s, alert] = told_.front();
  EXPECT_GE(reached_s - time_s, 4.0);
  EXPECT_LE(reached_s - time_s, 7.0) << "not so early that the driver forgets it";
  EXPECT_EQ(alert.side, HazardAlert::Side::kAhead);
  EXPECT_NEAR(alert.distance_m, 400 - 14 * time_s, 5);
  EXPECT_NEAR(alert.time_s, reached_s - time_s, 0.5);
  EXPECT_EQ(alert.class_name, "pothole");
}

TEST_F(DriverAlertsTest, AVelocityCountsWithTheFixOfItsStampWhicheverComesFirst) {
  Drive(50, 14);
  const auto next_ns = Nanoseconds(1000 + time_s_ + kStepS);
  EXPECT_TRUE(alerts_.AddVelocity(next_ns, {{0, 14}, 0.1}));
  EXPECT_EQ(alerts_.counters().velocities, 0U) << "its fix has yet to come";
  Stand(kStepS);
  EXPECT_EQ(alerts_.counters().velocities, 1U);
  Stand(kStepS);
  EXPECT_TRUE(alerts_.AddVelocity(Nanoseconds(1000 + time_s_), {{0, 14}, 0.1}));
  EXPECT_EQ(alerts_.counters().velocities, 2U);
  EXPECT_TRUE(alerts_.AddVelocity(Nanoseconds(1000 + time_s_ + 0.05), {{0, 14}, 0.1}));
  Stand(kStepS);
  EXPECT_EQ(alerts_.counters().velocities, 2U) << "no fix has that stamp";
  EXPECT_FALSE(alerts_.AddVelocity(0, {{std::numeric_limits<double>::quiet_NaN(), 0}, 0.1}));
}

TEST_F(DriverAlertsTest, TheFasterTheEarlier) {
  EXPECT_GE(alerts_.LeadS(2, 5), 4);
  EXPECT_GT(alerts_.LeadS(2, 36), alerts_.LeadS(2, 14) + 1);
  EXPECT_GT(alerts_.LeadS(1, 14), alerts_.LeadS(2, 14));
}

TEST_F(DriverAlertsTest, KeepsSilentAboutAParallelStreet) {
  PutHazard(1, 15, 400);
  PutHazard(2, -15, 450);
  Drive(600, 14);
  EXPECT_TRUE(told_.empty());
}

TEST_F(DriverAlertsTest, KeepsSilentAboutTheOppositeCarriageway) {
  PutHazard(1, -13, 600);
  Drive(900, 30);
  EXPECT_TRUE(told_.empty());
}

TEST_F(DriverAlertsTest, KeepsSilentAboutWhatLiesBehind) {
  Drive(100, 14);
  PutHazard(1, 0, 60);
  Drive(300, 14);
  EXPECT_TRUE(told_.empty());
}

TEST_F(DriverAlertsTest, KeepsSilentAboutACrossStreet) {
  PutHazard(1, 40, 300);
  PutHazard(2, -30, 300);
  Drive(500, 14);
  EXPECT_TRUE(told_.empty());
}

TEST_F(DriverAlertsTest, KeepsSilentAboutABridgeWhoseAltitudeIsKnown) {
  PutHazard(1, 0, 400, "pothole", 206);
  PutHazard(2, 0, 450, "pothole", 199);
  altitude_m_ = 200;
  Drive(600, 14);
  EXPECT_TRUE(StatesOf(1).empty());
  EXPECT_EQ(StatesOf(2).size(), 2U);
}

TEST_F(DriverAlertsTest, FollowsABend) {
  // A quarter of a circle of 100 m to the right; the hazard lies on its arc, past 60 degrees.
  const double angle_rad = M_PI / 3;
  PutHazard(1, 100 * (1 - std::cos(angle_rad)), 200 + 100 * std::sin(angle_rad));
  Drive(200, 12);
  Drive(150, 12, 0.01);
  EXPECT_EQ(StatesOf(1), (std::vector<State>{State::kApproach, State::kPassed}));
}

TEST_F(DriverAlertsTest, FollowsTheTrailOfOneWhoPassedAroundABend) {
  // 130 m straight on, then a bend of 80 m radius to the right, on which the hazard lies.
  const auto bend_m = [](double way_m) {
    const double turned_rad = way_m / 80;
    return Eigen::Vector2d(80 * (1 - std::cos(turned_rad)), 300 + 80 * std::sin(turned_rad));
  };
  const Eigen::Vector2d hazard_m = bend_m(70);
  AlertHazard known{AlertedId(1), "pothole", frame_.ToGeo(hazard_m), 1.0, std::nullopt};
  AlertHazard unknown = known;
  unknown.id = AlertedId(2);
  protocol::Trail trail{frame_.ToGeo({1, 80}), frame_.ToGeo({1, 300})};
  for (double way_m = 10; way_m < 100; way_m += 10) trail.push_back(frame_.ToGeo(bend_m(way_m)));
  known.trails = {trail};
  ASSERT_TRUE(alerts_.Put(known));
  ASSERT_TRUE(alerts_.Put(unknown));
  Drive(299, 14);
  ASSERT_EQ(StatesOf(1), std::vector<State>{State::kApproach}) << "before the bend begins";
  EXPECT_GE(told_.front().second.time_s, 4.5);
  EXPECT_NEAR(told_.front().second.distance_m / told_.front().second.time_s, 14, 1);
  EXPECT_TRUE(StatesOf(2).empty()) << "nothing tells of the bend yet";
}

TEST_F(DriverAlertsTest, AnOncomingVehiclesTrailIsTheWayToo) {
  AlertHazard hazard{AlertedId(1), "pothole", frame_.ToGeo({60, 330}), 1.0, std::nullopt};
  hazard.trails = {{frame_.ToGeo({200, 332}), frame_.ToGeo({20, 332}), frame_.ToGeo({-3, 300}),
                    frame_.ToGeo({-3, 50})}};
  ASSERT_TRUE(alerts_.Put(hazard));
  Drive(280, 6);  // As slow as for the corner to come.
  EXPECT_EQ(StatesOf(1), std::vector<State>{});
  Drive(20, 5.5);
  Drive(45, 5.5, 1 / 25.0);
  EXPECT_EQ(StatesOf(1), std::vector<State>{State::kApproach});
}

TEST_F(DriverAlertsTest, KeepsSilentWhereOthersPassedBesideTheOwnWay) {
  // Right on the own way by its place, but all who passed it were 20 m to the side, and across.
  AlertHazard beside{AlertedId(1), "pothole", frame_.ToGeo({5, 400}), 3.0, std::nullopt};
  beside.trails = {{frame_.ToGeo({20, 100}), frame_.ToGeo({18, 350}), frame_.ToGeo({5, 420}),
                    frame_.ToGeo({5, 600})}};
  AlertHazard above{AlertedId(2), "pothole", frame_.ToGeo({1, 420}), 1.0, std::nullopt};
  above.trails = {{frame_.ToGeo({-250, 420}), frame_.ToGeo({250, 420})}};
  ASSERT_TRUE(alerts_.Put(beside));
  ASSERT_TRUE(alerts_.Put(above));
  PutHazard(3, 1, 420);
  Drive(390, 14);
  EXPECT_TRUE(StatesOf(2).empty());
  EXPECT_EQ(StatesOf(3), std::vector<State>{State::kApproach}) << "without a trail it is told";
}

TEST_F(DriverAlertsTest, TrailsThatCannotBeCountForNone) {
  AlertHazard hazard{AlertedId(1), "pothole", frame_.ToGeo({0, 400}), 1.0, std::nullopt};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  hazard.trails = {{{nan, 7}, {49, nan}}, {}, {frame_.ToGeo({9000, 0}), frame_.ToGeo({0, 9000})}};
  ASSERT_TRUE(alerts_.Put(hazard));
  Drive(390, 14);
  EXPECT_EQ(StatesOf(1), std::vector<State>{State::kApproach});
}

TEST_F(DriverAlertsTest, CancelsAfterATurnOff) {
  PutHazard(1, 0, 240);
  Drive(200, 10);
  ASSERT_EQ(StatesOf(1), std::vector<State>{State::kApproach});
  Drive(16, 6, 0.1);
  Drive(150, 10);
  EXPECT_EQ(StatesOf(1), (std::vector<State>{State::kApproach, State::kCancelled}));
  EXPECT_TRUE(alerts_.Ahead().empty());
}

TEST_F(DriverAlertsTest, SaysNothingNewWhileStanding) {
  Drive(200, 10);
  PutHazard(1, 0, 230);
  // Standing, even the speed that the filter still believes passes away.
  Stand(1);
  told_.clear();
  Stand(60);
  EXPECT_TRUE(told_.empty());
}

TEST_F(DriverAlertsTest, StandingBeforeAHazardIsOneApproach) {
  PutHazard(1, 0, 230);
  Drive(200, 10);
  Stand(60);
  Drive(100, 10);
  EXPECT_EQ(StatesOf(1), (std::vector<State>{State::kApproach, State::kPassed}));
}

TEST_F(DriverAlertsTest, TheWorstComesFirst) {
  Drive(100, 14);
  PutHazard(1, 0, 130, "pothole");
  PutHazard(2, 0, 140, "debris");
  PutHazard(3, 0, 125, "pothole");
  Drive(20, 14);
  ASSERT_GE(told_.size(), 3U);
  EXPECT_EQ(told_[0].second.id, AlertedId(2));
  EXPECT_EQ(told_[1].second.id, AlertedId(3));
  EXPECT_EQ(told_[2].second.id, AlertedId(1));
  const std::vector<HazardAlert> ahead = alerts_.Ahead();
  ASSERT_FALSE(ahead.empty());
  EXPECT_EQ(ahead.front().id, AlertedId(2));
}

TEST_F(DriverAlertsTest, ARemovedHazardIsCancelledOrNeverTold) {
  PutHazard(1, 0, 300);
  PutHazard(2, 0, 500);
  Drive(260, 14);
  ASSERT_EQ(StatesOf(1), std::vector<State>{State::kApproach});
  Note(alerts_.Remove(AlertedId(1)));
  Note(alerts_.Remove(AlertedId(2)));
  Note(alerts_.Remove(AlertedId(2)));
  Drive(400, 14);
  EXPECT_EQ(StatesOf(1), (std::vector<State>{State::kApproach, State::kCancelled}));
  EXPECT_TRUE(StatesOf(2).empty());
}

TEST_F(DriverAlertsTest, ASecondApproachIsToldAgain) {
  PutHazard(1, 0, 300);
  Drive(500, 14);
  place_m_ = {0, 0};
  Note(alerts_.StartAnew());
  time_s_ += 600;
  Drive(500, 14);
  EXPECT_EQ(StatesOf(1), (std::vector<State>{State::kApproach, State::kPassed, State::kApproach,
                                             State::kPassed}));
}

TEST_F(DriverAlertsTest, StartingAnewCancelsWhatStands) {
  PutHazard(1, 0, 300);
  Drive(270, 14);
  Note(alerts_.StartAnew());
  EXPECT_EQ(StatesOf(1), (std::vector<State>{State::kApproach, State::kCancelled}));
}

TEST_F(DriverAlertsTest, RefusesHazardsAndPositionsThatCannotBe) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(alerts_.Put({AlertedId(1), "pothole", {nan, 7}, 1, {}}));
  EXPECT_FALSE(alerts_.Put({AlertedId(1), "pothole", {91, 7}, 1, {}}));
  EXPECT_FALSE(alerts_.Put({AlertedId(1), "pothole", kHome, nan, {}}));
  EXPECT_FALSE(alerts_.Put({AlertedId(1), "pothole", kHome, -1, {}}));
  EXPECT_FALSE(alerts_.Put({AlertedId(1), "pothole", kHome, 1, nan}));
  EXPECT_FALSE(alerts_.Put({Uuid(), "pothole", kHome, 1, {}}));
  EXPECT_FALSE(alerts_.Put({AlertedId(1), "pothole", kHome, 1, {}, 6.3}));
  EXPECT_FALSE(alerts_.Put(
      {AlertedId(1), "pothole", kHome, 1, {}, -std::numeric_limits<double>::infinity()}));
  EXPECT_EQ(alerts_.size(), 0U);
  geo::TrackPose pose;
  pose.position = {nan, nan};
  EXPECT_TRUE(alerts_.Add(Nanoseconds(1), pose).empty());
  pose.position = kHome;
  pose.covariance_m2.setConstant(nan);
  EXPECT_TRUE(alerts_.Add(Nanoseconds(2), pose).empty());
  EXPECT_EQ(alerts_.counters().invalid_positions, 2U);
}

TEST_F(DriverAlertsTest, ReplacesAHazardThatMoves) {
  PutHazard(1, 0, 400);
  PutHazard(1, 300, 400);
  EXPECT_EQ(alerts_.size(), 1U);
  Drive(600, 14);
  EXPECT_TRUE(told_.empty());
}

TEST(DriverAlertsLimitsTest, RefusesMoreHazardsThanItKeeps) {
  DriverAlerts::Config config;
  config.max_hazards = 2;
  DriverAlerts alerts(config, {});
  EXPECT_TRUE(alerts.Put({AlertedId(1), "a", kHome, 1, {}}));
  EXPECT_TRUE(alerts.Put({AlertedId(2), "a", kHome, 1, {}}));
  EXPECT_FALSE(alerts.Put({AlertedId(3), "a", kHome, 1, {}}));
  EXPECT_EQ(alerts.counters().refused_full, 1U);
  alerts.Remove(AlertedId(1));
  EXPECT_TRUE(alerts.Put({AlertedId(3), "a", kHome, 1, {}}));
}

TEST(DriverAlertsLimitsTest, RefusesAConfigThatCannotBe) {
  DriverAlerts::Config config;
  config.braking_mps2 = 0;
  EXPECT_THROW(DriverAlerts(config, {}), Error);
}

TEST_F(DriverAlertsTest, TheSameDriveGivesTheSameAlerts) {
  const auto drive = [] {
    DriverAlerts alerts(DriverAlerts::Config(), {});
    const geo::LocalFrame frame(kHome);
    for (std::uint8_t i = 1; i < 40; ++i) {
      alerts.Put({AlertedId(i), "a", frame.ToGeo({0.1 * i, 20.0 * i}), 1, {}});
    }
    std::vector<std::pair<Uuid, double>> told;
    for (int i = 0; i < 300; ++i) {
      geo::TrackPose pose;
      pose.position = frame.ToGeo({std::sin(0.1 * i), 2.8 * i});
      pose.covariance_m2 = Eigen::Matrix2d::Identity();
      for (const HazardAlert& alert : alerts.Add(Nanoseconds(10 + 0.2 * i), pose)) {
        told.emplace_back(alert.id, alert.distance_m);
      }
    }
    return told;
  };
  const auto first = drive();
  EXPECT_FALSE(first.empty());
  EXPECT_EQ(first, drive());
}

}  // namespace
}  // namespace livemap::vehicle
