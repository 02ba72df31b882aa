#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"
#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/admission/speed_rule.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kRefusedSecondNs = 1'000'000'000;

class ZoneRefusalTest : public ZoneTest {
 protected:
  ZoneService::Config Strict() const {
    ZoneService::Config config = Config();
    config.speed = SpeedRule();
    return config;
  }
  ZoneService& Zone() {
    if (!zone_) {
      zone_ = std::make_unique<ZoneService>(
          Strict(), [this] { return now_ns_; }, 42);
    }
    return *zone_;
  }
  /// Of car-1, `seconds` after the first, `metres` north of it.
  protocol::Report Sample(double seconds, double metres) {
    protocol::Report report = MakeReport(geo::GeodesicDestination({40.44, -79.94}, 0, metres));
    report.stamp_ns += static_cast<std::int64_t>(seconds * 1e9);
    return report;
  }
  std::uint64_t Refused(RefusalKind kind) {
    return Zone().Statistics().refused_by_kind[static_cast<std::size_t>(kind)];
  }
  std::string Reason(const protocol::Report& report) {
    const protocol::Receipt receipt = Zone().Handle(report);
    EXPECT_EQ(receipt.report_uuid, report.uuid);
    return receipt.status == protocol::Receipt::Status::kRefused ? receipt.reason : "";
  }

  std::int64_t now_ns_ = kNowNs;
  std::unique_ptr<ZoneService> zone_;
};

TEST_F(ZoneRefusalTest, AnotherVehiclesReportSentAgainIsAReplay) {
  const protocol::Report report = MakeReport();
  EXPECT_EQ(Reason(report), "");
  protocol::Report replayed = report;
  replayed.vehicle_id = "car-2";
  EXPECT_THAT(Reason(replayed), HasSubstr("another vehicle"));
  EXPECT_EQ(Refused(RefusalKind::kReplay), 1U);
  zone_.reset();
  EXPECT_THAT(Reason(replayed), HasSubstr("another vehicle"));
  EXPECT_EQ(Zone().Query(std::nullopt, 0, 10).front().sightings, 1U);
  // The sender itself gets its receipt again.
  EXPECT_EQ(Reason(report), "");
}

TEST_F(ZoneRefusalTest, AReportFromAnOutboxMayBeOldButNotOlderThanTheLimit) {
  protocol::Report waited = MakeReport();
  waited.stamp_ns = kNowNs - 29 * 86400 * kRefusedSecondNs;
  EXPECT_EQ(Reason(waited), "");
  protocol::Report stale = MakeReport({50, 8});
  stale.stamp_ns = kNowNs - 31 * 86400 * kRefusedSecondNs;
  EXPECT_THAT(Reason(stale), HasSubstr("past"));
  EXPECT_EQ(Refused(RefusalKind::kTooOld), 1U);
}

TEST_F(ZoneRefusalTest, AReplayedDriveCountsAsOfItsArrivalHoweverOldItIs) {
  ZoneService::Config config = Strict();
  config.replay = true;
  ZoneService zone(config, Clock(), 1);
  protocol::Report report = MakeReport();
  report.stamp_ns = kNowNs - 3 * 365 * 86400 * kRefusedSecondNs;
  const protocol::Receipt receipt = zone.Handle(report);
  EXPECT_EQ(receipt.reason, "");
  zone.Advance();
  const auto hazard = zone.Find(receipt.hazard_uuid);
  ASSERT_TRUE(hazard);
  EXPECT_TRUE(IsOnMap(hazard->state)) << "gone, as if unseen for three years";
  EXPECT_EQ(hazard->last_seen_ns, report.stamp_ns) << "the drive's own time is shown";
}

TEST_F(ZoneRefusalTest, AStampOfTheFutureIsRefusedAndCounted) {
  protocol::Report report = MakeReport();
  report.stamp_ns = kNowNs + 400 * kRefusedSecondNs;
  EXPECT_THAT(Reason(report), HasSubstr("future"));
  EXPECT_EQ(Refused(RefusalKind::kFuture), 1U);
}

TEST_F(ZoneRefusalTest, APositionOutsideTheZoneIsRefusedAndCounted) {
  ZoneService::Config config = Strict();
  config.limits.zone = geo::GeoBox{{40, -80}, {41, -79}};
  ZoneService zone(config, Clock(), 1);
  EXPECT_THAT(zone.Handle(MakeReport({42, -79.5})).reason, HasSubstr("outside the zone"));
  const auto counted = zone.Statistics().refused_by_kind;
  EXPECT_EQ(counted[static_cast<std::size_t>(RefusalKind::kOutsideZone)], 1U);
}

TEST_F(ZoneRefusalTest, WhatNoHonestVehicleSendsIsCountedAsMalformed) {
  protocol::Report report = MakeReport();
  report.confidence = 2;
  EXPECT_THAT(Reason(report), HasSubstr("confidence"));
  EXPECT_EQ(Refused(RefusalKind::kMalformed), 1U);
  EXPECT_EQ(Zone().Statistics().refused, 1U);
}

TEST_F(ZoneRefusalTest, AnImpossibleSpeedIsRefusedInEitherOrderOfStampsAndAlsoAfterARestart) {
  EXPECT_EQ(Reason(Sample(0, 0)), "");
  EXPECT_EQ(Reason(Sample(10, 900)), "");
  EXPECT_THAT(Reason(Sample(11, 5000)), HasSubstr("m/s"));
  // An older report of the outbox, from where the vehicle was then.
  EXPECT_EQ(Reason(Sample(5, 450)), "");
  EXPECT_THAT(Reason(Sample(4, -5000)), HasSubstr("m/s"));
  EXPECT_EQ(Refused(RefusalKind::kSpeed), 2U);
  zone_.reset();
  EXPECT_THAT(Reason(Sample(6, 5000)), HasSubstr("m/s"));
  EXPECT_EQ(Reason(Sample(60, 5000)), "");
}

TEST_F(ZoneRefusalTest, OtherVehiclesHaveTheirOwnPlaces) {
  EXPECT_EQ(Reason(Sample(0, 0)), "");
  protocol::Report other = Sample(1, 50000);
  other.vehicle_id = "car-2";
  EXPECT_EQ(Reason(other), "");
}

TEST_F(ZoneRefusalTest, OneWrongFixDoesNotShutAnHonestVehicleOut) {
  EXPECT_EQ(Reason(Sample(0, 0)), "");
  now_ns_ += 7200 * kRefusedSecondNs;
  // After a long pause a wild fix looks possible and is taken; then the vehicle is where it was.
  EXPECT_EQ(Reason(Sample(3600, 300000)), "");
  int refused = 0;
  for (int i = 1; i <= 10; ++i) {
    if (!Reason(Sample(3600 + i, 10.0 * i)).empty()) ++refused;
  }
  EXPECT_EQ(refused, 2);
}

TEST_F(ZoneRefusalTest, PlacesThatDoNotAgreeAmongThemselvesNeverBecomeBelieved) {
  EXPECT_EQ(Reason(Sample(0, 0)), "");
  for (int i = 1; i <= 20; ++i) {
    EXPECT_THAT(Reason(Sample(i, 20000.0 * i)), HasSubstr("m/s")) << i;
  }
  EXPECT_EQ(Zone().Query(std::nullopt, 0, 100).size(), 1U);
}

TEST_F(ZoneRefusalTest, ReportsBeyondTheHourlyCapGetNoReceiptAndAreTakenLater) {
  ZoneService::Config config = Config();
  config.allowance.reports_per_hour = 5;
  std::int64_t now_ns = kNowNs;
  ZoneService zone(
      config, [&] { return now_ns; }, 1);
  std::vector<protocol::Report> reports;
  for (int i = 0; i < 8; ++i) reports.push_back(MakeReport({40 + 0.01 * i, 8}));
  EXPECT_EQ(zone.HandleBatch(reports).size(), 5U);
  EXPECT_EQ(zone.Statistics().not_now, 3U);
  EXPECT_EQ(zone.Statistics().refused, 0U);
  // A repeat is answered all the same, another vehicle is served.
  EXPECT_EQ(zone.Handle(reports[0]).status, protocol::Receipt::Status::kCommitted);
  protocol::Report other = MakeReport({41, 8});
  other.vehicle_id = "car-2";
  EXPECT_EQ(zone.Handle(other).status, protocol::Receipt::Status::kCommitted);
  EXPECT_THROW(zone.Handle(reports[7]), Error);
  now_ns += 3600 * kRefusedSecondNs;
  for (std::size_t i = 5; i < 8; ++i) {
    EXPECT_EQ(zone.Handle(reports[i]).status, protocol::Receipt::Status::kCommitted);
  }
  EXPECT_EQ(zone.Query(std::nullopt, 0, 100).size(), 9U);
}

TEST_F(ZoneRefusalTest, APictureCostsItsVehicleOnceAndOnlyWhenItsReportIsCommitted) {
  ZoneService::Config config = Config();
  config.pictures.pixels_per_hour = 2 * 64 * 48;
  ZoneService zone(config, Clock(), 1);
  std::vector<protocol::Report> reports;
  for (std::uint8_t i = 0; i < 3; ++i) {
    reports.push_back(MakeReport({40 + 0.01 * i, 8}));
    reports.back().image = MakeJpeg(64, 48, 10, i);
  }
  StoreProbe saboteur = Probe();
  saboteur.Refuse("INSERT", "events", "full");
  for (int i = 0; i < 5; ++i) EXPECT_THROW(zone.HandleBatch({reports[0]}), StoreError);
  saboteur.Accept("events");
  // Twice in one batch, and sent again.
  zone.HandleBatch({reports[0], reports[0]});
  zone.HandleBatch({reports[0]});
  zone.HandleBatch({reports[1], reports[2]});
  std::size_t pictures = 0;
  for (const Hazard& hazard : zone.Query(std::nullopt, 0, 10)) {
    pictures += hazard.image_sha256.empty() ? 0U : 1U;
  }
  EXPECT_EQ(pictures, 2U);
  const auto refused = zone.Statistics().pictures_refused;
  EXPECT_EQ(refused[static_cast<std::size_t>(PictureRefusal::kTooMany)], 1U);
}

TEST_F(ZoneRefusalTest, EveryKindOfRefusalHasItsName) {
  for (std::size_t kind = 0; kind < kRefusalKinds; ++kind) {
    EXPECT_STRNE(RefusalName(static_cast<RefusalKind>(kind)), "unknown");
  }
}

}  // namespace
}  // namespace livemap::zone
