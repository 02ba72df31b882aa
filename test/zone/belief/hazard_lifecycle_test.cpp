#include "zone/belief/hazard_lifecycle.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "test/zone/belief/hazard_lifecycle_fixture.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;

TEST_F(HazardLifeTest, TheFirstReportMakesACandidate) {
  const LifecycleUpdate step = Begin(1);
  ASSERT_TRUE(step.transition);
  EXPECT_FALSE(step.transition->from);
  EXPECT_EQ(step.transition->to, HazardState::kCandidate);
  EXPECT_EQ(life_.state, HazardState::kCandidate);
  EXPECT_GT(Presence(kStart), 0.5);
  EXPECT_LT(Presence(kStart), 0.9);
}

TEST_F(HazardLifeTest, DriversAreToldWhenASecondVehicleSeesIt) {
  Begin(1);
  const LifecycleUpdate step = See(2, kStart + kHour);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->from, HazardState::kCandidate);
  EXPECT_EQ(step.transition->to, HazardState::kActive);
  EXPECT_EQ(step.transition->reason, "seen by 2 vehicles");
  EXPECT_EQ(Supporters(life_), 2u);
}

TEST_F(HazardLifeTest, OneVehicleSufficesWhereTheClassSaysSo) {
  cone_.confirmations = 1;
  const LifecycleUpdate step = Begin(1);
  ASSERT_TRUE(step.transition);
  EXPECT_FALSE(step.transition->from);
  EXPECT_EQ(step.transition->to, HazardState::kActive);
}

TEST_F(HazardLifeTest, AnOfficialSuffices) {
  Begin(1);
  const LifecycleUpdate step = rules_.Confirm(cone_, "Ada", "", kStart + kSecond, life_);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->to, HazardState::kActive);
  EXPECT_EQ(step.transition->reason, "confirmed by Ada");
  const LifecycleUpdate again =
      rules_.Confirm(cone_, "Bob", "still there", kStart + kSecond, life_);
  ASSERT_TRUE(again.transition);
  EXPECT_EQ(again.transition->from, HazardState::kActive);
  EXPECT_EQ(again.transition->to, HazardState::kActive);
  EXPECT_EQ(again.transition->reason, "confirmed by Bob: still there");
}

TEST_F(HazardLifeTest, WhatIsSaidToBeRepairedIsVerifiedAndGoesWhenTwoVehiclesDenyIt) {
  Begin(1);
  EXPECT_FALSE(rules_.Doubt(cone_, "closed", kStart, life_).transition) << "nobody is told of it";
  rules_.Confirm(cone_, "Ada", "", kStart + kSecond, life_);
  const LifecycleUpdate step = rules_.Doubt(cone_, "closed", kStart + 2 * kSecond, life_);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->from, HazardState::kActive);
  EXPECT_EQ(step.transition->to, HazardState::kVerifying);
  EXPECT_EQ(step.transition->reason, "closed");
  EXPECT_NEAR(Presence(kStart + 2 * kSecond), 0.5, 1e-6);
  const PresenceRecord doubted = life_;
  Say(EvidenceKind::kAnswerNo, 2, kStart + 60 * kSecond);
  EXPECT_EQ(life_.state, HazardState::kVerifying);
  Say(EvidenceKind::kAnswerNo, 3, kStart + 90 * kSecond);
  EXPECT_EQ(life_.state, HazardState::kGone);
  life_ = doubted;
  See(2, kStart + 60 * kSecond);
  EXPECT_EQ(life_.state, HazardState::kActive) << "it is still there";
}

TEST_F(HazardLifeTest, OneVehicleCannotConfirmHoweverMuchItSays) {
  Begin(1);
  std::mt19937_64 generator(5);
  for (int i = 1; i < 5000; ++i) {
    const auto kind = i % 3 == 0 ? EvidenceKind::kAnswerYes
                                 : (i % 7 == 0 ? EvidenceKind::kAnswerNo : EvidenceKind::kSighting);
    Say(kind, 1, kStart + i * static_cast<std::int64_t>(generator() % 100) * kSecond / 100);
    ASSERT_EQ(life_.state, HazardState::kCandidate) << i;
  }
  EXPECT_EQ(Supporters(life_) + Opponents(life_), 1u);
}

TEST_F(HazardLifeTest, OneVehicleCannotRemoveHoweverMuchItSays) {
  MakeActive();
  PresenceRecord left_alone = life_;
  std::mt19937_64 generator(6);
  std::int64_t now_ns = kStart + kSecond;
  while (left_alone.state != HazardState::kGone) {
    now_ns += static_cast<std::int64_t>(generator() % 1800) * kSecond;
    Deny(9, now_ns);
    rules_.Advance(cone_, now_ns, left_alone);
    if (left_alone.state == HazardState::kGone) break;
    ASSERT_TRUE(IsTold(life_.state)) << "not before time alone would have removed it";
  }
}

TEST_F(HazardLifeTest, OneVehicleMovesTheOddsByABoundedAmountInWhateverOrderItSpeaks) {
  MakeActive();
  const double bound = std::log(0.95 / 0.05) + 1e-3;
  std::mt19937_64 generator(7);
  const double before = life_.log_odds;
  for (int i = 0; i < 2000; ++i) {
    Say(generator() % 2 == 0 ? EvidenceKind::kAnswerNo : EvidenceKind::kAnswerYes, 9,
        kStart + kSecond + i);
    Say(generator() % 2 == 0 ? EvidenceKind::kAnswerNo : EvidenceKind::kSighting, 9,
        kStart + 2 * kSecond + i * kSecond / 1000);
    ASSERT_GT(life_.log_odds, before - bound - 0.01);
  }
}

TEST_F(HazardLifeTest, ARepeatedMessageCountsNothing) {
  MakeActive();
  EXPECT_TRUE(Deny(9, kStart + kHour).counted);
  const double before = life_.log_odds;
  EXPECT_FALSE(Deny(9, kStart + kHour).counted);
  EXPECT_EQ(life_.log_odds, before);
}

TEST_F(HazardLifeTest, FurtherWordsOfOneVehicleAddLessAndLess) {
  MakeActive();
  double gain = 100;
  for (int i = 1; i < 4; ++i) {
    const double before = life_.log_odds;
    Deny(9, kStart + i * kSecond + kHour);
    const double step = before - life_.log_odds;
    EXPECT_GT(step, 0);
    EXPECT_LT(step, gain);
    gain = step;
  }
}

TEST_F(HazardLifeTest, SeveralVehiclesThatDenyItRemoveItWithTheReason) {
  MakeActive();
  LifecycleUpdate step = Deny(3, kStart + kHour);
  EXPECT_TRUE(IsTold(life_.state));
  std::uint64_t vehicle = 4;
  while (IsTold(life_.state) && vehicle < 9) {
    step = Deny(vehicle, kStart + kHour + static_cast<std::int64_t>(vehicle) * kSecond);
    ++vehicle;
  }
  EXPECT_EQ(life_.state, HazardState::kGone);
  ASSERT_TRUE(step.transition);
  EXPECT_THAT(step.transition->reason, HasSubstr("denied by"));
  EXPECT_LE(vehicle, 7u) << "four vehicles are enough";
}

TEST_F(HazardLifeTest, ADisputedCandidateNeedsOneSupporterMorePerOpponent) {
  Begin(1);
  Deny(2, kStart + kSecond);
  See(3, kStart + 2 * kSecond);
  EXPECT_EQ(life_.state, HazardState::kCandidate);
  See(4, kStart + 3 * kSecond);
  EXPECT_EQ(life_.state, HazardState::kActive);
}

TEST_F(HazardLifeTest, ADenialStartsTheVerificationAndASightingEndsIt) {
  MakeActive();
  Deny(3, kStart + kHour);
  Deny(4, kStart + kHour + kSecond);
  EXPECT_EQ(life_.state, HazardState::kVerifying);
  See(5, kStart + kHour + 2 * kSecond);
  const LifecycleUpdate step = See(6, kStart + kHour + 3 * kSecond);
  EXPECT_EQ(life_.state, HazardState::kActive);
  EXPECT_EQ(Opponents(life_), 0u) << "two vehicles have answered the denials";
  ASSERT_TRUE(step.transition || life_.state == HazardState::kActive);
}

TEST_F(HazardLifeTest, CantSeeCountsNothing) {
  MakeActive();
  const std::string before = PackPresence(life_);
  EXPECT_FALSE(Say(EvidenceKind::kCantSee, 3, kStart + kHour).counted);
  EXPECT_EQ(PackPresence(life_), before);
}

TEST_F(HazardLifeTest, TimeAloneTakesItThroughVerifyingToGoneWhenSaid) {
  MakeActive();
  std::vector<HazardState> states;
  for (int i = 0; i < 10 && life_.state != HazardState::kGone; ++i) {
    const std::int64_t change_ns = rules_.NextChangeNs(cone_, life_);
    PresenceRecord earlier = life_;
    const std::int64_t shortly_before = change_ns - (change_ns - life_.at_ns) / 100 - kSecond;
    EXPECT_FALSE(rules_.Advance(cone_, shortly_before, earlier).transition);
    const LifecycleUpdate step = rules_.Advance(cone_, change_ns, life_);
    ASSERT_TRUE(step.transition);
    states.push_back(step.transition->to);
  }
  EXPECT_THAT(states, ::testing::ElementsAre(HazardState::kVerifying, HazardState::kGone));
  EXPECT_EQ(rules_.NextChangeNs(cone_, life_), kNever);
}

TEST_F(HazardLifeTest, NextChangeIsKeptWithoutEmptyRoundsForEveryLength) {
  for (const double life_s : {60.0, 300.0, 86400.0, 5184000.0, 1e9}) {
    cone_.survival = {5, 4 * life_s};
    MakeActive();
    int rounds = 0;
    while (life_.state != HazardState::kGone && rounds < 100) {
      rules_.Advance(cone_, rules_.NextChangeNs(cone_, life_), life_);
      ++rounds;
    }
    EXPECT_LE(rounds, 5) << life_s;
  }
}

TEST_F(HazardLifeTest, ACandidateThatNobodyElseSeesGoesByTime) {
  Begin(1);
  const LifecycleUpdate step = rules_.Advance(cone_, rules_.NextChangeNs(cone_, life_), life_);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->to, HazardState::kGone);
  EXPECT_FALSE(step.lesson.ended) << "nobody knows that it was ever there";
}

TEST_F(HazardLifeTest, PresenceFallsByTheClassesSurvival) {
  MakeActive();
  const double before = Presence(life_.at_ns);
  const double age_s = 1e-9 * static_cast<double>(life_.at_ns - life_.first_seen_ns);
  EXPECT_NEAR(Presence(life_.at_ns + kDay), before * cone_.survival.Survival(age_s, 86400), 1e-9);
}

TEST_F(HazardLifeTest, AdvancingOftenGivesWhatAdvancingOnceGives) {
  MakeActive();
  PresenceRecord once = life_;
  const std::int64_t end_ns = kStart + 6 * kHour;
  for (std::int64_t t = kStart + kHour; t <= end_ns; t += kSecond * 7) {
    rules_.Advance(cone_, t, life_);
  }
  rules_.Advance(cone_, end_ns, life_);
  rules_.Advance(cone_, end_ns, once);
  EXPECT_NEAR(life_.log_odds, once.log_odds, 1e-6);
}

TEST_F(HazardLifeTest, TheOrderInWhichVehiclesWordsArriveDoesNotMatter) {
  // One moment, distinct vehicles, odds short of their bounds.
  HazardLifecycle::Config config;
  config.max_presence = 0.9999;
  config.gone_below = 0.01;
  config.denying_vehicles = 5;
  const HazardLifecycle rules(config);
  const std::vector<Evidence> words = {
      Word(EvidenceKind::kAnswerNo, 3, kStart), Word(EvidenceKind::kSighting, 4, kStart),
      Word(EvidenceKind::kSighting, 5, kStart), Word(EvidenceKind::kAnswerYes, 6, kStart),
      Word(EvidenceKind::kAnswerNo, 7, kStart)};
  std::vector<std::size_t> order = {0, 1, 2, 3, 4};
  std::optional<double> expected;
  int orders = 0;
  do {
    PresenceRecord life;
    rules.Begin(cone_, Word(EvidenceKind::kSighting, 1, kStart), kStart, life);
    for (const std::size_t i : order) rules.Apply(cone_, words[i], kStart, life);
    ASSERT_NE(life.state, HazardState::kGone);
    ++orders;
    if (!expected) expected = life.log_odds;
    EXPECT_NEAR(life.log_odds, *expected, 0.01);
  } while (std::next_permutation(order.begin(), order.end()));
  EXPECT_EQ(orders, 120);
}

TEST_F(HazardLifeTest, ALateWordCountsLessThanAFreshOne) {
  MakeActive();
  PresenceRecord late = life_;
  const std::int64_t now_ns = kStart + kDay;
  rules_.Apply(cone_, Word(EvidenceKind::kAnswerNo, 9, now_ns), now_ns, life_);
  rules_.Advance(cone_, now_ns, late);
  const double before = late.log_odds;
  rules_.Apply(cone_, Word(EvidenceKind::kSighting, 9, kStart - kDay), now_ns, late);
  EXPECT_GT(late.log_odds, before);
  EXPECT_LT(late.log_odds, before + 2.2);
}

TEST_F(HazardLifeTest, AWordSoLateThatItSaysNothingNeitherSupportsNorMakesTheHazardOlder) {
  Begin(1);
  for (const std::uint64_t vehicle : {2UL, 3UL}) {
    const LifecycleUpdate step = rules_.Apply(
        cone_, Word(EvidenceKind::kSighting, vehicle, kStart - 29 * kDay), kStart, life_);
    EXPECT_FALSE(step.counted);
    EXPECT_FALSE(step.transition);
  }
  EXPECT_EQ(life_.state, HazardState::kCandidate);
  EXPECT_EQ(Supporters(life_), 1U);
  EXPECT_EQ(life_.first_seen_ns, kStart);
  EXPECT_EQ(See(4, kStart + kSecond).lesson.stood_s, 1);
}

TEST_F(HazardLifeTest, OneHazardTeachesOfNoMoreThanTenLives) {
  Begin(1);
  std::int64_t now_ns = kStart;
  while (now_ns < kStart + 60 * kDay) See(1, now_ns += kDay / 2);
  ASSERT_EQ(life_.state, HazardState::kCandidate);
  const LifecycleUpdate step = See(2, now_ns);
  ASSERT_EQ(life_.state, HazardState::kActive);
  EXPECT_DOUBLE_EQ(step.lesson.stood_s, 10 * cone_.survival.MeanLifeS());
}

TEST_F(HazardLifeTest, AnOlderMessageDoesNotTurnTheNewerWordOfItsVehicle) {
  MakeActive();
  Deny(9, kStart + kHour);
  rules_.Apply(cone_, Word(EvidenceKind::kAnswerYes, 9, kStart + kHour / 2), kStart + 2 * kHour,
               life_);
  EXPECT_EQ(Opponents(life_), 1u);
}

TEST_F(HazardLifeTest, FutureStampsCountAsNow) {
  Begin(1);
  rules_.Apply(cone_, Word(EvidenceKind::kSighting, 2, kStart + 300 * kDay), kStart, life_);
  EXPECT_EQ(life_.at_ns, kStart);
  EXPECT_EQ(life_.last_yes_ns, kStart);
}

TEST_F(HazardLifeTest, TheFilterIsRightAsOftenAsItSays) {
  // Hazards that live as the class says, and honest vehicles with the class's rates: of all moments
  // at which it says p, a share p has the hazard there.
  HazardLifecycle::Config config;
  config.malicious_share = 0.001;
  config.max_presence = 0.999;
  const HazardLifecycle rules(config);
  std::mt19937_64 generator(11);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::array<double, 10> there{};
  std::array<double, 10> said{};
  std::array<double, 10> moments{};
  for (int run = 0; run < 4000; ++run) {
    const double rate = std::gamma_distribution<double>(cone_.survival.shape,
                                                        1 / cone_.survival.scale_s)(generator);
    const double end_s = std::exponential_distribution<double>(rate)(generator);
    PresenceRecord life;
    rules.Begin(cone_, {EvidenceKind::kSighting, 1, kStart}, kStart, life);
    life.log_odds = life.undenied_log_odds = 6;  // It is known to be there.
    for (int i = 1; i < 12; ++i) {
      const double t_s = i * 20000.0;
      const std::int64_t now_ns = kStart + static_cast<std::int64_t>(t_s * 1e9);
      const bool standing = t_s < end_s;
      const double presence = rules.Presence(cone_, life, now_ns);
      const auto bin = static_cast<std::size_t>(std::min(9.0, presence * 10));
      said[bin] += presence;
      there[bin] += standing ? 1 : 0;
      moments[bin] += 1;
      const bool yes = uniform(generator) < (standing ? cone_.hit_rate : cone_.false_rate);
      rules.Apply(cone_,
                  {yes ? EvidenceKind::kAnswerYes : EvidenceKind::kAnswerNo,
                   static_cast<std::uint64_t>(i + 1), now_ns},
                  now_ns, life);
      if (life.state == HazardState::kGone) break;
    }
  }
  for (std::size_t bin = 0; bin < 10; ++bin) {
    if (moments[bin] < 500) continue;
    EXPECT_NEAR(there[bin] / moments[bin], said[bin] / moments[bin], 0.05) << "bin " << bin;
  }
}

}  // namespace
}  // namespace livemap::zone
