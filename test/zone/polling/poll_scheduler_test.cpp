#include "zone/polling/poll_scheduler.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <random>

#include "common/error.h"
#include "common/time.h"
#include "test/zone/test_times.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const geo::GeoPoint kPlace{40.44, -79.95};

class PollSchedulerTest : public ::testing::Test {
 protected:
  PollSchedulerTest() { Rebuild(); }

  void Rebuild() { scheduler_ = std::make_unique<PollScheduler>(config_, 1); }

  /// A hazard that two vehicles have just seen.
  PresenceRecord Active(double life_s, std::int64_t now_ns) {
    entry_.survival = {5, 4 * life_s};
    PresenceRecord life;
    rules_.Begin(entry_, {EvidenceKind::kSighting, 1, now_ns}, now_ns, life);
    rules_.Apply(entry_, {EvidenceKind::kSighting, 2, now_ns}, now_ns, life);
    EXPECT_EQ(life.state, HazardState::kActive);
    return life;
  }
  void Set(std::uint64_t id, const PresenceRecord& life, std::int64_t now_ns,
           const geo::GeoPoint& place = kPlace) {
    scheduler_->SetHazard(id, place, entry_, life, now_ns, now_ns);
  }
  /// 100 m south of the place, towards it.
  void Approach(const std::string& vehicle, std::int64_t now_ns, double course_rad = 0,
                double speed_mps = 12) {
    scheduler_->SetVehicle(vehicle, {now_ns, geo::GeodesicDestination(kPlace, 3.14159265, 100),
                                     course_rad, speed_mps});
  }
  std::vector<std::string> Asked(std::int64_t now_ns) {
    std::vector<std::string> vehicles;
    for (const auto& choice : scheduler_->TakeDue(now_ns)) {
      vehicles.push_back(choice.vehicle_id);
      newest_ = choice.poll;
    }
    return vehicles;
  }
  /// When a hazard of this life, seen at kStart, is first asked about by one of many vehicles.
  double SecondsToFirstPoll(double life_s) {
    Rebuild();
    Set(1, Active(life_s, kStart), kStart);
    for (std::int64_t t = kStart; t < kStart + 10000 * kHour; t += 10 * kSecond) {
      Approach("v", t);
      if (!Asked(t).empty()) return Seconds(t - kStart);
    }
    return -1;
  }

  PollScheduler::Config config_;
  HazardLifecycle rules_;
  ClassModel entry_;
  std::unique_ptr<PollScheduler> scheduler_;
  Uuid newest_;  ///< The poll that Asked saw last.
};

TEST_F(PollSchedulerTest, DoesNotAskAboutWhatWasJustSeen) {
  Set(1, Active(5400, kStart), kStart);
  Approach("v", kStart + 5 * kSecond);
  EXPECT_TRUE(Asked(kStart + 5 * kSecond).empty());
}

TEST_F(PollSchedulerTest, AsksAVehicleThatWillPassOnceTheHazardIsDue) {
  Set(1, Active(5400, kStart), kStart);
  const std::int64_t later = kStart + 2 * kHour;
  EXPECT_TRUE(Asked(later).empty()) << "nobody is near";
  Approach("v", later);
  const auto choices = scheduler_->TakeDue(later);
  ASSERT_EQ(choices.size(), 1u);
  EXPECT_EQ(choices[0].hazard, 1u);
  EXPECT_EQ(choices[0].vehicle_id, "v");
  EXPECT_EQ(choices[0].expires_ns, later + Nanoseconds(config_.answer_timeout_s));
}

TEST_F(PollSchedulerTest, AsksNobodyWhoDrivesAwayStandsAsideOrIsSilent) {
  Set(1, Active(5400, kStart), kStart);
  const std::int64_t later = kStart + 2 * kHour;
  Approach("away", later, 3.14);
  Approach("across", later, 1.57);
  Approach("unknown course", later, std::nan(""));
  Approach("standing far", later, 0, 0);
  Approach("silent", later - 60 * kSecond);
  EXPECT_TRUE(Asked(later).empty());
}

TEST_F(PollSchedulerTest, AHazardThatFallsDueFindsTheVehicleThatIsThereAlready) {
  Set(1, Active(5400, kStart), kStart);
  std::vector<std::string> asked;
  // The vehicle waits at a light, 40 m ahead of the place, and is heard again and again.
  for (std::int64_t t = kStart; t < kStart + 2 * kHour && asked.empty(); t += 10 * kSecond) {
    scheduler_->SetVehicle("v", {t, geo::GeodesicDestination(kPlace, 3.14159265, 40), 0, 0});
    asked = Asked(t);
  }
  EXPECT_THAT(asked, ::testing::ElementsAre("v"));
}

TEST_F(PollSchedulerTest, AVehicleThatStandsIsAskedTheRestWhenItHasAnswered) {
  config_.max_open_per_vehicle = 1;
  Rebuild();
  const PresenceRecord life = Active(5400, kStart);
  Set(1, life, kStart);
  Set(2, life, kStart, geo::GeodesicDestination(kPlace, 0, 5));
  std::vector<std::uint64_t> asked;
  std::int64_t now_ns = kStart + 2 * kHour;
  for (int second = 0; second < 12; ++second, now_ns += kSecond) {
    scheduler_->SetVehicle("v", {now_ns, geo::GeodesicDestination(kPlace, 3.14159265, 40), 0, 0});
    for (const auto& choice : scheduler_->TakeDue(now_ns)) {
      asked.push_back(choice.hazard);
      EXPECT_TRUE(scheduler_->Answered(choice.poll, 600, now_ns));
    }
  }
  EXPECT_THAT(asked, ::testing::UnorderedElementsAre(1, 2));
}

TEST_F(PollSchedulerTest, WhatATurnBringsBeforeAVehicleIsAskedAtOnce) {
  Set(1, Active(5400, kStart), kStart);
  const std::int64_t later = kStart + 2 * kHour;
  Approach("v", later, 1.57);
  ASSERT_TRUE(Asked(later).empty());
  Approach("v", later + kSecond, 0);
  EXPECT_THAT(Asked(later + kSecond), ::testing::ElementsAre("v"));
}

TEST_F(PollSchedulerTest, AllOfManyThatFallDueTogetherAreAskedInTheEnd) {
  config_.bytes_per_hour = 1e9;
  config_.max_open_per_vehicle = 1000;
  Rebuild();
  const PresenceRecord life = Active(5400, kStart);
  // Far more than one tick takes, and one of them before a vehicle.
  for (std::uint64_t i = 0; i < 50000; ++i) {
    Set(i, life, kStart, {10 + static_cast<double>(i) * 1e-3, 20});
  }
  Set(50000, life, kStart);
  std::vector<std::string> asked;
  std::int64_t now_ns = kStart + 2 * kHour;
  for (int second = 0; second < 10 && asked.empty(); ++second, now_ns += kSecond) {
    Approach("v", now_ns);
    asked = Asked(now_ns);
  }
  EXPECT_THAT(asked, ::testing::ElementsAre("v"));
}

TEST_F(PollSchedulerTest, ShortLivesAreAskedSoonerByTheRootOfTheirRate) {
  const double hours = SecondsToFirstPoll(2 * 3600);
  const double days = SecondsToFirstPoll(32 * 3600);
  EXPECT_GT(hours, 0);
  // Sixteen times the life, four times the wait; less, because the map is never quite sure.
  EXPECT_GT(days, 1.5 * hours);
  EXPECT_LT(days, 4.5 * hours);
}

TEST_F(PollSchedulerTest, ANoIsFollowedByTheNextVehicleAtOnceAndAYesIsNot) {
  for (const bool yes : {false, true}) {
    Rebuild();
    PresenceRecord life = Active(5400, kStart);
    Set(1, life, kStart);
    const std::int64_t later = kStart + 2 * kHour / 3;
    Approach("a", later);
    ASSERT_EQ(Asked(later).size(), 1u);
    const std::int64_t answered = later + 10 * kSecond;
    rules_.Apply(
        entry_,
        {yes ? EvidenceKind::kAnswerYes : EvidenceKind::kAnswerNo, VehicleKey("a"), answered},
        answered, life);
    EXPECT_TRUE(scheduler_->Answered(newest_, 500, answered));
    Set(1, life, answered);
    Approach("b", answered + kSecond);
    EXPECT_EQ(Asked(answered + kSecond).size(), yes ? 0u : 1u);
  }
}

TEST_F(PollSchedulerTest, AVehicleThatCannotSeeLeavesTheQuestionToTheNext) {
  Set(1, Active(5400, kStart), kStart);
  const std::int64_t later = kStart + 2 * kHour;
  Approach("a", later);
  ASSERT_EQ(Asked(later).size(), 1u);
  Approach("b", later + kSecond);
  EXPECT_TRUE(Asked(later + kSecond).empty()) << "one poll is open";
  EXPECT_TRUE(scheduler_->Answered(newest_, 500, later + 2 * kSecond));
  EXPECT_THAT(Asked(later + 2 * kSecond), ::testing::ElementsAre("b"));
}

TEST_F(PollSchedulerTest, AnAnswerLargerThanItsPollAllowsTakesNoMoreThanTheEstimate) {
  Set(1, Active(5400, kStart), kStart);
  const std::int64_t later = kStart + 2 * kHour;
  Approach("a", later);
  ASSERT_EQ(Asked(later).size(), 1u);
  const double estimate = scheduler_->bytes();
  EXPECT_TRUE(scheduler_->Answered(newest_, 1e12, later + kSecond));
  EXPECT_EQ(scheduler_->bytes(), estimate);
  Approach("b", later + kSecond);
  EXPECT_THAT(Asked(later + kSecond), ::testing::ElementsAre("b")) << "the budget is not spent";
}

TEST_F(PollSchedulerTest, APollThatNobodyAnswersExpiresAndTheNextVehicleIsAsked) {
  Set(1, Active(5400, kStart), kStart);
  const std::int64_t later = kStart + 2 * kHour;
  Approach("a", later);
  ASSERT_EQ(Asked(later).size(), 1u);
  const std::int64_t expired = later + Nanoseconds(config_.answer_timeout_s);
  Approach("a", expired);
  EXPECT_TRUE(Asked(expired).empty()) << "the same vehicle is not asked again";
  const Uuid unanswered = newest_;
  EXPECT_TRUE(scheduler_->FindOpen(unanswered, expired)) << "an answer counts up to its expiry";
  EXPECT_FALSE(scheduler_->FindOpen(unanswered, expired + 1));
  Approach("b", expired + kSecond);
  EXPECT_THAT(Asked(expired + kSecond), ::testing::ElementsAre("b"));
  EXPECT_FALSE(scheduler_->Answered(unanswered, 500, expired + kSecond)) << "too late";
}

TEST_F(PollSchedulerTest, NeverTwoOpenPollsToOneVehicleForOneHazardAndEachVehicleOnce) {
  config_.max_open_per_hazard = 3;
  Rebuild();
  Set(1, Active(5400, kStart), kStart);
  std::map<std::string, int> asked;
  std::vector<std::int64_t> asked_at;
  for (std::int64_t t = kStart + 2 * kHour; t < kStart + 3 * kHour; t += 7 * kSecond) {
    for (const char* vehicle : {"a", "b", "c", "d", "e"}) Approach(vehicle, t);
    for (const auto& vehicle : Asked(t)) {
      ++asked[vehicle];
      asked_at.push_back(t);
    }
    const std::int64_t open_since = t - Nanoseconds(config_.answer_timeout_s);
    EXPECT_LE(std::count_if(asked_at.begin(), asked_at.end(),
                            [&](std::int64_t at) { return at >= open_since; }),
              3);
  }
  EXPECT_EQ(asked.size(), 5u);
  for (const auto& [vehicle, count] : asked) EXPECT_EQ(count, 1) << vehicle;
}

TEST_F(PollSchedulerTest, TheReporterOfACandidateIsNotAskedAboutItButOthersAre) {
  entry_.survival = {5, 4 * 86400.0};
  PresenceRecord life;
  rules_.Begin(entry_, {EvidenceKind::kSighting, VehicleKey("a"), kStart}, kStart, life);
  ASSERT_EQ(life.state, HazardState::kCandidate);
  Set(1, life, kStart);
  const std::int64_t later = kStart + kHour;
  Approach("a", later);
  EXPECT_TRUE(Asked(later).empty());
  Approach("b", later);
  EXPECT_THAT(Asked(later), ::testing::ElementsAre("b"));
}

TEST_F(PollSchedulerTest, WhatIsGoneIsNotAskedAbout) {
  PresenceRecord life = Active(5400, kStart);
  Set(1, life, kStart);
  life.state = HazardState::kGone;
  Set(1, life, kStart + kSecond);
  EXPECT_EQ(scheduler_->hazards(), 0u);
  Approach("v", kStart + 2 * kHour);
  EXPECT_TRUE(Asked(kStart + 2 * kHour).empty());
}

TEST_F(PollSchedulerTest, AHazardThatMovedIsAskedAboutAtItsNewPlace) {
  const PresenceRecord life = Active(5400, kStart);
  Set(1, life, kStart);
  const std::int64_t later = kStart + 2 * kHour;
  EXPECT_TRUE(Asked(later).empty());
  Set(1, life, later, geo::GeodesicDestination(kPlace, 0, 2000));
  EXPECT_TRUE(Asked(later).empty());
  Approach("v", later);
  EXPECT_TRUE(Asked(later).empty());
}

TEST_F(PollSchedulerTest, AsksForAPictureWhenTheOneItHasIsOld) {
  const PresenceRecord life = Active(5400, kStart);
  const std::int64_t later = kStart + 2 * kHour;
  for (const bool old : {false, true}) {
    Rebuild();
    scheduler_->SetHazard(1, kPlace, entry_, life, old ? 0 : kStart, kStart);
    Approach("v", later);
    const auto choices = scheduler_->TakeDue(later);
    ASSERT_EQ(choices.size(), 1u);
    EXPECT_EQ(choices[0].picture_wanted, old);
  }
}

TEST_F(PollSchedulerTest, KeepsItsByteBudget) {
  config_.bytes_per_hour = 6000;
  Rebuild();
  const PresenceRecord life = Active(300, kStart);
  for (std::uint64_t id = 0; id < 40; ++id) Set(id, life, kStart);
  for (std::int64_t t = kStart; t < kStart + 10 * kHour; t += 5 * kSecond) {
    for (int v = 0; v < 3; ++v) {
      Approach("v" + std::to_string((t / kSecond) * 3 + v), t);
    }
    scheduler_->TakeDue(t);
  }
  EXPECT_LE(scheduler_->bytes(), 11 * 6000.0);
  EXPECT_GE(scheduler_->bytes(), 3 * 6000.0);
}

TEST_F(PollSchedulerTest, AFullHeapOfVehiclesForgetsTheLongestSilent) {
  config_.max_vehicles = 2;
  config_.vehicle_silence_s = 1000;
  Rebuild();
  Set(1, Active(5400, kStart), kStart);
  const std::int64_t later = kStart + 2 * kHour;
  Approach("old", later);
  Approach("b", later + kSecond, 3.14);
  Approach("c", later + 2 * kSecond, 3.14);
  EXPECT_TRUE(Asked(later + 3 * kSecond).empty());
}

TEST_F(PollSchedulerTest, HazardsThatAreNotDueAreMetByNoVehicle) {
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> offset(-0.2, 0.2);
  const PresenceRecord life = Active(5184000, kStart);
  for (std::uint64_t id = 0; id < 30000; ++id) {
    Set(id, life, kStart,
        {kPlace.latitude_deg + offset(generator), kPlace.longitude_deg + offset(generator)});
  }
  for (int v = 0; v < 1000; ++v) Approach("v" + std::to_string(v), kStart + kSecond);
  EXPECT_TRUE(Asked(kStart + kSecond).empty());
  EXPECT_EQ(scheduler_->hazards(), 30000u);
}

TEST(PollSchedulerConfig, RefusesWhatIsOutOfRangeAndNamesIt) {
  PollScheduler::Config config;
  config.price_s = 0;
  EXPECT_THAT([&] { PollScheduler(config, 1); }, ThrowsMessage<Error>(HasSubstr("price_s")));
  config = {};
  config.lookahead_m = std::nan("");
  EXPECT_THAT([&] { PollScheduler(config, 1); }, ThrowsMessage<Error>(HasSubstr("lookahead_m")));
}

TEST_F(PollSchedulerTest, AFrameIsAskedForAtOnceAndFromOneVehicleAfterTheOther) {
  Set(1, Active(5400, kStart), kStart);
  Approach("first", kStart + kSecond);
  ASSERT_TRUE(Asked(kStart + kSecond).empty()) << "it was just seen";
  scheduler_->AskForFrame(1, kStart + kHour, kStart + kSecond);
  auto choices = scheduler_->TakeDue(kStart + kSecond);
  ASSERT_EQ(choices.size(), 1u) << "the vehicle that is there already";
  EXPECT_EQ(choices[0].vehicle_id, "first");
  EXPECT_TRUE(choices[0].frame_wanted);
  EXPECT_FALSE(choices[0].picture_wanted);
  EXPECT_TRUE(scheduler_->FindOpen(choices[0].poll, kStart + kSecond)->frame_wanted);
  Approach("second", kStart + 2 * kSecond);
  EXPECT_TRUE(Asked(kStart + 2 * kSecond).empty()) << "one at a time";
  // It brought none: the next one is asked, and the same one not before a while.
  EXPECT_TRUE(scheduler_->Answered(choices[0].poll, 600, kStart + 3 * kSecond));
  Approach("first", kStart + 3 * kSecond);
  choices = scheduler_->TakeDue(kStart + 3 * kSecond);
  ASSERT_EQ(choices.size(), 1u);
  EXPECT_EQ(choices[0].vehicle_id, "second");
  EXPECT_TRUE(scheduler_->Answered(choices[0].poll, 600, kStart + 4 * kSecond));
  const std::int64_t later = kStart + Nanoseconds(PollScheduler::kFrameAgainS) + 2 * kSecond;
  Approach("first", later);
  EXPECT_THAT(Asked(later), ::testing::ElementsAre("first"));
}

TEST_F(PollSchedulerTest, NobodyIsAskedForAFrameThatHasComeOrWhoseTimeIsOver) {
  Set(1, Active(5400, kStart), kStart);
  scheduler_->AskForFrame(1, kStart + kHour, kStart);
  scheduler_->ForgetFrame(1);
  Approach("v", kStart + kSecond);
  EXPECT_TRUE(Asked(kStart + kSecond).empty());
  scheduler_->AskForFrame(1, kStart + 5 * kSecond, kStart + kSecond);
  Approach("w", kStart + 6 * kSecond);
  EXPECT_TRUE(Asked(kStart + 6 * kSecond).empty());
}

TEST_F(PollSchedulerTest, AFrameIsStillWantedAfterItsHazardHasChangedOrWasOffTheMap) {
  const PresenceRecord life = Active(5400, kStart);
  Set(1, life, kStart);
  scheduler_->AskForFrame(1, kStart + kHour, kStart);
  scheduler_->RemoveHazard(1);
  Approach("v", kStart + kSecond);
  EXPECT_TRUE(Asked(kStart + kSecond).empty());
  Set(1, life, kStart + 2 * kSecond);
  Approach("v", kStart + 2 * kSecond);
  EXPECT_THAT(Asked(kStart + 2 * kSecond), ::testing::ElementsAre("v"));
}

TEST_F(PollSchedulerTest, FramesKeepToTheByteBudgetToo) {
  config_.bytes_per_hour = 150000;
  config_.frame_bytes = 100000;
  Rebuild();
  EXPECT_TRUE(scheduler_->AsksForFrames());
  const PresenceRecord life = Active(5400, kStart);
  for (std::uint64_t id = 1; id <= 3; ++id) {
    Set(id, life, kStart);
    scheduler_->AskForFrame(id, kStart + 10 * kHour, kStart);
  }
  Approach("v", kStart);
  EXPECT_EQ(scheduler_->TakeDue(kStart).size(), 1u) << "bytes for one are left";
  EXPECT_NEAR(scheduler_->bytes(), config_.poll_bytes + config_.frame_bytes, 1);
  config_.bytes_per_hour = 50000;
  Rebuild();
  EXPECT_FALSE(scheduler_->AsksForFrames()) << "there are never so many bytes";
  Set(1, life, kStart);
  scheduler_->AskForFrame(1, kStart + kHour, kStart);
  Approach("v", kStart);
  EXPECT_TRUE(Asked(kStart).empty());
}

}  // namespace
}  // namespace livemap::zone
