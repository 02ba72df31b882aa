#include "zone/belief/trust_update.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "test/zone/belief/hazard_lifecycle_fixture.h"
#include "zone/belief/vehicle_trust.h"

namespace livemap::zone {
namespace {

class HazardVerdictsTest : public HazardLifeTest {
 protected:
  /// Judges what the step teaches, and says how far `vehicle` is believed then.
  void Learn(const LifecycleUpdate& step) {
    for (const Verdict& verdict : step.verdicts) trust_.Judge(verdict, life_.at_ns);
  }
  double MaliciousProbability(std::uint64_t vehicle) const {
    return trust_.MaliciousProbability(vehicle, life_.at_ns);
  }
  LifecycleUpdate Speak(EvidenceKind kind, std::uint64_t vehicle, std::int64_t at_ns) {
    Evidence word = Word(kind, vehicle, at_ns);
    word.malicious = MaliciousProbability(vehicle);
    const LifecycleUpdate step = rules_.Apply(cone_, word, at_ns, life_);
    Learn(step);
    return step;
  }
  static double RatioOf(const LifecycleUpdate& step, std::uint64_t vehicle) {
    const auto found =
        std::find_if(step.verdicts.begin(), step.verdicts.end(),
                     [&](const Verdict& verdict) { return verdict.vehicle == vehicle; });
    return found == step.verdicts.end() ? 0 : found->log_ratio;
  }

  VehicleTrust trust_;
};

TEST_F(HazardVerdictsTest, WhoInventsAndIsDeniedAtOnceIsBelievedLess) {
  Begin(1);
  Speak(EvidenceKind::kAnswerNo, 2, kStart + 60 * kSecond);
  EXPECT_NEAR(MaliciousProbability(1), 0.05, 1e-9) << "one word against another says nothing";
  const LifecycleUpdate step = Speak(EvidenceKind::kAnswerNo, 3, kStart + 120 * kSecond);
  ASSERT_EQ(life_.state, HazardState::kGone);
  EXPECT_GT(RatioOf(step, 1), 0.8);
  EXPECT_GT(MaliciousProbability(1), 0.1);
  EXPECT_NEAR(MaliciousProbability(2), 0.05, 1e-9);
  EXPECT_NEAR(MaliciousProbability(3), 0.05, 1e-9);
}

TEST_F(HazardVerdictsTest, OneContradictionIsForgivenWhereOneVehicleConfirmsAndTwoAreNot) {
  cone_.confirmations = 1;
  int contradictions = 0;
  HazardState state = HazardState::kActive;
  for (; state == HazardState::kActive && contradictions < 5; ++contradictions) {
    Evidence word = Word(EvidenceKind::kSighting, 1, kStart);
    word.malicious = MaliciousProbability(1);
    rules_.Begin(cone_, word, kStart, life_);
    state = life_.state;
    Speak(EvidenceKind::kAnswerNo, 2, kStart + 60 * kSecond);
    Speak(EvidenceKind::kAnswerNo, 3, kStart + 120 * kSecond);
    ASSERT_EQ(life_.state, HazardState::kGone);
  }
  EXPECT_EQ(state, HazardState::kCandidate);
  EXPECT_EQ(contradictions, 3);
}

TEST_F(HazardVerdictsTest, WhatMayHaveEndedMeanwhileIsHeldAgainstNobody) {
  cone_.survival = {5, 4 * 600.0};  // Ten minutes.
  Begin(1);
  Speak(EvidenceKind::kAnswerNo, 2, kStart + kHour);
  const LifecycleUpdate step = Speak(EvidenceKind::kAnswerNo, 3, kStart + kHour + kSecond);
  ASSERT_EQ(life_.state, HazardState::kGone);
  EXPECT_LT(RatioOf(step, 1), 0.6) << "a quarter of first reports is false anyway";
}

TEST_F(HazardVerdictsTest, WhatSeveralSawAndThenEndedIsHeldAgainstNobody) {
  MakeActive();
  See(3, kStart + kHour);
  See(4, kStart + 2 * kHour);
  See(5, kStart + 3 * kHour);
  const std::int64_t ended_ns = kStart + 20 * kHour;
  LifecycleUpdate step;
  for (std::uint64_t vehicle = 20; life_.state != HazardState::kGone; ++vehicle) {
    step = Deny(vehicle, ended_ns + static_cast<std::int64_t>(vehicle) * kSecond);
  }
  for (std::uint64_t vehicle = 1; vehicle < 6; ++vehicle) EXPECT_LT(RatioOf(step, vehicle), 0.02);
}

TEST_F(HazardVerdictsTest, WhoDeniesWhatOthersSeeAfterwardsIsBelievedLess) {
  MakeActive();
  Speak(EvidenceKind::kAnswerNo, 9, kStart + kHour);
  Speak(EvidenceKind::kAnswerYes, 3, kStart + 2 * kHour);
  const LifecycleUpdate step = Speak(EvidenceKind::kAnswerYes, 4, kStart + 3 * kHour);
  EXPECT_GT(MaliciousProbability(9), 0.11);
  EXPECT_NEAR(MaliciousProbability(3), 0.05, 1e-9);
  // Judged once.
  EXPECT_EQ(RatioOf(step, 9), 0);
}

TEST_F(HazardVerdictsTest, SightingsOfOthersBearOutTheEarlierOnes) {
  MakeActive();
  const LifecycleUpdate step = Speak(EvidenceKind::kAnswerYes, 3, kStart + kHour);
  EXPECT_LT(RatioOf(step, 1), 0);
  EXPECT_LT(RatioOf(step, 2), 0);
  EXPECT_EQ(RatioOf(step, 3), 0) << "nobody bears out its own word";
  EXPECT_EQ(step.verdicts.front().voucher, 3U);
}

TEST_F(HazardVerdictsTest, TwoThatAgreeBearNobodyOut) {
  Begin(1);
  const LifecycleUpdate step = Speak(EvidenceKind::kSighting, 2, kStart + kSecond);
  EXPECT_EQ(life_.state, HazardState::kActive);
  EXPECT_TRUE(step.verdicts.empty()) << "it takes two others to be sure of a word";
}

TEST_F(HazardVerdictsTest, AnOfficialsWordWeighsMost) {
  MakeActive();
  Deny(9, kStart + kHour);
  PresenceRecord rejected = life_;
  const LifecycleUpdate no = rules_.Reject(cone_, "Anna", "", kStart + 2 * kHour, rejected);
  EXPECT_NEAR(RatioOf(no, 1), 2, 1e-9);
  EXPECT_LT(RatioOf(no, 9), -1);
  const LifecycleUpdate yes = rules_.Confirm(cone_, "Anna", "", kStart + 2 * kHour, life_);
  EXPECT_LT(RatioOf(yes, 1), -1);
  EXPECT_GT(RatioOf(yes, 9), 1.9);
}

TEST_F(HazardVerdictsTest, ASuspectConfirmsNothingAndDeniesNothing) {
  for (int lie = 0; lie < 4; ++lie) trust_.Judge({6, 1.5, 1}, kStart);
  Begin(1);
  Speak(EvidenceKind::kSighting, 6, kStart + kSecond);
  EXPECT_EQ(life_.state, HazardState::kCandidate);
  EXPECT_EQ(Supporters(life_), 1U);
  See(2, kStart + 2 * kSecond);
  ASSERT_EQ(life_.state, HazardState::kActive);
  const double before = life_.log_odds;
  Speak(EvidenceKind::kAnswerNo, 6, kStart + 3 * kSecond);
  EXPECT_NEAR(life_.log_odds, before, 0.01);
  EXPECT_EQ(Opponents(life_), 0U);
}

TEST_F(HazardVerdictsTest, OneVehicleSufficesOnlyIfItCounts) {
  cone_.confirmations = 1;
  Evidence word = Word(EvidenceKind::kSighting, 6, kStart);
  word.malicious = 0.6;
  rules_.Begin(cone_, word, kStart, life_);
  EXPECT_EQ(life_.state, HazardState::kCandidate);
  EXPECT_EQ(life_.last_yes_ns, kStart);
  See(7, kStart + kSecond);
  EXPECT_EQ(life_.state, HazardState::kActive);
}

TEST_F(HazardVerdictsTest, SuspectsDriveNoVoiceAwayThatCounts) {
  MakeActive();
  for (std::uint64_t vehicle = 3; vehicle < 7; ++vehicle) {
    See(vehicle, kStart + static_cast<std::int64_t>(vehicle) * kSecond);
  }
  ASSERT_EQ(Supporters(life_), 6U);
  for (std::uint64_t vehicle = 100; vehicle < 200; ++vehicle) {
    Evidence word = Word(EvidenceKind::kAnswerNo, vehicle, kStart + kHour);
    word.malicious = 0.9;
    rules_.Apply(cone_, word, kStart + kHour, life_);
  }
  EXPECT_EQ(Supporters(life_), 6U);
  EXPECT_EQ(life_.state, HazardState::kActive);
}

TEST_F(HazardVerdictsTest, WhatWasJudgedIsStoredWithTheVoice) {
  MakeActive();
  Deny(9, kStart + kHour);
  See(3, kStart + 2 * kHour);
  Evidence word = Word(EvidenceKind::kSighting, 6, kStart + 3 * kHour);
  word.malicious = 0.6;
  rules_.Apply(cone_, word, kStart + 3 * kHour, life_);
  const auto unpacked = UnpackPresence(PackPresence(life_));
  ASSERT_TRUE(unpacked);
  EXPECT_EQ(PackPresence(*unpacked), PackPresence(life_));
  EXPECT_EQ(unpacked->judged, life_.judged);
  EXPECT_NE(life_.judged, 0);
  EXPECT_EQ(Supporters(*unpacked), 3U);
}

}  // namespace
}  // namespace livemap::zone
