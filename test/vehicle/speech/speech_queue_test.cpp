#include "vehicle/speech/speech_queue.h"

#include <gtest/gtest.h>

namespace livemap::vehicle {
namespace {

using End = SpeechQueue::End;

HazardAlert QueuedAlert(int number, int urgency, double time_s,
                        HazardAlert::State state = HazardAlert::State::kApproach) {
  HazardAlert alert;
  alert.id.bytes[0] = static_cast<std::uint8_t>(number);
  alert.urgency = urgency;
  alert.time_s = time_s;
  alert.distance_m = 20 * time_s;
  alert.state = state;
  return alert;
}

int NumberOf(const std::optional<HazardAlert>& alert) { return alert ? alert->id.bytes[0] : 0; }

TEST(SpeechQueue, TheMostUrgentGoesFirstThenTheNearest) {
  SpeechQueue queue({});
  queue.Take(QueuedAlert(1, 2, 9), 0);
  queue.Take(QueuedAlert(2, 1, 9), 0);
  queue.Take(QueuedAlert(3, 2, 6), 0);
  for (const int expected : {2, 3, 1, 0}) {
    EXPECT_EQ(NumberOf(queue.Next(0.5)), expected);
    queue.Finish(End::kSaid);
  }
}

TEST(SpeechQueue, NothingIsSaidWhileSomethingIs) {
  SpeechQueue queue({});
  queue.Take(QueuedAlert(1, 2, 9), 0);
  EXPECT_EQ(NumberOf(queue.Next(0)), 1);
  queue.Take(QueuedAlert(2, 1, 9), 0);
  EXPECT_FALSE(queue.Next(0));
  queue.Finish(End::kSaid);
  EXPECT_EQ(NumberOf(queue.Next(1)), 2);
}

TEST(SpeechQueue, WhatIsCancelledOrPassedBeforeIsNeverSaid) {
  SpeechQueue queue({});
  queue.Take(QueuedAlert(1, 2, 9), 0);
  queue.Take(QueuedAlert(2, 2, 9), 0);
  EXPECT_FALSE(queue.Take(QueuedAlert(1, 2, 0, HazardAlert::State::kCancelled), 1));
  EXPECT_FALSE(queue.Take(QueuedAlert(2, 2, 0, HazardAlert::State::kPassed), 1));
  EXPECT_FALSE(queue.Next(1));
  EXPECT_EQ(queue.counters().withdrawn, 2U);
}

TEST(SpeechQueue, ACancelInterruptsItsOwnSentenceOnly) {
  SpeechQueue queue({});
  queue.Take(QueuedAlert(1, 2, 9), 0);
  ASSERT_TRUE(queue.Next(0));
  EXPECT_FALSE(queue.Take(QueuedAlert(2, 2, 0, HazardAlert::State::kCancelled), 0.5));
  EXPECT_FALSE(queue.Take(QueuedAlert(1, 2, 0, HazardAlert::State::kPassed), 0.5));
  EXPECT_TRUE(queue.Take(QueuedAlert(1, 2, 0, HazardAlert::State::kCancelled), 0.5));
}

TEST(SpeechQueue, DistanceIsThatOfTheMomentItIsSaid) {
  SpeechQueue queue({});
  queue.Take(QueuedAlert(1, 2, 8), 10);
  const auto alert = queue.Next(12);
  ASSERT_TRUE(alert);
  EXPECT_DOUBLE_EQ(alert->distance_m, 120);
  EXPECT_DOUBLE_EQ(alert->time_s, 6);
}

TEST(SpeechQueue, WhatComesTooLateIsDropped) {
  SpeechQueue queue({});
  queue.Take(QueuedAlert(1, 2, 5), 0);
  queue.Take(QueuedAlert(2, 2, 60), 0);
  EXPECT_EQ(NumberOf(queue.Next(4.5)), 2);
  queue.Finish(End::kSaid);
  queue.Take(QueuedAlert(3, 2, 60), 5);
  EXPECT_FALSE(queue.Next(16));
  EXPECT_EQ(queue.counters().late, 2U);
}

TEST(SpeechQueue, AFullQueueKeepsTheMostUrgent) {
  SpeechQueue::Config config;
  config.max_waiting = 2;
  SpeechQueue queue(config);
  for (const int number : {1, 2, 3}) queue.Take(QueuedAlert(number, 4 - number, 9), 0);
  EXPECT_EQ(queue.waiting(), 2U);
  EXPECT_EQ(queue.counters().refused, 1U);
  EXPECT_EQ(NumberOf(queue.Next(0)), 3);
}

TEST(SpeechQueue, AnAlertThatComesAgainWaitsOnce) {
  SpeechQueue queue({});
  queue.Take(QueuedAlert(1, 2, 9), 0);
  queue.Take(QueuedAlert(1, 2, 8), 1);
  EXPECT_EQ(queue.waiting(), 1U);
}

}  // namespace
}  // namespace livemap::vehicle
