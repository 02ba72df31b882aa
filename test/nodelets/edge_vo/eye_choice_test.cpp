#include "nodelets/edge_vo/eye_choice.h"

#include <gtest/gtest.h>

namespace livemap::nodelets {
namespace {

constexpr std::int64_t kPeriodNs = 100'000'000;
constexpr std::int64_t kBeginNs = 1'700'000'000'000'000'000;

EyeChoice::Config Wanting(EyeChoice::Wanted wanted) {
  EyeChoice::Config config;
  config.wanted = wanted;
  config.wait_s = 1.0;
  return config;
}

std::int64_t Stamp(int i) { return kBeginNs + i * kPeriodNs; }

TEST(EyeChoice, DepthThatComesWithTheImagesIsFollowedFromTheFirstOn) {
  EyeChoice choice(Wanting(EyeChoice::Wanted::kAuto));
  for (int i = 0; i < 30; ++i) {
    EXPECT_FALSE(choice.OnImage(Stamp(i)));
    EXPECT_TRUE(choice.OnDepth(Stamp(i)));
  }
  EXPECT_EQ(choice.eye(), Eye::kDepth);
}

TEST(EyeChoice, ImagesWithoutDepthAreFollowedWithOneEyeAfterTheWait) {
  EyeChoice choice(Wanting(EyeChoice::Wanted::kAuto));
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(choice.OnImage(Stamp(i))) << i;
  EXPECT_EQ(choice.eye(), Eye::kUndecided);
  for (int i = 10; i < 20; ++i) EXPECT_TRUE(choice.OnImage(Stamp(i))) << i;
  EXPECT_EQ(choice.eye(), Eye::kMono);
}

TEST(EyeChoice, DepthThatComesLaterTakesOverOnceAndForGood) {
  EyeChoice choice(Wanting(EyeChoice::Wanted::kAuto));
  int i = 0;
  for (; i < 20; ++i) choice.OnImage(Stamp(i));
  int with_one_eye = 0;
  for (; choice.eye() == Eye::kMono && i < 100; ++i) {
    with_one_eye += choice.OnImage(Stamp(i)) ? 1 : 0;
    choice.OnDepth(Stamp(i));
  }
  EXPECT_EQ(with_one_eye, 5);
  for (; i < 100; ++i) EXPECT_FALSE(choice.OnImage(Stamp(i))) << "depth is silent, not gone";
}

TEST(EyeChoice, ASingleDepthImageNowAndThenChangesNothing) {
  EyeChoice choice(Wanting(EyeChoice::Wanted::kAuto));
  for (int i = 0; i < 500; ++i) {
    choice.OnImage(Stamp(i));
    if (i > 20 && i % 20 == 0) {
      EXPECT_FALSE(choice.OnDepth(Stamp(i)));
    }
  }
  EXPECT_EQ(choice.eye(), Eye::kMono);
}

TEST(EyeChoice, WhatIsAskedForIsNotDecided) {
  EyeChoice depth(Wanting(EyeChoice::Wanted::kDepth)), mono(Wanting(EyeChoice::Wanted::kMono));
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(depth.OnImage(Stamp(i)));
    EXPECT_TRUE(mono.OnImage(Stamp(i)));
    EXPECT_FALSE(mono.OnDepth(Stamp(i)));
  }
}

TEST(EyeChoice, AReplayThatBeginsAgainWaitsAnewWhileNothingIsDecided) {
  EyeChoice choice(Wanting(EyeChoice::Wanted::kAuto));
  for (int i = 5; i < 12; ++i) choice.OnImage(Stamp(i));
  choice.OnTimeReset();
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(choice.OnImage(Stamp(i))) << i;
  EXPECT_TRUE(choice.OnImage(Stamp(10)));
}

}  // namespace
}  // namespace livemap::nodelets
