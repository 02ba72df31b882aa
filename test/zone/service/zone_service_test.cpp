#include "zone/service/zone_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "common/error.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

class ZoneServiceTest : public ZoneTest {
 protected:
  void TearDown() override { zone_.reset(); }
  ZoneService& Zone() {
    if (!zone_) zone_ = std::make_unique<ZoneService>(Config(), Clock(), 42);
    return *zone_;
  }
  ZoneService& Restarted() {
    zone_.reset();
    return Zone();
  }
  std::vector<Hazard> All() { return Zone().Query(std::nullopt, 0, 1000000); }

  std::unique_ptr<ZoneService> zone_;
};

TEST_F(ZoneServiceTest, RegistersANewHazardAsReported) {
  protocol::Report report = MakeReport();
  report.image = MakeJpeg(640, 480);
  const protocol::Receipt receipt = Zone().Handle(report);
  EXPECT_EQ(receipt.status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(receipt.report_uuid, report.uuid);
  EXPECT_EQ(receipt.vehicle_id, "car-1");
  const auto hazard = Zone().Find(receipt.hazard_uuid);
  ASSERT_TRUE(hazard);
  EXPECT_EQ(hazard->class_name, "pothole");
  EXPECT_EQ(hazard->position.latitude_deg, report.position.latitude_deg);
  EXPECT_EQ(hazard->covariance_m2, report.covariance_m2);
  EXPECT_EQ(hazard->sightings, 1U);
  EXPECT_EQ(hazard->sequence, 1U);
  EXPECT_EQ(hazard->updated_ns, kNowNs);
  EXPECT_EQ(hazard->image_format, "jpeg");
  EXPECT_TRUE(Zone().ImagePath(hazard->image_sha256));
}

TEST_F(ZoneServiceTest, TheFiveMetreRuleHoldsToTheCentimetre) {
  const protocol::Report first = MakeReport();
  const Uuid hazard = Zone().Handle(first).hazard_uuid;
  const protocol::Receipt outside =
      Zone().Handle(MakeReport(geo::GeodesicDestination(first.position, 0.7, 5.01)));
  EXPECT_NE(outside.hazard_uuid, hazard);
  const protocol::Receipt inside =
      Zone().Handle(MakeReport(geo::GeodesicDestination(first.position, 3.9, 4.99)));
  EXPECT_EQ(inside.hazard_uuid, hazard);
  EXPECT_EQ(Zone().Find(hazard)->sightings, 2U);
}

TEST_F(ZoneServiceTest, ARepeatedReportCountsOnceAlsoAfterARestartAndInOneBatch) {
  const protocol::Report report = MakeReport();
  const std::vector<protocol::Receipt> receipts = Zone().HandleBatch({report, report});
  const Uuid hazard = receipts[0].hazard_uuid;
  EXPECT_EQ(receipts[1].hazard_uuid, hazard);
  EXPECT_EQ(receipts[1].status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(Zone().Handle(report).hazard_uuid, hazard);
  EXPECT_EQ(Zone().Statistics().repeated, 2U);
  EXPECT_EQ(Restarted().Handle(report).hazard_uuid, hazard);
  EXPECT_EQ(Zone().Find(hazard)->sightings, 1U);
  EXPECT_EQ(Zone().Sequence(), 1U);
}

TEST_F(ZoneServiceTest, RefusesWhatIsInvalidWithAReasonAndKeepsNothingOfIt) {
  protocol::Report report = MakeReport();
  report.position.latitude_deg = kNan;
  protocol::Report huge = MakeReport();
  huge.class_name = std::string(1 << 20, 'x');
  const std::vector<protocol::Receipt> receipts = Zone().HandleBatch({report, huge, MakeReport()});
  EXPECT_EQ(receipts[0].status, protocol::Receipt::Status::kRefused);
  EXPECT_THAT(receipts[0].reason, HasSubstr("position"));
  EXPECT_TRUE(receipts[0].hazard_uuid.IsNil());
  EXPECT_EQ(receipts[1].status, protocol::Receipt::Status::kRefused);
  EXPECT_EQ(receipts[2].status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(All().size(), 1U);
  EXPECT_EQ(Zone().Statistics().refused, 2U);
}

TEST_F(ZoneServiceTest, RestartRestoresExactlyTheSameMap) {
  std::mt19937_64 generator(8);
  std::uniform_real_distribution<double> offset(0, 0.001);
  std::vector<protocol::Report> reports;
  for (int i = 0; i < 500; ++i) {
    protocol::Report report = MakeReport({40.44 + offset(generator), -79.94 + offset(generator)});
    report.class_name = i % 3 == 0 ? "traffic_cone" : "<img src=x onerror=alert(1)>";
    report.confidence = 0.3F + 0.001F * static_cast<float>(i);
    report.covariance_m2 << 1.0 / 3.0, 0.1, 0.1, 2.0 / 7.0;
    if (i % 5 == 0) report.image = MakeJpeg(64, 48, 10, static_cast<std::uint8_t>(i));
    reports.push_back(report);
  }
  Zone().HandleBatch(reports);
  Zone().Remove(All()[3].uuid, "repaired");
  Zone().Reject(All()[4].uuid, "anna", "a shadow");
  Zone().Confirm(All()[5].uuid, "anna");
  const std::vector<Hazard> before = Zone().Query(std::nullopt, 1, 1000000);
  const std::uint64_t sequence = Zone().Sequence();
  EXPECT_GT(before.size(), 50U);
  EXPECT_LT(before.size(), 500U);

  const std::vector<Hazard> after = Restarted().Query(std::nullopt, 1, 1000000);
  EXPECT_EQ(Zone().Sequence(), sequence);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_TRUE(SameHazard(after[i], before[i]));
    EXPECT_EQ(Zone().ImagePath(after[i].image_sha256).has_value(), !after[i].image_sha256.empty());
  }
  // Not only the same list: the same answers.
  EXPECT_EQ(Zone().Handle(MakeReport(geo::GeoPoint{10, 10})).status,
            protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(Zone().Sequence(), sequence + 1);
}

TEST_F(ZoneServiceTest, TheSameSeedGivesTheSameIdsButNeverTheSameIdTwice) {
  const Uuid first = Zone().Handle(MakeReport({1, 1})).hazard_uuid;
  const Uuid second = Restarted().Handle(MakeReport({2, 2})).hazard_uuid;
  EXPECT_NE(first, second);
  ZoneService::Config config = Config();
  config.directory = directory_ + "/other";
  config.store_url.clear();  // A database holds one zone.
  ZoneService other(config, Clock(), 42);
  EXPECT_EQ(other.Handle(MakeReport({1, 1})).hazard_uuid, first);
}

TEST_F(ZoneServiceTest, EventsComeAfterTheCommitInOrderOfTheirSequence) {
  std::vector<HazardEvent> events;
  const int id = Zone().Subscribe([&](const ZoneEvent& event) {
    ASSERT_TRUE(event.hazard);
    // Readable, and so committed, at the time of the call.
    EXPECT_GE(Zone().Sequence(), event.hazard->hazard.sequence);
    EXPECT_TRUE(Zone().Find(event.hazard->hazard.uuid));
    events.push_back(*event.hazard);
  });
  const Uuid hazard =
      Zone()
          .HandleBatch({MakeReport({1, 1}), MakeReport({2, 2}), MakeReport({1, 1})})[0]
          .hazard_uuid;
  EXPECT_TRUE(Zone().Remove(hazard, "repaired"));
  EXPECT_FALSE(Zone().Remove(hazard, "again"));
  ASSERT_EQ(events.size(), 4U);
  for (std::size_t i = 0; i < events.size(); ++i) EXPECT_EQ(events[i].hazard.sequence, i + 1);
  EXPECT_EQ(events[0].action, HazardAction::kAdded);
  EXPECT_EQ(events[2].action, HazardAction::kUpdated);
  EXPECT_EQ(events[2].hazard.sightings, 2U);
  EXPECT_EQ(events[3].action, HazardAction::kRemoved);
  EXPECT_EQ(events[3].hazard.state, HazardState::kGone);
  Zone().Unsubscribe(id);
  Zone().Handle(MakeReport({3, 3}));
  EXPECT_EQ(events.size(), 4U);
}

TEST_F(ZoneServiceTest, AHazardSeenAgainAfterRemovalIsANewOne) {
  const Uuid first = Zone().Handle(MakeReport()).hazard_uuid;
  EXPECT_TRUE(Zone().Remove(first, "repaired"));
  const Uuid second = Zone().Handle(MakeReport()).hazard_uuid;
  EXPECT_NE(first, second);
  EXPECT_EQ(Zone().Statistics().active_hazards, 1U);
}

TEST_F(ZoneServiceTest, RefusesNewHazardsBeyondTheMaximumButCountsSightings) {
  ZoneService::Config config = Config();
  config.max_hazards = 1;
  ZoneService zone(config, Clock(), 1);
  EXPECT_EQ(zone.Handle(MakeReport({1, 1})).status, protocol::Receipt::Status::kCommitted);
  const protocol::Receipt refused = zone.Handle(MakeReport({2, 2}));
  EXPECT_EQ(refused.status, protocol::Receipt::Status::kRefused);
  EXPECT_THAT(refused.reason, HasSubstr("maximum"));
  EXPECT_EQ(zone.Handle(MakeReport({1, 1})).status, protocol::Receipt::Status::kCommitted);
}

TEST_F(ZoneServiceTest, OnlySoManyHazardsRestOnOneVehiclesWordAlone) {
  ZoneService::Config config = Config();
  config.max_hazards_by_one_vehicle = 3;
  auto zone = std::make_unique<ZoneService>(config, Clock(), 1);
  const auto report = [&](const std::string& vehicle, double latitude) {
    protocol::Report made = MakeReport({latitude, 1});
    made.vehicle_id = vehicle;
    return zone->Handle(made);
  };
  for (int i = 0; i < 3; ++i) report("car-1", i);
  const protocol::Receipt refused = report("car-1", 3);
  EXPECT_EQ(refused.status, protocol::Receipt::Status::kRefused);
  EXPECT_EQ(refused.reason, "3 hazards rest on this vehicle's word alone, at most 3 may");
  EXPECT_EQ(report("car-1", 1).status, protocol::Receipt::Status::kCommitted) << "a known one";
  EXPECT_EQ(report("car-2", 3).status, protocol::Receipt::Status::kCommitted) << "its own share";
  zone.reset();
  zone = std::make_unique<ZoneService>(config, Clock(), 2);
  EXPECT_EQ(report("car-1", 4).status, protocol::Receipt::Status::kRefused) << "after a restart";
  // A second witness, and an official: neither rests on the one word any more.
  const Uuid seen_by_two = report("car-2", 0).hazard_uuid;
  EXPECT_EQ(report("car-1", 4).status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(report("car-1", 5).status, protocol::Receipt::Status::kRefused);
  EXPECT_TRUE(zone->Confirm(report("car-1", 4).hazard_uuid, "Anna"));
  EXPECT_EQ(report("car-1", 5).status, protocol::Receipt::Status::kCommitted);
  EXPECT_TRUE(IsOnMap(zone->Find(seen_by_two)->state));
  const auto kind = static_cast<std::size_t>(RefusalKind::kOneWitness);
  EXPECT_EQ(zone->Statistics().refused_by_kind.at(kind), 2U);
}

TEST_F(ZoneServiceTest, PicturesThatNoHazardShowsGoFirst) {
  ZoneService::Config config = Config();
  config.image_cap_bytes = 2.5 * 1021;
  ZoneService zone(config, Clock(), 1);
  const auto report_with = [&](const geo::GeoPoint& position, std::uint8_t value) {
    protocol::Report report = MakeReport(position);
    report.vehicle_id = "car-" + std::to_string(value);
    report.image = MakeJpeg(9, 9, 1000, value);
    return *zone.Find(zone.Handle(report).hazard_uuid);
  };
  const Hazard steady = report_with({1, 1}, 1);
  const Hazard superseded = report_with({2, 2}, 2);
  const Hazard newer = report_with({2, 2}, 3);
  EXPECT_FALSE(zone.ImagePath(superseded.image_sha256));
  EXPECT_TRUE(zone.ImagePath(steady.image_sha256));
  EXPECT_TRUE(zone.ImagePath(newer.image_sha256));
  EXPECT_LE(zone.Statistics().image_bytes, 2U * 1021U);
}

TEST_F(ZoneServiceTest, RemembersVehiclesForTheRetentionTimeAndTellsSubscribers) {
  std::int64_t now_ns = kNowNs;
  ZoneService zone(
      Config(), [&] { return now_ns; }, 1);
  std::vector<std::string> told;
  const int id = zone.Subscribe([&](const ZoneEvent& event) {
    if (event.vehicle) told.push_back(event.vehicle->vehicle_id);
  });
  EXPECT_TRUE(zone.UpdateVehicle({"car-1", "d", {1, 1}, kNan, 0.0, kNowNs}));
  EXPECT_FALSE(zone.UpdateVehicle({"car-2", "d", {kNan, 1}, 0, 0, kNowNs}));
  EXPECT_FALSE(zone.UpdateVehicle({"", "d", {1, 1}, 0, 0, kNowNs}));
  now_ns += 599'000'000'000;
  EXPECT_TRUE(zone.UpdateVehicle({"car-3", "", {1, 2}, 1.0, 10.0, kNowNs}));
  EXPECT_EQ(zone.Vehicles().size(), 2U);
  now_ns += 2'000'000'000;
  ASSERT_EQ(zone.Vehicles().size(), 1U);
  EXPECT_EQ(zone.Vehicles().front().vehicle_id, "car-3");
  EXPECT_EQ(told, (std::vector<std::string>{"car-1", "car-3"}));
  EXPECT_EQ(zone.Statistics().vehicle_positions_refused, 2U);
  zone.Unsubscribe(id);
}

TEST_F(ZoneServiceTest, OfAVehiclesManyPositionsReadersHearFourASecondAndTheLastOne) {
  std::int64_t now_ns = kNowNs;
  ZoneService zone(
      Config(), [&] { return now_ns; }, 1);
  std::vector<std::string> told;
  zone.Subscribe([&](const ZoneEvent& event) {
    if (event.vehicle) told.push_back(event.vehicle->drive_id);
  });
  const auto advance = [&] {
    told.clear();
    zone.Advance();
    return told;
  };
  for (int i = 0; i < 101; ++i) {
    EXPECT_TRUE(zone.UpdateVehicle({"car-1", std::to_string(i), {1, 1}, 0, 0, now_ns}));
    now_ns += kOneSecond / 100;
  }
  EXPECT_EQ(told, (std::vector<std::string>{"0", "25", "50", "75", "100"}));
  EXPECT_EQ(zone.Statistics().vehicle_positions, 101U) << "all are judged and counted";
  EXPECT_TRUE(zone.UpdateVehicle({"car-1", "last", {1, 1}, 0, 0, now_ns}));
  EXPECT_TRUE(zone.UpdateVehicle({"car-2", "other", {1, 1}, 0, 0, now_ns}));
  EXPECT_EQ(told.back(), "other") << "every vehicle has its own share";
  EXPECT_TRUE(advance().empty()) << "it is not time yet";
  now_ns += kOneSecond;
  EXPECT_EQ(advance(), (std::vector<std::string>{"last"}));
  EXPECT_TRUE(advance().empty()) << "it was told";
}

TEST_F(ZoneServiceTest, TheNumberOfVehiclesIsBounded) {
  ZoneService::Config config = Config();
  config.max_vehicles = 3;
  std::int64_t now_ns = kNowNs;
  ZoneService zone(
      config, [&] { return ++now_ns; }, 1);
  for (int i = 0; i < 10; ++i) {
    zone.UpdateVehicle({"car-" + std::to_string(i), "", {1, 1}, 0, 0, kNowNs});
  }
  ASSERT_EQ(zone.Vehicles().size(), 3U);
  EXPECT_EQ(zone.Vehicles().front().vehicle_id, "car-7");
}

TEST_F(ZoneServiceTest, RefusesImpossibleSettings) {
  ZoneService::Config config = Config();
  config.directory.clear();
  EXPECT_THROW(ZoneService(config, Clock(), 1), Error);
  config = Config();
  config.image_cap_bytes = kNan;
  EXPECT_THROW(ZoneService(config, Clock(), 1), Error);
  config = Config();
  config.vehicle_retention_s = 0;
  EXPECT_THROW(ZoneService(config, Clock(), 1), Error);
}

}  // namespace
}  // namespace livemap::zone
