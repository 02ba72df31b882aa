#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "common/sqlite.h"
#include "geo/wgs84.h"
#include "streets/address_map.h"
#include "streets/street_map.h"
#include "streets/street_place.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

constexpr double kEast = M_PI / 2;
constexpr double kWest = -M_PI / 2;

/// A boulevard of two carriageways 8 m apart, the southern one eastwards, and Main St, with two
/// lanes, 300 m to the south.
std::shared_ptr<const streets::StreetMap> Boulevard(const geo::LocalFrame& frame) {
  streets::StreetMapBuilder builder;
  streets::Street one_way;
  one_way.id = 1;
  one_way.backward = false;
  builder.AddStreet(one_way, "Boulevard", {1, 2});
  one_way.id = 2;
  builder.AddStreet(one_way, "Boulevard", {3, 4});
  streets::Street main;
  main.id = 3;
  builder.AddStreet(main, "Main St", {5, 6});
  const auto put = [&](int node, double east_m, double north_m) {
    builder.SetPlace(node, frame.ToGeo({east_m, north_m}));
  };
  put(1, -500, -4);
  put(2, 500, -4);
  put(3, 500, 4);
  put(4, -500, 4);
  put(5, -500, -300);
  put(6, 500, -300);
  return std::make_shared<const streets::StreetMap>(builder.Build());
}

class ZoneStreetsTest : public ZoneTest {
 protected:
  ZoneService::Config WithStreets() const {
    ZoneService::Config config = Config();
    config.streets = Boulevard(frame_);
    return config;
  }
  /// A vehicle drives by the place and reports what it saw there.
  Uuid Pass(ZoneService& zone, const std::string& vehicle_id, double east_m, double north_m,
            double course_rad) {
    if (!std::isnan(course_rad)) {
      VehicleState vehicle;
      vehicle.vehicle_id = vehicle_id;
      vehicle.drive_id = "drive-1";
      vehicle.position = frame_.ToGeo({east_m, north_m});
      vehicle.course_rad = course_rad;
      vehicle.speed_mps = 12;
      vehicle.stamp_ns = kNowNs;
      vehicle.sigma_m = 1;
      EXPECT_TRUE(zone.UpdateVehicle(vehicle));
    }
    protocol::Report report = MakeReport(frame_.ToGeo({east_m, north_m}));
    report.vehicle_id = vehicle_id;
    report.covariance_m2 = 4 * Eigen::Matrix2d::Identity();
    const protocol::Receipt receipt = zone.Handle(report);
    EXPECT_EQ(receipt.status, protocol::Receipt::Status::kCommitted) << receipt.reason;
    return receipt.hazard_uuid;
  }
  static std::string DirectionOf(const ZoneService& zone, const Uuid& hazard) {
    return zone.WordsOf(*zone.Find(hazard)).direction;
  }

  geo::LocalFrame frame_{{40.44, -79.94}};
};

TEST_F(ZoneStreetsTest, HazardsOfTheTwoCarriagewaysOfAStreetAreNotMerged) {
  ZoneService zone(WithStreets(), Clock(), 1);
  const Uuid eastbound = Pass(zone, "car-1", 0, -2, kEast);
  const Uuid westbound = Pass(zone, "car-2", 0, 2, kWest);
  EXPECT_NE(eastbound, westbound);
  // Each carriageway's own is found, though the other one lies nearer.
  EXPECT_EQ(Pass(zone, "car-3", 0, 1, kEast), eastbound);
  EXPECT_EQ(Pass(zone, "car-4", 0, -1, kWest), westbound);
  EXPECT_EQ(DirectionOf(zone, eastbound), "eastbound");
  EXPECT_EQ(DirectionOf(zone, westbound), "westbound");
}

TEST_F(ZoneStreetsTest, WithoutAStreetFileNearHazardsAreMergedAsEver) {
  ZoneService zone(Config(), Clock(), 1);
  EXPECT_EQ(Pass(zone, "car-1", 0, -2, kEast), Pass(zone, "car-2", 0, 2, kWest));
  EXPECT_EQ(zone.streets(), nullptr);
}

TEST_F(ZoneStreetsTest, AHazardOfOneCarriagewayIsSeenFromBothDirections) {
  ZoneService zone(WithStreets(), Clock(), 1);
  const Uuid first = Pass(zone, "car-1", 0, -299, kEast);
  EXPECT_EQ(Pass(zone, "car-2", 0, -301, kWest), first);
  EXPECT_EQ(DirectionOf(zone, first), "eastbound");
}

TEST_F(ZoneStreetsTest, AReportWithoutACourseBetweenCarriagewaysIsMergedWithTheNearest) {
  ZoneService zone(WithStreets(), Clock(), 1);
  const Uuid eastbound = Pass(zone, "car-1", 0, -2, kEast);
  EXPECT_EQ(Pass(zone, "car-2", 0, 0.5, kNan), eastbound);
}

TEST_F(ZoneStreetsTest, AHazardOfBeforeTakesTheCourseOfTheNextPassAndKeepsIt) {
  Uuid hazard;
  {
    ZoneService zone(Config(), Clock(), 1);
    hazard = Pass(zone, "car-1", 0, 0, kEast);
    EXPECT_TRUE(std::isnan(zone.Find(hazard)->course_rad));
  }
  {
    ZoneService zone(WithStreets(), Clock(), 1);
    EXPECT_EQ(DirectionOf(zone, hazard), "");
    EXPECT_EQ(Pass(zone, "car-2", 0, 1, kWest), hazard);
    EXPECT_EQ(DirectionOf(zone, hazard), "westbound");
  }
  ZoneService zone(WithStreets(), Clock(), 1);
  EXPECT_EQ(DirectionOf(zone, hazard), "westbound");
  EXPECT_NE(Pass(zone, "car-3", 0, -2, kEast), hazard);
}

TEST_F(ZoneStreetsTest, AHazardIsDescribedByItsStreetAndHouse) {
  ZoneService::Config config = WithStreets();
  streets::AddressMapBuilder houses;
  houses.SetPlace(1, frame_.ToGeo({10, -285}), "Main St", "12");
  config.addresses = std::make_shared<const streets::AddressMap>(houses.Build());
  ZoneService zone(config, Clock(), 1);
  const Uuid hazard = Pass(zone, "car-1", 0, -300, kWest);
  const streets::StreetWords words = zone.WordsOf(*zone.Find(hazard));
  EXPECT_EQ(words.street, "Main St");
  EXPECT_EQ(words.near, "no. 12");
  EXPECT_EQ(words.direction, "westbound");
}

TEST_F(ZoneStreetsTest, ABrokenCourseInTheStoreIsLeftOutAndTold) {
  Uuid hazard;
  {
    ZoneService zone(WithStreets(), Clock(), 1);
    hazard = Pass(zone, "car-1", 0, -4, kWest);
  }
  Probe().Execute("UPDATE hazard_courses SET course_rad = 99");
  ZoneService zone(WithStreets(), Clock(), 1);
  EXPECT_EQ(zone.Statistics().store_damage.rows, 1U);
  EXPECT_THAT(zone.Statistics().store_damage.first, testing::HasSubstr("course"));
  ASSERT_TRUE(zone.Find(hazard));
  EXPECT_TRUE(std::isnan(zone.Find(hazard)->course_rad));
}

TEST_F(ZoneStreetsTest, ACourseWithATurnTooManyIsToldWithout) {
  ZoneService zone(WithStreets(), Clock(), 1);
  const Uuid hazard = Pass(zone, "car-1", 0, -4, kWest + 2 * M_PI);
  EXPECT_NEAR(std::remainder(zone.Find(hazard)->course_rad - kWest, 2 * M_PI), 0, 1e-6);
  EXPECT_LE(std::abs(zone.Find(hazard)->course_rad), 3.1416);
  const Uuid other = Pass(zone, "car-2", 0, -300, kEast - 4 * M_PI);
  EXPECT_LE(std::abs(zone.Find(other)->course_rad), 3.1416);
}

TEST_F(ZoneStreetsTest, ACourseThatIsNotCommittedIsForgotten) {
  ZoneService zone(WithStreets(), Clock(), 1);
  const Uuid hazard = Pass(zone, "car-1", 0, -300, kNan);
  StoreProbe saboteur = Probe();
  saboteur.Refuse("INSERT", "events", "full");
  EXPECT_THROW(Pass(zone, "car-2", 0, -300, kEast), StoreError);
  saboteur.Accept("events");
  EXPECT_TRUE(std::isnan(zone.Find(hazard)->course_rad));
}

}  // namespace
}  // namespace livemap::zone
