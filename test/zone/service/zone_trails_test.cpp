#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/sqlite.h"
#include "geo/wgs84.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

class ZoneTrailsTest : public ZoneTest {
 protected:
  ZoneService::Clock MovingClock() {
    return [this] { return now_ns_; };
  }
  /// A vehicle tells its place once a second while it drives from one place to another at 12 m/s.
  void Drive(ZoneService& zone, const std::string& vehicle_id, const Eigen::Vector2d& from_m,
             const Eigen::Vector2d& to_m) {
    constexpr double kSpeedMps = 12;
    const Eigen::Vector2d way_m = to_m - from_m;
    const auto seconds = static_cast<int>(way_m.norm() / kSpeedMps);
    for (int i = 0; i <= seconds; ++i) {
      const Eigen::Vector2d at_m = from_m + i * kSpeedMps * way_m.normalized();
      EXPECT_TRUE(Tell(zone, vehicle_id, at_m, kSpeedMps, std::atan2(way_m.x(), way_m.y())));
      now_ns_ += kOneSecond;
    }
  }
  bool Tell(ZoneService& zone, const std::string& vehicle_id, const Eigen::Vector2d& at_m,
            double speed_mps, double course_rad) {
    VehicleState vehicle;
    vehicle.vehicle_id = vehicle_id;
    vehicle.drive_id = "drive-1";
    vehicle.position = frame_.ToGeo(at_m);
    vehicle.course_rad = course_rad;
    vehicle.speed_mps = speed_mps;
    vehicle.stamp_ns = now_ns_;
    vehicle.sigma_m = 1;
    return zone.UpdateVehicle(vehicle);
  }
  protocol::Receipt Report(ZoneService& zone, const std::string& vehicle_id) {
    protocol::Report report = MakeReport(kHazard);
    report.vehicle_id = vehicle_id;
    report.stamp_ns = now_ns_;
    return zone.Handle(report);
  }
  std::vector<Eigen::Vector2d> TrailOf(const ZoneService& zone, const Uuid& hazard,
                                       std::size_t number = 0) const {
    std::vector<Eigen::Vector2d> places_m;
    const auto known = zone.Find(hazard);
    if (!known || known->trails.size() <= number) return places_m;
    for (const geo::GeoPoint& place : known->trails[number]) {
      places_m.push_back(frame_.ToEnu(place));
    }
    return places_m;
  }

  const geo::GeoPoint kHazard{40.44, -79.94};
  geo::LocalFrame frame_{kHazard};
  std::int64_t now_ns_ = kNowNs;
};

TEST_F(ZoneTrailsTest, WithTheReportStandsHowTheVehicleCame) {
  ZoneService zone(Config(), MovingClock(), 1);
  Drive(zone, "car-1", {-400, -2}, {-24, -2});
  std::vector<protocol::Trail> told;
  const int subscription = zone.Subscribe([&](const ZoneEvent& event) {
    if (event.hazard) told = event.hazard->hazard.trails;
  });
  const Uuid hazard = Report(zone, "car-1").hazard_uuid;
  zone.Unsubscribe(subscription);
  const auto trail_m = TrailOf(zone, hazard);
  ASSERT_EQ(trail_m.size(), 2U) << "a straight way has two places";
  EXPECT_NEAR(trail_m[0].x(), -330, 20);
  EXPECT_NEAR(trail_m[1].x(), -28, 12);
  EXPECT_NEAR(trail_m[1].y(), -2, 0.1);
  EXPECT_EQ(told.size(), 1U) << "the event of the report has it";
}

TEST_F(ZoneTrailsTest, HowItWentOnIsAddedWhenItHasPassed) {
  Uuid hazard;
  std::vector<Eigen::Vector2d> trail_m;
  {
    ZoneService zone(Config(), MovingClock(), 1);
    Drive(zone, "car-1", {-400, 0}, {-24, 0});
    hazard = Report(zone, "car-1").hazard_uuid;
    const std::uint64_t sequence = zone.Sequence();
    Drive(zone, "car-1", {-12, 0}, {0, 0});
    Drive(zone, "car-1", {0, 12}, {0, 280});
    zone.Advance();
    trail_m = TrailOf(zone, hazard);
    ASSERT_GE(trail_m.size(), 3U);
    EXPECT_NEAR(trail_m.back().y(), 270, 31);
    EXPECT_EQ(zone.Sequence(), sequence) << "that is no event";
  }
  const ZoneService again(Config(), MovingClock(), 2);
  EXPECT_EQ(TrailOf(again, hazard).size(), trail_m.size()) << "the store has it";
}

TEST_F(ZoneTrailsTest, TheFirstTwoVehiclesLeaveTheirTrails) {
  ZoneService zone(Config(), MovingClock(), 1);
  Uuid hazard;
  for (const std::string vehicle : {"car-1", "car-1", "car-2", "car-3"}) {
    const double side_m = vehicle == "car-2" ? 30 : 3;
    Drive(zone, vehicle, {-300, -side_m}, {-24, -2});
    hazard = Report(zone, vehicle).hazard_uuid;
    now_ns_ += 200 * kOneSecond;
    zone.Advance();
  }
  EXPECT_EQ(zone.Find(hazard)->trails.size(), 2U);
  EXPECT_NEAR(TrailOf(zone, hazard, 0).front().y(), -3, 1);
  EXPECT_NEAR(TrailOf(zone, hazard, 1).front().y(), -30, 4) << "the other vehicle's";
}

TEST_F(ZoneTrailsTest, WhereADriveBeganIsNotTold) {
  ZoneService zone(Config(), MovingClock(), 1);
  for (int i = 0; i < 5; ++i, now_ns_ += kOneSecond) Tell(zone, "car-1", {-250, 0}, 0, kNan);
  Drive(zone, "car-1", {-250, 0}, {-24, 0});
  const auto trail_m = TrailOf(zone, Report(zone, "car-1").hazard_uuid);
  ASSERT_EQ(trail_m.size(), 2U);
  EXPECT_GE(trail_m.front().x(), -150);
}

TEST_F(ZoneTrailsTest, AVehicleThatWasElsewhereOrTellsNoPlaceLeavesNone) {
  ZoneService zone(Config(), MovingClock(), 1);
  EXPECT_TRUE(TrailOf(zone, Report(zone, "car-1").hazard_uuid).empty());
  Drive(zone, "car-2", {-400, 200}, {-24, 200});
  EXPECT_TRUE(TrailOf(zone, Report(zone, "car-2").hazard_uuid).empty());
}

TEST_F(ZoneTrailsTest, NoneIsKeptWhereTheZoneIsToTellNone) {
  ZoneService::Config config = Config();
  config.hazard_trails = false;
  ZoneService zone(config, MovingClock(), 1);
  Drive(zone, "car-1", {-300, 0}, {-24, 0});
  const Uuid hazard = Report(zone, "car-1").hazard_uuid;
  now_ns_ += 60 * kOneSecond;
  zone.Advance();
  EXPECT_TRUE(zone.Find(hazard)->trails.empty());
}

TEST_F(ZoneTrailsTest, ATrailThatIsNotCommittedIsForgotten) {
  ZoneService zone(Config(), MovingClock(), 1);
  const Uuid hazard = Report(zone, "car-1").hazard_uuid;
  Drive(zone, "car-2", {-300, 0}, {-24, 0});
  StoreProbe saboteur = Probe();
  saboteur.Refuse("INSERT", "events", "full");
  EXPECT_THROW(Report(zone, "car-2"), StoreError);
  saboteur.Accept("events");
  EXPECT_TRUE(zone.Find(hazard)->trails.empty());
}

TEST_F(ZoneTrailsTest, BrokenTrailsInTheStoreAreLeftOutAndTold) {
  Uuid hazard;
  {
    ZoneService zone(Config(), MovingClock(), 1);
    Drive(zone, "car-1", {-300, 0}, {-24, 0});
    hazard = Report(zone, "car-1").hazard_uuid;
  }
  Probe().Execute("UPDATE hazard_trails SET trails = '2 1 1 1'");
  ZoneService zone(Config(), MovingClock(), 1);
  EXPECT_EQ(zone.Statistics().store_damage.rows, 1U);
  EXPECT_THAT(zone.Statistics().store_damage.first, testing::HasSubstr("trails"));
  ASSERT_TRUE(zone.Find(hazard));
  EXPECT_TRUE(zone.Find(hazard)->trails.empty());
}

}  // namespace
}  // namespace livemap::zone
