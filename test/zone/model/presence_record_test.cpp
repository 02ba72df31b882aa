// Officials, the end of a life, what it teaches, and how it is stored.
#include <gmock/gmock.h>

#include <cmath>

#include "common/error.h"
#include "test/zone/belief/hazard_lifecycle_fixture.h"
#include "zone/belief/hazard_lifecycle.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST_F(HazardLifeTest, ARejectedHazardIsOffTheMapAndSightingsDoNotReopenItInQuarantine) {
  MakeActive();
  const LifecycleUpdate step =
      rules_.Reject(cone_, "Ada", "a manhole cover", kStart + kHour, life_);
  ASSERT_TRUE(step.transition);
  EXPECT_EQ(step.transition->to, HazardState::kRejected);
  EXPECT_EQ(step.transition->reason, "rejected by Ada: a manhole cover");
  for (std::uint64_t vehicle = 10; vehicle < 60; ++vehicle) {
    See(vehicle, kStart + 2 * kHour + static_cast<std::int64_t>(vehicle) * kSecond);
  }
  EXPECT_EQ(life_.state, HazardState::kRejected);
}

TEST_F(HazardLifeTest, AfterQuarantineTwoFurtherVehiclesReopenARejectedHazardAndOneDoesNot) {
  MakeActive();
  rules_.Reject(cone_, "Ada", "", kStart + kHour, life_);
  const std::int64_t later = kStart + kHour + kDay + kSecond;
  for (int i = 0; i < 100; ++i) See(1, later + i * kSecond);
  EXPECT_EQ(life_.state, HazardState::kRejected);
  const LifecycleUpdate step = See(2, later + kHour);
  EXPECT_EQ(life_.state, HazardState::kActive);
  ASSERT_TRUE(step.transition);
  EXPECT_THAT(step.transition->reason, HasSubstr("after its rejection"));
}

TEST_F(HazardLifeTest, AnOfficialRevokesARejectionAtOnce) {
  MakeActive();
  rules_.Reject(cone_, "Ada", "", kStart + kHour, life_);
  rules_.Confirm(cone_, "Bob", "", kStart + 2 * kHour, life_);
  EXPECT_EQ(life_.state, HazardState::kActive);
}

TEST_F(HazardLifeTest, ARejectedHazardIsForgottenAfterItsTime) {
  MakeActive();
  rules_.Reject(cone_, "Ada", "", kStart + kHour, life_);
  EXPECT_FALSE(rules_.Advance(cone_, kStart + 80 * kDay, life_).transition);
  rules_.Advance(cone_, rules_.NextChangeNs(cone_, life_), life_);
  EXPECT_EQ(life_.state, HazardState::kGone);
}

TEST_F(HazardLifeTest, NothingHappensToWhatIsGone) {
  Begin(1);
  rules_.Advance(cone_, kStart + 1000 * kDay, life_);
  ASSERT_EQ(life_.state, HazardState::kGone);
  const std::string before = PackPresence(life_);
  See(2, kStart + 1001 * kDay);
  rules_.Confirm(cone_, "Ada", "", kStart + 1001 * kDay, life_);
  rules_.Reject(cone_, "Ada", "", kStart + 1001 * kDay, life_);
  rules_.Advance(cone_, kStart + 1002 * kDay, life_);
  EXPECT_EQ(PackPresence(life_), before);
}

TEST_F(HazardLifeTest, TeachesHowLongItStoodAndThatItEnded) {
  MakeActive();
  LifetimeObservation sum;
  const auto learn = [&sum](const LifecycleUpdate& step) {
    sum.stood_s += step.lesson.stood_s;
    sum.ended = sum.ended || step.lesson.ended;
  };
  learn(See(3, kStart + 10 * kHour));
  EXPECT_FALSE(sum.ended);
  for (std::uint64_t vehicle = 4; IsTold(life_.state); ++vehicle) {
    learn(Deny(vehicle, kStart + 12 * kHour + static_cast<std::int64_t>(vehicle - 4) * kSecond));
  }
  EXPECT_TRUE(sum.ended);
  // From the second sighting, which told the first second, to the middle of the unseen time.
  EXPECT_NEAR(sum.stood_s, 11 * 3600 - 1, 1e-6);
}

TEST_F(HazardLifeTest, PackedAndUnpackedItIsTheSame) {
  MakeActive();
  for (std::uint64_t vehicle = 3; vehicle < 8; ++vehicle) {
    See(VehicleKey("vehicle " + std::to_string(vehicle)),
        kStart + kHour + static_cast<std::int64_t>(vehicle) * kSecond / 3);
  }
  Deny(VehicleKey("x"), kStart + kDay);
  const std::string packed = PackPresence(life_);
  EXPECT_LE(packed.size(), 500u);
  const auto unpacked = UnpackPresence(packed);
  ASSERT_TRUE(unpacked);
  EXPECT_EQ(PackPresence(*unpacked), packed);
  EXPECT_EQ(unpacked->log_odds, life_.log_odds);
  EXPECT_EQ(rules_.NextChangeNs(cone_, *unpacked), rules_.NextChangeNs(cone_, life_));
}

TEST_F(HazardLifeTest, WhatIsNoPackedLifeIsRefused) {
  MakeActive();
  const std::string packed = PackPresence(life_);
  EXPECT_TRUE(UnpackPresence(packed));
  for (std::size_t size = 0; size < packed.size(); ++size) {
    const auto cut = UnpackPresence(packed.substr(0, size));
    if (cut) {
      EXPECT_LT(PackPresence(*cut).size(), packed.size());
    }
  }
  EXPECT_FALSE(UnpackPresence(packed + " "));
  EXPECT_FALSE(UnpackPresence(packed + " 7"));
  EXPECT_FALSE(UnpackPresence("9" + packed.substr(1))) << "no such state";
  EXPECT_FALSE(UnpackPresence("1 0 1 1 1 0 1 nan 0"));
  EXPECT_FALSE(UnpackPresence("1 0 1 1 1 0 1 1e300 0"));
  EXPECT_FALSE(UnpackPresence("1 0 -1 1 1 0 1 1 0"));
  EXPECT_FALSE(UnpackPresence("1 0 1 1 1 0 1 1 0 5 1 1 0 5 1 1 0")) << "a vehicle twice";
  EXPECT_FALSE(UnpackPresence(std::string(10000, '1')));
}

TEST(HazardLifeConfig, RefusesWhatIsOutOfRangeAndNamesIt) {
  HazardLifecycle::Config config;
  config.denying_vehicles = 1;
  EXPECT_THAT([&] { HazardLifecycle{config}; },
              ThrowsMessage<Error>(HasSubstr("denying_vehicles")));
  config = {};
  config.malicious_share = std::nan("");
  EXPECT_THAT([&] { HazardLifecycle{config}; }, ThrowsMessage<Error>(HasSubstr("malicious_share")));
  config = {};
  config.settled_above = 0.3;
  EXPECT_THAT([&] { HazardLifecycle{config}; }, ThrowsMessage<Error>(HasSubstr("settled_above")));
}

TEST(VehicleKeys, AreStableAndNeverNobody) {
  EXPECT_EQ(VehicleKey("abc"), 0xba7816bf8f01cfeaU) << "FIPS 180-4's example";
  EXPECT_NE(VehicleKey(""), 0u);
}

}  // namespace
}  // namespace livemap::zone
