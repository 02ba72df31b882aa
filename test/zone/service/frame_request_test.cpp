// An official asks for a whole frame of a hazard: who is asked, what becomes of it.
#include "zone/desk/frame_request.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using AnswerKind = protocol::PollAnswer::Answer;

const geo::GeoPoint kFramePlace{40.44, -79.94};
constexpr double kSouthRad = 3.14159265358979323846;

class FrameRequestTest : public ZoneTest {
 protected:
  ZoneService& Zone() {
    if (!zone_) {
      ZoneService::Config config = Config();
      config.frames_per_hour = 3;
      config.polls.frame_bytes = 5000;
      zone_ = std::make_unique<ZoneService>(
          config, [this] { return now_ns_; }, 42);
    }
    return *zone_;
  }
  void Restart() { zone_.reset(); }
  Uuid ReportAt(const geo::GeoPoint& place, const std::string& vehicle = "car-1") {
    protocol::Report report = MakeReport(place);
    report.vehicle_id = vehicle;
    report.stamp_ns = now_ns_ - kOneSecond;
    return Zone().Handle(report).hazard_uuid;
  }
  std::uint64_t Ask(const Uuid& hazard, const std::string& official = "Anna") {
    DeskAction action;
    action.kind = DecisionKind::kAskFrame;
    return Zone().Act(hazard, official, action).value_or(0);
  }
  std::string WhyNot(const Uuid& hazard, const std::string& official = "Anna") {
    try {
      Ask(hazard, official);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  /// Comes from the south, up to so many metres before the place.
  void Approach(const std::string& vehicle, double to_m = 30) {
    for (double metres = to_m + 45; metres >= to_m; metres -= 15) {
      now_ns_ += kOneSecond;
      const geo::GeoPoint at = geo::GeodesicDestination(kFramePlace, kSouthRad, metres);
      Zone().UpdateVehicle({vehicle, "", at, 0.0, 15.0, now_ns_});
    }
  }
  protocol::PollAnswer AnswerTo(const protocol::Poll& poll, AnswerKind said,
                                std::size_t picture_bytes = 1000) {
    protocol::PollAnswer answer;
    answer.poll = poll.poll;
    answer.hazard = poll.hazard;
    answer.vehicle_id = poll.vehicle_id;
    answer.answer = said;
    answer.confidence = 0.9F;
    answer.vehicle_position = geo::GeodesicDestination(kFramePlace, kSouthRad, 30);
    answer.stamp_ns = now_ns_;
    answer.image_format = "jpeg";
    answer.image = MakeJpeg(640, 400, picture_bytes, 7);
    return answer;
  }
  FrameState State(const Uuid& hazard) { return Zone().FrameOf(hazard)->state; }

  std::int64_t now_ns_ = kNowNs;
  std::unique_ptr<ZoneService> zone_;
};

TEST_F(FrameRequestTest, TheNextVehicleIsAskedAndItsFrameStandsInTheHistoryWhateverItAnswers) {
  for (const AnswerKind said : {AnswerKind::kYes, AnswerKind::kNo, AnswerKind::kCantSee}) {
    Restart();
    EmptyStore();
    const Uuid hazard = ReportAt(kFramePlace);
    EXPECT_FALSE(Zone().FrameOf(hazard)) << "nobody has asked";
    const std::uint64_t decision = Ask(hazard);
    EXPECT_NE(decision, 0U);
    EXPECT_EQ(State(hazard), FrameState::kWaiting);
    EXPECT_EQ(Zone().FrameOf(hazard)->request.official, "Anna");
    EXPECT_THAT(Zone().TakeDuePolls(), IsEmpty()) << "no vehicle is there";
    Approach("car-7");
    const auto polls = Zone().TakeDuePolls();
    ASSERT_THAT(polls, SizeIs(1));
    EXPECT_EQ(polls[0].picture, protocol::PollPicture::kFullFrame);
    EXPECT_EQ(polls[0].max_picture_bytes, 5000U);
    EXPECT_TRUE(Zone().HandleAnswer(AnswerTo(polls[0], said)));
    const auto status = Zone().FrameOf(hazard);
    EXPECT_EQ(status->state, FrameState::kTaken);
    ASSERT_TRUE(status->picture);
    EXPECT_EQ(status->picture->answer, said);
    EXPECT_TRUE(Zone().ImagePath(status->picture->image_sha256));
    ASSERT_THAT(Zone().AnswerPictures(hazard, 10), SizeIs(1));
    EXPECT_EQ(Zone().AnswerPictures(hazard, 10)[0].decision, decision);
    EXPECT_EQ(Zone().Find(hazard)->image_sha256, "")
        << "by its own picture one decides at a glance";
    EXPECT_EQ(Zone().DecisionsAbout(hazard, 10).front().kind, DecisionKind::kAskFrame);
    Approach("car-8");
    // After a no the zone asks on, but for no further frame.
    for (const protocol::Poll& poll : Zone().TakeDuePolls()) {
      EXPECT_NE(poll.picture, protocol::PollPicture::kFullFrame) << "it has come";
    }
  }
}

TEST_F(FrameRequestTest, AVehicleThatBringsNoneIsFollowedByTheNextOne) {
  const Uuid hazard = ReportAt(kFramePlace);
  Ask(hazard);
  Approach("car-7");
  auto polls = Zone().TakeDuePolls();
  ASSERT_THAT(polls, SizeIs(1));
  protocol::PollAnswer answer = AnswerTo(polls[0], AnswerKind::kYes);
  answer.image.clear();
  EXPECT_TRUE(Zone().HandleAnswer(answer));
  EXPECT_EQ(State(hazard), FrameState::kWaiting);
  Approach("car-8");
  polls = Zone().TakeDuePolls();
  ASSERT_THAT(polls, SizeIs(1));
  EXPECT_EQ(polls[0].vehicle_id, "car-8");
  EXPECT_TRUE(Zone().HandleAnswer(AnswerTo(polls[0], AnswerKind::kYes, 6000)));
  EXPECT_EQ(State(hazard), FrameState::kWaiting) << "larger than was asked for";
  EXPECT_EQ(Zone().Statistics().image_bytes, 0U);
}

TEST_F(FrameRequestTest, AVehicleThatCannotHaveSeenThePlaceBringsNoFrame) {
  const Uuid hazard = ReportAt(kFramePlace);
  Ask(hazard);
  Approach("car-7");
  const auto polls = Zone().TakeDuePolls();
  ASSERT_THAT(polls, SizeIs(1));
  // It drives away to the south, for longer than the zone remembers where it was.
  for (int i = 0; i < 12; ++i) {
    now_ns_ += kOneSecond;
    const geo::GeoPoint away = geo::GeodesicDestination(kFramePlace, kSouthRad, 200.0 + 15 * i);
    Zone().UpdateVehicle({"car-7", "", away, kSouthRad, 15.0, now_ns_});
  }
  Zone().HandleAnswer(AnswerTo(polls[0], AnswerKind::kCantSee));
  EXPECT_EQ(State(hazard), FrameState::kWaiting);
  EXPECT_THAT(Zone().AnswerPictures(hazard, 10), IsEmpty());
}

TEST_F(FrameRequestTest, ThereIsOneOpenRequestPerHazardAndItRunsOut) {
  const Uuid hazard = ReportAt(kFramePlace);
  Ask(hazard);
  EXPECT_THAT(WhyNot(hazard, "Bert"), HasSubstr("asked for already, by Anna"));
  now_ns_ += 4 * kOneHour + kOneSecond;
  EXPECT_EQ(State(hazard), FrameState::kTimedOut);
  EXPECT_EQ(WhyNot(hazard, "Bert"), "");
  EXPECT_EQ(State(hazard), FrameState::kWaiting);
}

TEST_F(FrameRequestTest, AnOfficialAsksSoOftenInAnHourAndNoMore) {
  for (int i = 0; i < 4; ++i) {
    const Uuid hazard = ReportAt(geo::GeodesicDestination(kFramePlace, 1.57, 100.0 * i));
    if (i < 3) {
      EXPECT_EQ(WhyNot(hazard), "");
    } else {
      EXPECT_THROW(Ask(hazard), DecisionTooOften);
      EXPECT_THAT(WhyNot(hazard), HasSubstr("3 whole frames within an hour"));
      EXPECT_EQ(WhyNot(hazard, "Bert"), "") << "another official may";
      EXPECT_THAT(Zone().Decisions(UINT64_MAX, 10), SizeIs(4)) << "what was refused is no decision";
    }
  }
}

TEST_F(FrameRequestTest, WhatIsTakenBackIsAskedOfNobodyAndWhatHasComeIsNotTakenBack) {
  const Uuid hazard = ReportAt(kFramePlace);
  const std::uint64_t decision = Ask(hazard);
  EXPECT_EQ(Zone().Undo(hazard, "Bert", "", decision), ZoneService::Undone::kDone);
  EXPECT_EQ(State(hazard), FrameState::kCancelled);
  Approach("car-7");
  EXPECT_THAT(Zone().TakeDuePolls(), IsEmpty());
  const std::uint64_t second = Ask(hazard);
  Approach("car-8");
  const auto polls = Zone().TakeDuePolls();
  ASSERT_THAT(polls, SizeIs(1));
  EXPECT_TRUE(Zone().HandleAnswer(AnswerTo(polls[0], AnswerKind::kYes)));
  EXPECT_THROW(Zone().Undo(hazard, "Bert", "", second), DecisionConflict);
  EXPECT_EQ(State(hazard), FrameState::kTaken);
}

TEST_F(FrameRequestTest, OpenRequestsAreAskedForAfterARestartToo) {
  const Uuid hazard = ReportAt(kFramePlace);
  Ask(hazard);
  Restart();
  EXPECT_EQ(State(hazard), FrameState::kWaiting);
  EXPECT_THAT(WhyNot(hazard, "Bert"), HasSubstr("asked for already"));
  Approach("car-7");
  const auto polls = Zone().TakeDuePolls();
  ASSERT_THAT(polls, SizeIs(1));
  EXPECT_TRUE(Zone().HandleAnswer(AnswerTo(polls[0], AnswerKind::kYes)));
  Restart();
  EXPECT_EQ(State(hazard), FrameState::kTaken);
  Approach("car-8");
  EXPECT_THAT(Zone().TakeDuePolls(), IsEmpty()) << "it has come before the restart";
}

TEST_F(FrameRequestTest, WhatCannotBeAskedAboutIsRefusedInASentence) {
  const Uuid hazard = ReportAt(kFramePlace);
  Zone().Reject(hazard, "Anna", "not there");
  EXPECT_THAT(WhyNot(hazard), HasSubstr("not on the map"));
  EXPECT_EQ(Ask(Uuid()), 0U) << "an unknown hazard";
}

TEST_F(FrameRequestTest, BrokenRowsAreLeftOut) {
  SKIP_ON_POSTGRESQL();  // Its columns take values of their type alone.
  const Uuid hazard = ReportAt(kFramePlace);
  Ask(hazard);
  Approach("car-7");
  const auto polls = Zone().TakeDuePolls();
  ASSERT_THAT(polls, SizeIs(1));
  ASSERT_TRUE(Zone().HandleAnswer(AnswerTo(polls[0], AnswerKind::kYes)));
  for (const char* broken :
       {"image_sha256 = '../../etc/passwd'", "image_sha256 = x'00'",
        "image_sha256 = printf('%64s', 'x')", "decision_id = -1", "decision_id = 'x'",
        "decision_id = 9223372036854775807", "poll_uuid = 'x'"}) {
    SqliteDatabase database(DatabasePath(), true);
    database.Execute("SAVEPOINT before");
    database.Execute(std::string("UPDATE answer_pictures SET ") + broken);
    database.Execute("RELEASE before");
    EXPECT_THAT(Zone().AnswerPictures(hazard, 10), IsEmpty()) << broken;
    database.Execute("DELETE FROM answer_pictures");
    database.Execute(
        "INSERT INTO answer_pictures SELECT poll_uuid, hazard_id, printf('%064d', 0), 1 "
        "FROM answers");
    EXPECT_THAT(Zone().AnswerPictures(hazard, 10), SizeIs(1));
  }
  SqliteDatabase(DatabasePath(), true).Execute("UPDATE decisions SET subject = 'x', at_ns = 'y'");
  Restart();
  EXPECT_FALSE(Zone().FrameOf(hazard));
}

}  // namespace
}  // namespace livemap::zone
