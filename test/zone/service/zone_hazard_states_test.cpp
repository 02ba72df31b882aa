#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/error.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kDayNs = 86400'000'000'000;
constexpr geo::GeoPoint kPlace{40.44, -79.94};

/// Hazards of one day's expected life that two vehicles must have seen.
class ZoneLifeTest : public ZoneTest {
 protected:
  ZoneService& Zone() {
    if (!zone_) {
      ZoneService::Config config = Config();
      config.catalogue = protocol::HazardCatalogue();
      zone_ = std::make_unique<ZoneService>(
          config, [this] { return now_ns_; }, 42);
    }
    return *zone_;
  }
  Uuid ReportBy(const std::string& vehicle) {
    protocol::Report report = MakeReport(kPlace);
    report.vehicle_id = vehicle;
    report.stamp_ns = now_ns_ - 1;
    return Zone().Handle(report).hazard_uuid;
  }
  Uuid ActiveHazard() {
    ReportBy("car-1");
    return ReportBy("car-2");
  }
  /// Reports the hazard 4 m east of where it is.
  void Pull(const Uuid& hazard, const std::string& vehicle) {
    now_ns_ += 1'000'000'000;
    const geo::GeoPoint at = Zone().Find(hazard)->position;
    protocol::Report report = MakeReport(geo::GeodesicDestination(at, 1.5707963267948966, 4));
    report.vehicle_id = vehicle;
    report.stamp_ns = now_ns_ - 1;
    report.covariance_m2 = Eigen::Matrix2d::Identity() * 0.1;
    report.image = MakeJpeg(64, 48, 100, static_cast<std::uint8_t>(now_ns_ / 1'000'000'000));
    EXPECT_EQ(Zone().Handle(report).hazard_uuid, hazard);
  }
  void ExpectUnmovedBy(const std::string& vehicle, const Uuid& hazard) {
    const Hazard before = *Zone().Find(hazard);
    Pull(hazard, vehicle);
    const Hazard after = *Zone().Find(hazard);
    EXPECT_EQ(geo::GeodesicDistanceM(after.position, before.position), 0);
    EXPECT_EQ(after.confidence, before.confidence);
    EXPECT_EQ(after.image_sha256, before.image_sha256);
    EXPECT_EQ(after.last_seen_ns, before.last_seen_ns);
    EXPECT_EQ(after.sightings, before.sightings + 1);
  }
  HazardState State(const Uuid& hazard) { return Zone().Find(hazard)->state; }
  /// Comes from the south, passes the place and drives on.
  void DriveBy(const std::string& vehicle, double from_m, double to_m) {
    for (double metres = from_m; metres <= to_m; metres += 15) {
      now_ns_ += 1'000'000'000;
      const double bearing = metres < 0 ? 3.14159265358979323846 : 0.0;
      const geo::GeoPoint at = geo::GeodesicDestination(kPlace, bearing, std::abs(metres));
      Zone().UpdateVehicle({vehicle, "", at, 0.0, 15.0, now_ns_});
    }
  }
  /// The zone asks this vehicle as it comes near.
  protocol::Poll Asked(const std::string& vehicle) {
    DriveBy(vehicle, -200, -60);
    const std::vector<protocol::Poll> orders = Zone().TakeDuePolls();
    EXPECT_EQ(orders.size(), 1U);
    return orders.empty() ? protocol::Poll() : orders.front();
  }
  protocol::PollAnswer AnswerTo(const protocol::Poll& order, protocol::PollAnswer::Answer said) {
    protocol::PollAnswer answer;
    answer.poll = order.poll;
    answer.hazard = order.hazard;
    answer.vehicle_id = order.vehicle_id;
    answer.answer = said;
    answer.confidence = 0.9F;
    answer.vehicle_position = kPlace;
    answer.stamp_ns = now_ns_;
    return answer;
  }
  std::vector<HazardEvent> EventsDuring(const std::function<void()>& what) {
    std::vector<HazardEvent> events;
    const int id = Zone().Subscribe([&](const ZoneEvent& event) {
      if (event.hazard) events.push_back(*event.hazard);
    });
    what();
    Zone().Unsubscribe(id);
    return events;
  }

  std::int64_t now_ns_ = kNowNs;
  std::unique_ptr<ZoneService> zone_;
};

TEST_F(ZoneLifeTest, DriversAreToldWhenASecondVehicleHasSeenIt) {
  Uuid hazard;
  const auto events = EventsDuring([&] {
    hazard = ReportBy("car-1");
    ReportBy("car-1");
    EXPECT_EQ(Zone().AnnouncedSequence(), 0U);
    EXPECT_TRUE(Zone().QueryNear(kPlace, 100, 10).empty());
    EXPECT_TRUE(Zone().ChangedAround(kPlace, 100, 0, 10).empty());
    EXPECT_EQ(Zone().Query(std::nullopt, 0, 10).size(), 1U);
    ReportBy("car-2");
    ReportBy("car-3");
  });
  ASSERT_EQ(events.size(), 4U);
  EXPECT_FALSE(events[0].from);
  EXPECT_EQ(events[0].hazard.state, HazardState::kCandidate);
  EXPECT_EQ(events[1].hazard.state, HazardState::kCandidate);
  EXPECT_EQ(events[1].hazard.vehicles, 1U);
  EXPECT_FALSE(events[1].announced);
  EXPECT_EQ(events[2].from, HazardState::kCandidate);
  EXPECT_EQ(events[2].hazard.state, HazardState::kActive);
  EXPECT_THAT(events[2].reason, HasSubstr("2 vehicles"));
  EXPECT_EQ(DriversAction(events[2].from, events[2].hazard.state), HazardAction::kAdded);
  EXPECT_TRUE(events[2].announced);
  EXPECT_EQ(events[2].previous_announced, 0U);
  EXPECT_TRUE(events[3].announced);
  EXPECT_EQ(events[3].previous_announced, 3U);
  EXPECT_EQ(Zone().AnnouncedSequence(), 4U);
  EXPECT_EQ(Zone().ChangedAround(kPlace, 100, 0, 10).size(), 1U);
  EXPECT_EQ(Zone().Find(hazard)->vehicles, 3U);
}

TEST_F(ZoneLifeTest, AnOfficialSufficesAndIsNamedInTheEvent) {
  const Uuid hazard = ReportBy("car-1");
  EXPECT_TRUE(Zone().Confirm(hazard, "Anna"));
  EXPECT_EQ(State(hazard), HazardState::kActive);
  const auto history = Zone().Events(hazard, 10);
  ASSERT_EQ(history.size(), 2U);
  EXPECT_EQ(history[0].sequence, 1U);
  EXPECT_FALSE(history[0].from);
  EXPECT_EQ(history[1].from, HazardState::kCandidate);
  EXPECT_EQ(history[1].to, HazardState::kActive);
  EXPECT_THAT(history[1].reason, HasSubstr("Anna"));
  EXPECT_TRUE(history[1].announced);
  EXPECT_EQ(Zone().Events(hazard, 1).front().sequence, 2U);
  EXPECT_TRUE(Zone().Events(Uuid{}, 10).empty());
  EXPECT_FALSE(Zone().Confirm(Uuid{}, "Anna"));
  EXPECT_THROW(Zone().Confirm(hazard, "An\nna"), Error);
}

TEST_F(ZoneLifeTest, ARejectedHazardTakesSightingsAsEvidenceAndDoesNotReopen) {
  const Uuid hazard = ActiveHazard();
  const auto events = EventsDuring([&] { EXPECT_TRUE(Zone().Reject(hazard, "Anna", "a shadow")); });
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].action, HazardAction::kRemoved);
  EXPECT_TRUE(events[0].announced);
  EXPECT_THAT(events[0].reason, HasSubstr("a shadow"));
  EXPECT_FALSE(Zone().Reject(hazard, "Anna", ""));
  zone_.reset();
  now_ns_ += 3600'000'000'000;
  const auto later = EventsDuring([&] {
    for (const char* car : {"car-3", "car-4", "car-5"}) EXPECT_EQ(ReportBy(car), hazard);
  });
  for (const HazardEvent& event : later) {
    EXPECT_FALSE(event.announced);
    EXPECT_EQ(event.action, HazardAction::kRemoved);
  }
  EXPECT_EQ(State(hazard), HazardState::kRejected);
  EXPECT_TRUE(Zone().Query(std::nullopt, 0, 10).empty());
  // Drivers who were away hear that it is off.
  EXPECT_EQ(Zone().ChangedAround(kPlace, 100, 1, 10).size(), 1U);
  // After the quarantine two further vehicles count.
  now_ns_ += 2 * kDayNs;
  ReportBy("car-6");
  EXPECT_EQ(State(hazard), HazardState::kRejected);
  ReportBy("car-7");
  EXPECT_EQ(State(hazard), HazardState::kActive);
}

TEST_F(ZoneLifeTest, AnOfficialRevokesARejection) {
  const Uuid hazard = ActiveHazard();
  EXPECT_TRUE(Zone().Reject(hazard, "Anna", ""));
  EXPECT_TRUE(Zone().Confirm(hazard, "Bert", "no shadow after all"));
  EXPECT_EQ(State(hazard), HazardState::kActive);
  EXPECT_EQ(Zone().Events(hazard, 1).front().reason, "confirmed by Bert: no shadow after all");
  EXPECT_THROW(Zone().Confirm(hazard, "Bert", "a\nb"), Error);
}

TEST_F(ZoneLifeTest, OneVehicleCannotPullAHazardAwayStepByStep) {
  const Uuid hazard = ActiveHazard();
  Pull(hazard, "car-9");
  const Hazard pulled_once = *Zone().Find(hazard);
  for (int i = 0; i < 20; ++i) Pull(hazard, "car-9");
  EXPECT_LE(geo::GeodesicDistanceM(Zone().Find(hazard)->position, kPlace), 4.0);
  EXPECT_EQ(Zone().Find(hazard)->confidence, pulled_once.confidence);
  EXPECT_EQ(Zone().Find(hazard)->sightings, 23U);
  EXPECT_EQ(Zone().Find(hazard)->last_seen_ns, now_ns_ - 1) << "that it was seen counts";
}

TEST_F(ZoneLifeTest, WhileAVehicleIsAloneItsSurestSightingSaysWhereTheHazardIs) {
  const auto report_at = [&](const char* vehicle, double east_m, double variance_m2) {
    now_ns_ += 1'000'000'000;
    protocol::Report report = MakeReport(geo::LocalFrame(kPlace).ToGeo({east_m, 0}));
    report.vehicle_id = vehicle;
    report.stamp_ns = now_ns_ - 1;
    report.covariance_m2 = Eigen::Matrix2d::Identity() * variance_m2;
    return Zone().Handle(report).hazard_uuid;
  };
  const auto east_m = [&](const Uuid& id) {
    return geo::LocalFrame(kPlace).ToEnu(Zone().Find(id)->position).x();
  };
  const Uuid hazard = report_at("car-1", 0, 4.0);
  // As sure as before: they share the receiver's error, and do not average.
  EXPECT_EQ(report_at("car-1", 2, 4.0), hazard);
  EXPECT_NEAR(east_m(hazard), 0, 1e-6);
  EXPECT_NEAR(Zone().Find(hazard)->covariance_m2(0, 0), 4.0, 1e-6);
  EXPECT_EQ(report_at("car-1", 2, 1.0), hazard);
  EXPECT_NEAR(east_m(hazard), 2, 1e-6);
  EXPECT_NEAR(Zone().Find(hazard)->covariance_m2(0, 0), 1.0, 1e-6);
  // Surer, but nowhere near what was stated before.
  EXPECT_EQ(report_at("car-1", 6, 0.2), hazard);
  EXPECT_NEAR(east_m(hazard), 2, 1e-6);
  // Another vehicle's joins it; from then on the first one moves it no more.
  EXPECT_EQ(report_at("car-2", 3, 1.0), hazard);
  EXPECT_NEAR(east_m(hazard), 2.5, 1e-6);
  EXPECT_LT(Zone().Find(hazard)->covariance_m2(0, 0), 0.6);
  EXPECT_EQ(report_at("car-1", 2, 0.1), hazard);
  EXPECT_NEAR(east_m(hazard), 2.5, 1e-6);
}

TEST_F(ZoneLifeTest, AVehicleThatIsAlonePullsItsHazardNoFurtherThanItsFirstWordAllows) {
  const Uuid hazard = ReportBy("car-9");
  const geo::GeoPoint first = Zone().Find(hazard)->position;
  for (int i = 0; i < 40; ++i) Pull(hazard, "car-9");
  EXPECT_LE(geo::GeodesicDistanceM(Zone().Find(hazard)->position, first), 10.0);
}

TEST_F(ZoneLifeTest, ASightingBeyondTheVehiclesAllowanceMovesNothing) {
  ZoneService::Config config = Config();
  config.allowance.evidence_per_hour = 1;
  zone_ = std::make_unique<ZoneService>(
      config, [this] { return now_ns_; }, 42);
  const Uuid hazard = ReportBy("car-1");
  Pull(hazard, "car-9");
  // That was all its evidence for an hour.
  const Uuid other = Zone().Handle(MakeReport({40.5, -79.94})).hazard_uuid;
  ExpectUnmovedBy("car-9", other);
}

TEST_F(ZoneLifeTest, ASightingOfAVehicleThatIsNotBelievedMovesNothing) {
  const Uuid hazard = ActiveHazard();
  protocol::Report elsewhere = MakeReport({40.5, -79.94});
  elsewhere.vehicle_id = "car-9";
  Zone().Handle(elsewhere);
  ASSERT_TRUE(Zone().Distrust("car-9", "Anna", "invents"));
  ExpectUnmovedBy("car-9", hazard);
}

TEST_F(ZoneLifeTest, ARejectedHazardIsNotMoved) {
  const Uuid hazard = ActiveHazard();
  ASSERT_TRUE(Zone().Reject(hazard, "Anna", ""));
  ExpectUnmovedBy("car-3", hazard);
  now_ns_ += 2 * kDayNs;
  ExpectUnmovedBy("car-4", hazard);
}

TEST_F(ZoneLifeTest, WhatIsOffTheMapIsListedByItsState) {
  const Uuid rejected = ActiveHazard();
  EXPECT_TRUE(Zone().Reject(rejected, "Anna", ""));
  EXPECT_TRUE(Zone().Query(std::nullopt, 0, 10).empty());
  const auto listed = Zone().Query(std::nullopt, 0, 10, {HazardState::kRejected});
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_EQ(listed.front().uuid, rejected);
  EXPECT_TRUE(Zone().Query(std::nullopt, 0, 10, {HazardState::kGone}).empty());
}

TEST_F(ZoneLifeTest, WordsOfADistrustedVehicleAreWithdrawnWithAnEventEach) {
  const Uuid shared = ActiveHazard();
  protocol::Report alone = MakeReport(geo::GeodesicDestination(kPlace, 0, 500));
  alone.vehicle_id = "car-2";
  alone.stamp_ns = now_ns_ - 1;
  const Uuid invented = Zone().Handle(alone).hazard_uuid;
  const auto events =
      EventsDuring([&] { EXPECT_EQ(Zone().Distrust("car-2", "Anna", "its key was stolen"), 2U); });
  ASSERT_EQ(events.size(), 2U);
  for (const HazardEvent& event : events) {
    EXPECT_EQ(event.reason, "words of car-2 withdrawn by Anna: its key was stolen");
  }
  EXPECT_TRUE(events[0].announced) << "drivers are told that they cannot rely on it any more";
  EXPECT_EQ(State(shared), HazardState::kCandidate);
  EXPECT_EQ(Zone().Find(shared)->vehicles, 1U);
  EXPECT_EQ(State(invented), HazardState::kGone);
  EXPECT_EQ(Zone().Statistics().suspect_vehicles, 1U);

  // It confirms nothing now, also after a restart; others do.
  zone_.reset();
  EXPECT_EQ(Zone().Statistics().suspect_vehicles, 1U);
  ReportBy("car-2");
  EXPECT_EQ(State(shared), HazardState::kCandidate);
  ReportBy("car-3");
  EXPECT_EQ(State(shared), HazardState::kActive);
}

TEST_F(ZoneLifeTest, OnlyAVehicleThatTheZoneHasHeardOfIsDistrusted) {
  ReportBy("car-1");
  EXPECT_FALSE(Zone().Distrust("car-7", "Anna", "who?"));
  EXPECT_FALSE(Zone().Distrust("car\n1", "Anna", "who?"));
  EXPECT_THROW(Zone().Distrust("car-1", "An\nna", "why"), Error);
  Zone().UpdateVehicle({"car-8", "", kPlace, 0.0, 15.0, now_ns_});
  EXPECT_EQ(Zone().Distrust("car-8", "Anna", "it only drives around"), 0U);
  EXPECT_EQ(Zone().Statistics().suspect_vehicles, 1U);
  EXPECT_EQ(Zone().Distrust("car-1", "Anna", ""), 1U);
  EXPECT_EQ(Zone().Distrust("car-1", "Anna", "again"), 0U);
}

TEST_F(ZoneLifeTest, WhatNobodySeesAnyMoreIsVerifiedAndThenGone) {
  const Uuid hazard = ActiveHazard();
  Zone().Advance();
  EXPECT_EQ(State(hazard), HazardState::kActive);
  const auto events = EventsDuring([&] {
    for (int day = 0; day < 60; ++day) {
      now_ns_ += kDayNs / 4;
      Zone().Advance();
    }
  });
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].hazard.state, HazardState::kVerifying);
  EXPECT_FALSE(events[0].announced);
  EXPECT_LT(events[0].hazard.presence, 0.81F);
  EXPECT_EQ(events[1].hazard.state, HazardState::kGone);
  EXPECT_EQ(events[1].action, HazardAction::kRemoved);
  EXPECT_TRUE(events[1].announced);
  EXPECT_THAT(events[1].reason, HasSubstr("not seen"));
  EXPECT_EQ(Zone().Statistics().hazards_by_state[3], 1U);
  // Seen again it is another one.
  EXPECT_NE(ReportBy("car-1"), hazard);
}

TEST_F(ZoneLifeTest, TimeWorksOnAfterARestartAndBeforeAReport) {
  const Uuid hazard = ActiveHazard();
  zone_.reset();
  now_ns_ += 60 * kDayNs;
  // Nobody called Advance: the report itself finds that the old one is gone.
  EXPECT_NE(ReportBy("car-3"), hazard);
  EXPECT_EQ(State(hazard), HazardState::kGone);
}

TEST_F(ZoneLifeTest, VehiclesThatPassAreAskedAndTwoDenialsTakeItOff) {
  const Uuid hazard = ActiveHazard();
  now_ns_ += kDayNs / 2;
  const protocol::Poll first = Asked("car-8");
  EXPECT_EQ(first.hazard, hazard);
  EXPECT_EQ(first.vehicle_id, "car-8");
  EXPECT_EQ(first.class_name, "pothole");
  EXPECT_GT(first.expires_ns, now_ns_);
  DriveBy("car-8", -45, -15);
  EXPECT_TRUE(Zone().HandleAnswer(AnswerTo(first, protocol::PollAnswer::Answer::kNo)));
  EXPECT_TRUE(IsTold(State(hazard)));
  // An answer counts once.
  EXPECT_FALSE(Zone().HandleAnswer(AnswerTo(first, protocol::PollAnswer::Answer::kNo)));
  now_ns_ += 120'000'000'000;
  const protocol::Poll second = Asked("car-9");
  DriveBy("car-9", -45, -15);
  EXPECT_TRUE(Zone().HandleAnswer(AnswerTo(second, protocol::PollAnswer::Answer::kNo)));
  EXPECT_EQ(State(hazard), HazardState::kGone);
  EXPECT_THAT(Zone().Events(hazard, 1).front().reason, HasSubstr("denied"));
  EXPECT_EQ(Zone().Statistics().answers_refused, 1U);
}

TEST_F(ZoneLifeTest, AnswersCountOnlyFromTheVehicleAskedInTimeAndWithinSight) {
  const Uuid hazard = ActiveHazard();
  now_ns_ += kDayNs / 2;
  const protocol::Poll order = Asked("car-8");
  const float before = Zone().Find(hazard)->presence;
  // The place lies 60 m and more ahead of where the zone knows the vehicle.
  protocol::PollAnswer answer = AnswerTo(order, protocol::PollAnswer::Answer::kNo);
  EXPECT_FALSE(Zone().HandleAnswer([&] {
    protocol::PollAnswer other = answer;
    other.vehicle_id = "car-9";
    return other;
  }()));
  EXPECT_FALSE(Zone().HandleAnswer([&] {
    protocol::PollAnswer other = answer;
    other.poll.bytes[3] ^= 1;
    return other;
  }()));
  EXPECT_FALSE(Zone().HandleAnswer([&] {
    protocol::PollAnswer other = answer;
    other.stamp_ns -= 300'000'000'000;
    return other;
  }()));
  EXPECT_FALSE(Zone().HandleAnswer([&] {
    protocol::PollAnswer other = answer;
    other.confidence = std::nanf("");
    return other;
  }()));
  now_ns_ = order.expires_ns + 1;
  EXPECT_FALSE(Zone().HandleAnswer(answer));
  EXPECT_EQ(Zone().Statistics().answers_refused, 5U);
  EXPECT_EQ(Zone().Find(hazard)->presence, before);
  EXPECT_EQ(Zone().Events(hazard, 10).size(), 2U);
}

TEST_F(ZoneLifeTest, AVehicleThatCannotHaveSeenThePlaceDeniesInVain) {
  const Uuid hazard = ActiveHazard();
  now_ns_ += kDayNs / 2;
  const protocol::Poll order = Asked("car-8");
  // It turned away and says so anyway.
  for (int i = 0; i < 12; ++i) {
    now_ns_ += 1'000'000'000;
    const geo::GeoPoint away =
        geo::GeodesicDestination(kPlace, 3.14159265358979323846, 200.0 + 15 * i);
    Zone().UpdateVehicle({"car-8", "", away, 3.14159265358979323846, 15.0, now_ns_});
  }
  EXPECT_FALSE(Zone().HandleAnswer(AnswerTo(order, protocol::PollAnswer::Answer::kNo)));
  EXPECT_EQ(Zone().Events(hazard, 10).size(), 2U);
}

TEST_F(ZoneLifeTest, AYesKeepsItAndBringsItsPicture) {
  const Uuid hazard = ActiveHazard();
  now_ns_ += kDayNs / 2;
  const protocol::Poll order = Asked("car-8");
  DriveBy("car-8", -45, -15);
  protocol::PollAnswer answer = AnswerTo(order, protocol::PollAnswer::Answer::kYes);
  answer.image = MakeJpeg(64, 48, 100, 7);
  const std::uint64_t announced = Zone().AnnouncedSequence();
  EXPECT_TRUE(Zone().HandleAnswer(answer));
  EXPECT_EQ(State(hazard), HazardState::kActive);
  EXPECT_TRUE(Zone().ImagePath(Zone().Find(hazard)->image_sha256));
  // Drivers know already.
  EXPECT_EQ(Zone().AnnouncedSequence(), announced);
}

TEST_F(ZoneLifeTest, AYesCountsWithoutAPictureThatIsLargerThanItsPollAllows) {
  const Uuid hazard = ActiveHazard();
  now_ns_ += kDayNs / 2;
  const protocol::Poll order = Asked("car-8");
  ASSERT_GT(order.max_picture_bytes, 0U);
  DriveBy("car-8", -45, -15);
  protocol::PollAnswer answer = AnswerTo(order, protocol::PollAnswer::Answer::kYes);
  answer.image = MakeJpeg(64, 48, order.max_picture_bytes, 7);
  EXPECT_TRUE(Zone().HandleAnswer(answer));
  EXPECT_EQ(State(hazard), HazardState::kActive);
  EXPECT_EQ(Zone().Find(hazard)->image_sha256, "");
  EXPECT_EQ(Zone().Statistics().image_bytes, 0U);
}

TEST_F(ZoneLifeTest, AYesCountsWithoutAPictureThatNobodyAskedFor) {
  const Uuid hazard = ActiveHazard();
  protocol::Report pictured = MakeReport(kPlace);
  pictured.vehicle_id = "car-3";
  pictured.image = MakeJpeg(64, 48, 100, 1);
  Zone().Handle(pictured);
  const std::string picture = Zone().Find(hazard)->image_sha256;
  ASSERT_NE(picture, "");
  now_ns_ += kDayNs / 2;
  const protocol::Poll order = Asked("car-8");
  ASSERT_EQ(order.max_picture_bytes, 0U);
  DriveBy("car-8", -45, -15);
  protocol::PollAnswer answer = AnswerTo(order, protocol::PollAnswer::Answer::kYes);
  answer.image = MakeJpeg(64, 48, 100, 7);
  EXPECT_TRUE(Zone().HandleAnswer(answer));
  EXPECT_EQ(Zone().Find(hazard)->image_sha256, picture);
}

}  // namespace
}  // namespace livemap::zone
