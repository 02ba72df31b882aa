// Where a vehicle can have been, by all that it tells; what names its reports may have.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

const geo::GeoPoint kPittsburgh{40.44, -79.94};
const geo::GeoPoint kSydney{-33.87, 151.21};

class ZonePlacesTest : public ZoneTest {
 protected:
  ZoneService& Zone() {
    if (!zone_) {
      ZoneService::Config config = Config();
      config.speed = SpeedRule();
      config.catalogue = catalogue_;
      config.unknown_classes = unknown_;
      zone_ = std::make_unique<ZoneService>(
          config, [this] { return now_ns_; }, 42);
    }
    return *zone_;
  }
  bool Report(const geo::GeoPoint& position, double ago_s, const std::string& name = "pothole") {
    protocol::Report report = MakeReport(position);
    report.class_name = name;
    report.stamp_ns = now_ns_ - static_cast<std::int64_t>(ago_s * 1e9);
    const protocol::Receipt receipt = Zone().Handle(report);
    reason_ = receipt.reason;
    return receipt.status == protocol::Receipt::Status::kCommitted;
  }
  VehicleState Position(const geo::GeoPoint& position) const {
    VehicleState vehicle{"car-1", "drive-1", position, 0.5, 10.0, now_ns_};
    vehicle.sigma_m = 2;
    return vehicle;
  }
  std::uint64_t Refused(RefusalKind kind) {
    return Zone().Statistics().positions_refused_by_kind[static_cast<std::size_t>(kind)];
  }

  std::int64_t now_ns_ = kNowNs;
  protocol::HazardCatalogue catalogue_ = OneVehicleSuffices();
  UnknownClasses unknown_ = UnknownClasses::kOther;
  std::string reason_;
  std::unique_ptr<ZoneService> zone_;
};

TEST_F(ZonePlacesTest, ABackDatedReportIsComparedWithItsNeighboursInTimeAlsoAfterARestart) {
  EXPECT_TRUE(Report(kPittsburgh, 20 * 86400));
  EXPECT_TRUE(Report(kPittsburgh, 10 * 86400));
  EXPECT_TRUE(Report(kPittsburgh, 0));
  for (int round = 0; round < 2; ++round) {
    // Days from the newest report, minutes from another one.
    EXPECT_FALSE(Report(kSydney, 10 * 86400 + 600));
    EXPECT_THAT(reason_, HasSubstr("m/s"));
    EXPECT_FALSE(Report({51.5, -0.1}, 20 * 86400 - 600));
    zone_.reset();
  }
  // What waited for long in an outbox and fits is taken.
  EXPECT_TRUE(Report(geo::GeodesicDestination(kPittsburgh, 1, 5000), 15 * 86400));
}

TEST_F(ZonePlacesTest, ReportsMapChangesAndPositionsShareOneRule) {
  EXPECT_TRUE(Zone().UpdateVehicle(Position(kPittsburgh)));
  EXPECT_FALSE(Report(kSydney, 1));
  protocol::MapChangeReport change = MakeBarrier();
  change.vehicle_id = "car-1";
  change.position = kSydney;
  change.stamp_ns = now_ns_ - kOneSecond;
  change.earlier_stamp_ns = now_ns_ - kOneDay;
  EXPECT_THAT(Zone().HandleMapChanges({change}).front().reason, HasSubstr("m/s"));
  EXPECT_EQ(Zone().Statistics().map_changes.too_fast, 1U);
  EXPECT_TRUE(Report(kPittsburgh, 1));
  now_ns_ += 300'000'000;
  EXPECT_FALSE(Zone().UpdateVehicle(Position(kSydney)));
  EXPECT_EQ(Refused(RefusalKind::kSpeed), 1U);
  EXPECT_NEAR(Zone().Vehicles().front().position.latitude_deg, 40.44, 1e-9);
}

TEST_F(ZonePlacesTest, AfterARestartAPositionIsComparedWithWhatWasReported) {
  EXPECT_TRUE(Report(kPittsburgh, 0));
  zone_.reset();
  now_ns_ += kOneSecond;
  EXPECT_FALSE(Zone().UpdateVehicle(Position(kSydney)));
  EXPECT_TRUE(Zone().UpdateVehicle(Position(kPittsburgh)));
}

TEST_F(ZonePlacesTest, NoPositionIsEverStored) {
  EXPECT_TRUE(Zone().UpdateVehicle(Position({40.4401, -79.94})));
  EXPECT_TRUE(Report(kPittsburgh, 1)) << "of the same five seconds";
  now_ns_ += 60 * kOneSecond;
  EXPECT_TRUE(Zone().UpdateVehicle(Position({40.4402, -79.94})));
  EXPECT_TRUE(Report(kPittsburgh, 30));
  EXPECT_EQ(Probe().Text("SELECT latitude FROM places"), "40.44 40.44");
  EXPECT_THROW(Probe().Execute("SELECT 1 FROM last_reports"), StoreError) << "of older schemas";
  // What is in memory holds for both.
  EXPECT_FALSE(Report(kSydney, 0));
}

TEST_F(ZonePlacesTest, TimeDropsStoredPlacesThatNoReportMayBeAsOldAs) {
  EXPECT_TRUE(Report(kPittsburgh, 20 * 86400));
  EXPECT_TRUE(Report(kPittsburgh, 10));
  now_ns_ += 15 * kOneDay;
  Zone().Advance();
  EXPECT_EQ(Probe().Number("SELECT count(*) FROM places"), 1);
}

TEST_F(ZonePlacesTest, AFloodOfPositionsOutvotesNothing) {
  EXPECT_TRUE(Zone().UpdateVehicle(Position(kPittsburgh)));
  for (int i = 0; i < 1000; ++i) {
    now_ns_ += 300'000;  // A third of a second in all.
    EXPECT_FALSE(Zone().UpdateVehicle(Position(kSydney)));
  }
}

TEST_F(ZonePlacesTest, AWrongFirstFixIsOutvotedByThreeThatAgree) {
  EXPECT_TRUE(Zone().UpdateVehicle(Position({1e-5, 1e-5})));
  int refused = 0;
  for (int i = 0; i < 10; ++i) {
    now_ns_ += kOneSecond;
    refused += Zone().UpdateVehicle(Position(kPittsburgh)) ? 0 : 1;
  }
  EXPECT_EQ(refused, 2);
}

TEST_F(ZonePlacesTest, ImpossiblePositionsAreRefusedAndCountedByTheirKind) {
  const auto with = [&](const auto& change) {
    VehicleState vehicle = Position(kPittsburgh);
    change(vehicle);
    return Zone().UpdateVehicle(vehicle);
  };
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(with([](VehicleState& v) { v.speed_mps = 1e30; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.speed_mps = -1; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.speed_mps = kNan; }));
  EXPECT_EQ(Refused(RefusalKind::kSpeed), 3U);
  EXPECT_FALSE(with([](VehicleState& v) { v.sigma_m = kNan; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.sigma_m = -1; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.sigma_m = 1e9; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.outbox_age_s = kNan; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.outbox_age_s = -1; }));
  EXPECT_FALSE(with([&](VehicleState& v) { v.course_rad = infinity; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.course_rad = 1e9; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.position = {0, 0}; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.position = {91, 0}; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.vehicle_id = "car-1 "; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.drive_id = "\xe3\x80\x80"; }));
  EXPECT_EQ(Refused(RefusalKind::kMalformed), 11U);
  EXPECT_FALSE(with([](VehicleState& v) { v.stamp_ns = 0; }));
  EXPECT_FALSE(with([](VehicleState& v) { v.stamp_ns -= 31 * kOneDay; }));
  EXPECT_EQ(Refused(RefusalKind::kTooOld), 2U);
  EXPECT_FALSE(with([](VehicleState& v) { v.stamp_ns = 4'294'967'000'000'000'000; }));
  EXPECT_EQ(Refused(RefusalKind::kFuture), 1U);
  EXPECT_EQ(Zone().Statistics().vehicle_positions_refused, 17U);
  EXPECT_TRUE(Zone().Vehicles().empty());
  EXPECT_TRUE(with([](VehicleState& v) { v.course_rad = kNan; })) << "it stands";
}

TEST_F(ZonePlacesTest, NoReportIsFromWhereAReceiverWithoutAFixIs) {
  EXPECT_FALSE(Report({0, 0}, 0));
  EXPECT_THAT(reason_, HasSubstr("0, 0"));
  EXPECT_TRUE(Report({0, 1e-5}, 0));
}

TEST_F(ZonePlacesTest, FourHundredNamesOfClassesAreOneHeadingAlsoInAStoreOfBefore) {
  for (int i = 0; i < 20; ++i) {
    EXPECT_TRUE(Report(kPittsburgh, 0, "spam-" + std::to_string(i)));
  }
  zone_.reset();
  catalogue_ = protocol::HazardCatalogue::Parse("classes: {pothole: {}}\n", "test");
  for (int i = 20; i < 400; ++i) {
    EXPECT_TRUE(Report(kPittsburgh, 0, "spam-" + std::to_string(i)));
  }
  EXPECT_TRUE(Report(kPittsburgh, 0, "p\xd0\xbethole")) << "a Cyrillic o";
  EXPECT_TRUE(Report(kPittsburgh, 0, " pothole\xc2\xa0"));
  EXPECT_FALSE(Report(kPittsburgh, 0, "\xe3\x80\x80"));
  EXPECT_FALSE(Report(kPittsburgh, 0, "pot\xe2\x80\x8bhole"));
  std::set<std::string> names;
  for (const Hazard& hazard : Zone().Query(std::nullopt, 0, 1000)) names.insert(hazard.class_name);
  EXPECT_EQ(names, (std::set<std::string>{"other", "pothole"}));
  EXPECT_EQ(Zone().Statistics().of_unknown_class, 381U);
}

TEST_F(ZonePlacesTest, OneStartWithAWrongCatalogueLosesNoClass) {
  const auto catalogue = [](const std::string& name) {
    return protocol::HazardCatalogue::Parse("classes: {" + name + ": {}}\n", "test");
  };
  catalogue_ = catalogue("pothole");
  EXPECT_TRUE(Report(kPittsburgh, 0, "pothole"));
  zone_.reset();
  catalogue_ = catalogue("deer");
  EXPECT_TRUE(Report({41, -79.94}, 3600, " pothole\xc2\xa0"));
  for (const Hazard& hazard : Zone().Query(std::nullopt, 0, 10)) {
    EXPECT_EQ(hazard.class_name, "other");
  }
  zone_.reset();
  catalogue_ = catalogue("pothole");
  const std::vector<Hazard> hazards = Zone().Query(std::nullopt, 0, 10);
  ASSERT_EQ(hazards.size(), 2U);
  for (const Hazard& hazard : hazards) EXPECT_EQ(hazard.class_name, "pothole");
}

TEST_F(ZonePlacesTest, UnknownClassesAreRefusedWhereTheZoneSaysSo) {
  catalogue_ = protocol::HazardCatalogue::Parse("classes: {pothole: {}}\n", "test");
  unknown_ = UnknownClasses::kRefuse;
  EXPECT_FALSE(Report(kPittsburgh, 0, "spam"));
  EXPECT_THAT(reason_, HasSubstr("catalogue"));
  EXPECT_TRUE(Report(kPittsburgh, 0, "pothole"));
  const auto counted = Zone().Statistics().refused_by_kind;
  EXPECT_EQ(counted[static_cast<std::size_t>(RefusalKind::kUnknownClass)], 1U);
}

TEST_F(ZonePlacesTest, OneHazardAndOneVehicleStandOnBothSidesOfTheAntimeridian) {
  EXPECT_TRUE(Report({-17, 179.99999}, 5));
  EXPECT_TRUE(Report({-17, -179.99999}, 4)) << "two metres on";
  const std::vector<Hazard> hazards = Zone().Query(std::nullopt, 0, 10);
  ASSERT_EQ(hazards.size(), 1U);
  EXPECT_GT(std::abs(hazards.front().position.longitude_deg), 179.999);
  EXPECT_TRUE(geo::IsValid(hazards.front().position));
  EXPECT_TRUE(Zone().UpdateVehicle(Position({-17, -179.9999})));
  const geo::GeoBox across{{-18, 179}, {-16, -179}};
  EXPECT_EQ(Zone().Query(across, 0, 10).size(), 1U);
  EXPECT_EQ(Zone().Query(geo::GeoBox{{-18, -179}, {-16, 179}}, 0, 10).size(), 0U);
  EXPECT_EQ(Zone().QueryNear({-17, 179.9999}, 100, 10).size(), 1U);
  EXPECT_EQ(Zone().ChangedAround({-17, -179.9999}, 100, 0, 10).size(), 1U);
  const auto view = Zone().View();
  ASSERT_TRUE(view);
  EXPECT_GT(view->south_west.longitude_deg, view->north_east.longitude_deg);
  EXPECT_TRUE(view->Contains(hazards.front().position));
}

TEST_F(ZonePlacesTest, AHazardAtThePoleIsOneFromEveryMeridian) {
  EXPECT_TRUE(Report({90, 12}, 5));
  EXPECT_TRUE(Report({90, -170}, 4));
  EXPECT_TRUE(Report({89.99999, 80}, 3));
  EXPECT_EQ(Zone().Query(std::nullopt, 0, 10).size(), 1U);
  EXPECT_EQ(Zone().QueryNear({89.9999, -100}, 100, 10).size(), 1U);
  EXPECT_TRUE(Zone().View());
}

TEST_F(ZonePlacesTest, AMapChangeIsOneAcrossTheAntimeridian) {
  const auto tell = [&](const std::string& vehicle, double longitude_deg) {
    protocol::MapChangeReport change = MakeBarrier();
    change.vehicle_id = vehicle;
    change.position = {-17, longitude_deg};
    change.stamp_ns = now_ns_;
    change.earlier_stamp_ns = now_ns_ - kOneDay;
    return Zone().HandleMapChanges({change}).front().hazard_uuid;
  };
  const Uuid first = tell("car-1", 179.999995);
  EXPECT_EQ(tell("car-2", -179.999995), first);
  EXPECT_EQ(Zone().FindMapChange(first)->state, MapChangeState::kConfirmed);
  EXPECT_TRUE(geo::IsValid(Zone().FindMapChange(first)->position));
  EXPECT_EQ(Zone().QueryMapChanges(geo::GeoBox{{-18, 179}, {-16, -179}}, 0, 10).size(), 1U);
}

TEST_F(ZonePlacesTest, TheViewIsTheZonesBoundsWhereTheyAreSet) {
  ZoneService::Config config = Config();
  config.limits.zone = geo::GeoBox{{-18, 179}, {-16, -179}};
  const ZoneService zone(config, Clock(), 1);
  ASSERT_TRUE(zone.View());
  EXPECT_EQ(zone.View()->south_west.longitude_deg, 179);
}

}  // namespace
}  // namespace livemap::zone
