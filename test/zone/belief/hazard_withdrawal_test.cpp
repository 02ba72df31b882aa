// What a distrusted vehicle said is taken back.
#include <gmock/gmock.h>

#include "test/zone/belief/hazard_lifecycle_fixture.h"
#include "zone/belief/hazard_lifecycle.h"

namespace livemap::zone {
namespace {

constexpr char kWhy[] = "words of car-9 withdrawn by Ada: stolen";

class HazardWithdrawalTest : public HazardLifeTest {
 protected:
  LifecycleUpdate Withdraw(std::uint64_t vehicle, std::int64_t at_ns) {
    return rules_.Withdraw(cone_, vehicle, kWhy, at_ns, life_);
  }
};

TEST_F(HazardWithdrawalTest, WhatOnlyThatVehicleSawIsGone) {
  Begin(9);
  const LifecycleUpdate step = Withdraw(9, kStart + kHour);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->from, HazardState::kCandidate);
  EXPECT_EQ(step.transition->to, HazardState::kGone);
  EXPECT_EQ(step.transition->reason, kWhy);
  EXPECT_EQ(life_.state, HazardState::kGone);
  EXPECT_EQ(step.lesson.stood_s, 0) << "nothing ended, so nothing is learned";
}

TEST_F(HazardWithdrawalTest, WhatTooFewOthersSawIsACandidateAgain) {
  MakeActive();
  const LifecycleUpdate step = Withdraw(2, kStart + kHour);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->from, HazardState::kActive);
  EXPECT_EQ(step.transition->to, HazardState::kCandidate);
  EXPECT_EQ(Supporters(life_), 1U);
  See(3, kStart + 2 * kHour);
  EXPECT_EQ(life_.state, HazardState::kActive) << "another vehicle confirms it";
}

TEST_F(HazardWithdrawalTest, WhatEnoughOthersSawStays) {
  MakeActive();
  See(3, kStart + 2 * kSecond);
  const LifecycleUpdate step = Withdraw(3, kStart + kHour);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->to, HazardState::kActive);
  EXPECT_EQ(Supporters(life_), 2U);
}

TEST_F(HazardWithdrawalTest, TheOddsAreAsIfItHadSaidNothing) {
  MakeActive();
  const PresenceRecord before = life_;
  Deny(9, kStart + 2 * kSecond);
  ASSERT_LT(life_.log_odds, before.log_odds);
  Withdraw(9, kStart + 2 * kSecond);
  EXPECT_NEAR(life_.log_odds, before.log_odds, 0.01);
  EXPECT_NEAR(life_.undenied_log_odds, before.undenied_log_odds, 0.01);
  EXPECT_EQ(life_.first_no_ns, 0);
  EXPECT_EQ(Opponents(life_), 0U);

  PresenceRecord unseen = life_;
  rules_.Advance(cone_, kStart + kHour, unseen);
  See(9, kStart + kHour);
  Withdraw(9, kStart + kHour);
  EXPECT_NEAR(life_.log_odds, unseen.log_odds, 0.02);
  EXPECT_NEAR(life_.undenied_log_odds, unseen.undenied_log_odds, 0.02);
  EXPECT_NEAR(static_cast<double>(life_.last_yes_ns), static_cast<double>(unseen.last_yes_ns), 1e9);
}

TEST_F(HazardWithdrawalTest, ACandidateThatItAloneHeldBackIsTold) {
  Begin(1);
  Deny(9, kStart + kSecond);
  See(2, kStart + 2 * kSecond);
  ASSERT_EQ(life_.state, HazardState::kCandidate);
  Withdraw(9, kStart + 3 * kSecond);
  EXPECT_EQ(life_.state, HazardState::kActive);
}

TEST_F(HazardWithdrawalTest, WhatAnOfficialConfirmedStays) {
  Begin(9);
  rules_.Confirm(cone_, "Ada", "", kStart + kSecond, life_);
  const double before = Presence(kStart + kHour);
  ASSERT_TRUE(Withdraw(9, kStart + kHour).transition);
  EXPECT_EQ(life_.state, HazardState::kActive);
  EXPECT_DOUBLE_EQ(Presence(kStart + kHour), before);
  EXPECT_EQ(Supporters(life_), 0U);
}

TEST_F(HazardWithdrawalTest, ARejectedHazardStaysRejected) {
  MakeActive();
  rules_.Reject(cone_, "Ada", "", kStart + kHour, life_);
  See(9, kStart + kHour + 2 * kDay);
  ASSERT_EQ(Supporters(life_), 1U);
  Withdraw(9, kStart + kHour + 2 * kDay);
  EXPECT_EQ(life_.state, HazardState::kRejected);
  EXPECT_EQ(Supporters(life_), 0U);
}

TEST_F(HazardWithdrawalTest, NothingHappensWhereItSaidNothing) {
  MakeActive();
  const std::string before = PackPresence(life_);
  EXPECT_FALSE(Withdraw(9, kStart + kHour).transition);
  EXPECT_FALSE(Withdraw(0, kStart + kHour).transition);
  EXPECT_EQ(PackPresence(life_), before);
  Begin(9);
  Withdraw(9, kStart + kHour);
  ASSERT_EQ(life_.state, HazardState::kGone);
  EXPECT_FALSE(Withdraw(9, kStart + 2 * kHour).transition);
}

}  // namespace
}  // namespace livemap::zone
