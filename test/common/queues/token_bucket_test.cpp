#include "common/queues/token_bucket.h"

#include <gtest/gtest.h>

#include <string>

namespace livemap {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
// A stamp as a real clock gives it.
constexpr std::int64_t kStart = 1'700'000'000 * kSecondNs;

TokenBucket TenAMinute(TokenBucket::StepBack step_back = TokenBucket::StepBack::kWait) {
  return TokenBucket({10.0, 60.0, step_back});
}

TEST(TokenBucket, IsFullAtFirstAndRefusesWhatItDoesNotHold) {
  TokenBucket bucket = TenAMinute();
  bucket.Refill(kStart);
  EXPECT_FALSE(bucket.Take(10.5));
  EXPECT_TRUE(bucket.Take(10)) << "a refused amount takes nothing";
  EXPECT_FALSE(bucket.Take(1));
}

TEST(TokenBucket, RefillsEvenlyUpToItsCapacity) {
  TokenBucket bucket = TenAMinute();
  bucket.Refill(kStart);
  bucket.Take(10);
  EXPECT_DOUBLE_EQ(bucket.TokensAt(kStart + 30 * kSecondNs), 5);
  EXPECT_DOUBLE_EQ(bucket.tokens(), 0) << "to look takes and gives nothing";
  bucket.Refill(kStart + 6 * kSecondNs);
  EXPECT_DOUBLE_EQ(bucket.tokens(), 1);
  bucket.Refill(kStart + 6000 * kSecondNs);
  EXPECT_DOUBLE_EQ(bucket.tokens(), 10);
}

TEST(TokenBucket, SpendMayLeaveADebtAndGivesBackNoMoreThanTheCapacity) {
  TokenBucket bucket = TenAMinute();
  bucket.Refill(kStart);
  bucket.Spend(15);
  EXPECT_DOUBLE_EQ(bucket.tokens(), -5);
  bucket.Refill(kStart + 30 * kSecondNs);
  EXPECT_FALSE(bucket.Take(1)) << "the debt is paid first";
  bucket.Spend(-100);
  EXPECT_DOUBLE_EQ(bucket.tokens(), 10);
}

TEST(TokenBucket, AClockThatStepsBackTakesNothingAway) {
  for (const auto step_back : {TokenBucket::StepBack::kWait, TokenBucket::StepBack::kFollow}) {
    TokenBucket bucket = TenAMinute(step_back);
    bucket.Refill(kStart);
    bucket.Take(4);
    bucket.Refill(kStart - 3600 * kSecondNs);
    EXPECT_DOUBLE_EQ(bucket.tokens(), 6);
  }
}

TEST(TokenBucket, AfterAStepBackItWaitsForTheClockOrFollowsIt) {
  TokenBucket waits = TenAMinute();
  TokenBucket follows = TenAMinute(TokenBucket::StepBack::kFollow);
  for (TokenBucket* bucket : {&waits, &follows}) {
    bucket->Refill(kStart);
    bucket->Take(10);
    bucket->Refill(kStart - 3600 * kSecondNs);
    bucket->Refill(kStart - 3570 * kSecondNs);
  }
  EXPECT_DOUBLE_EQ(waits.tokens(), 0);
  EXPECT_DOUBLE_EQ(follows.tokens(), 5);
  waits.Refill(kStart);
  EXPECT_DOUBLE_EQ(waits.tokens(), 0) << "an hour that was counted twice";
}

using Pair = KeyedTokenBuckets<2>;

Pair TwoKeys(Pair::Eviction eviction) {
  return Pair({TokenBucket({10.0, 60.0}), TokenBucket({100.0, 60.0})}, 2, eviction);
}

TEST(KeyedTokenBuckets, KeysAndBucketsShareNothing) {
  Pair pairs = TwoKeys(Pair::Eviction::kOnlyFull);
  EXPECT_TRUE(pairs.Use("a", kStart)->at(0).Take(10));
  EXPECT_FALSE(pairs.Use("a", kStart)->at(0).Take(1));
  EXPECT_TRUE(pairs.Use("a", kStart)->at(1).Take(100));
  EXPECT_TRUE(pairs.Use("b", kStart)->at(0).Take(10));
}

TEST(KeyedTokenBuckets, FindNeitherMakesNorRefillsAnything) {
  Pair pairs = TwoKeys(Pair::Eviction::kOnlyFull);
  EXPECT_EQ(pairs.Find("a"), nullptr);
  EXPECT_EQ(pairs.keys(), 0u);
  pairs.Use("a", kStart)->at(0).Take(10);
  EXPECT_DOUBLE_EQ(pairs.Find("a")->at(0).TokensAt(kStart + 6 * kSecondNs), 1);
}

TEST(KeyedTokenBuckets, ANewKeyIsRefusedUntilTheLongestSilentOneIsFullAgain) {
  Pair pairs = TwoKeys(Pair::Eviction::kOnlyFull);
  pairs.Use("a", kStart);
  pairs.Use("b", kStart);
  pairs.Use("a", kStart + 30 * kSecondNs);
  EXPECT_EQ(pairs.Use("c", kStart + 59 * kSecondNs), nullptr);
  EXPECT_NE(pairs.Use("c", kStart + 60 * kSecondNs), nullptr);
  EXPECT_EQ(pairs.Find("b"), nullptr) << "the longest-silent key goes";
  EXPECT_NE(pairs.Find("a"), nullptr);
  EXPECT_EQ(pairs.keys(), 2u);
}

TEST(KeyedTokenBuckets, WhereEvictionIsAlwaysAllowedEveryNewKeyIsKept) {
  Pair pairs = TwoKeys(Pair::Eviction::kAlways);
  for (int i = 0; i < 1000; ++i) ASSERT_NE(pairs.Use(std::to_string(i), kStart), nullptr);
  EXPECT_EQ(pairs.keys(), 2u);
  EXPECT_NE(pairs.Find("998"), nullptr);
}

}  // namespace
}  // namespace livemap
