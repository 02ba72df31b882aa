#include "receiver/receiver_clock.h"

#include <gtest/gtest.h>

#include "common/time.h"

namespace livemap::receiver {
namespace {

constexpr std::int64_t kClockStartNs = 1'795'653'934'000'000'000;

/// A report measured `at_s` that comes `late_s` later, while the clock is `ahead_s` ahead.
void AddReport(ReceiverClock& clock, double at_s, double late_s, double ahead_s) {
  const std::int64_t came_ns = Nanoseconds(at_s + late_s);
  clock.Add(kClockStartNs + Nanoseconds(at_s), kClockStartNs + came_ns + Nanoseconds(ahead_s),
            came_ns);
}

TEST(ReceiverClock, KnowsNothingBeforeTheFirstReport) { EXPECT_FALSE(ReceiverClock().offset_s()); }

TEST(ReceiverClock, IsNotMisledByReportsThatComeLate) {
  ReceiverClock clock;
  AddReport(clock, 0, 0.1, 0);
  for (const double late_s : {3.0, 10.0, 0.9}) AddReport(clock, 1, late_s, 0);
  EXPECT_NEAR(*clock.offset_s(), 0.1, 1e-6);
}

TEST(ReceiverClock, SeesAClockThatIsAheadOrBehind) {
  for (const double ahead_s : {-3600.0, 5.0}) {
    ReceiverClock clock;
    for (int i = 0; i < 3; ++i) AddReport(clock, i, 0.2, ahead_s);
    EXPECT_NEAR(*clock.offset_s(), ahead_s + 0.2, 1e-6);
  }
}

TEST(ReceiverClock, ForgetsWhatWasBeforeTheClockWasSet) {
  ReceiverClock clock;
  for (int i = 0; i < 5; ++i) AddReport(clock, i, 0.1, -3600);
  AddReport(clock, 6, 0.1, 0);
  EXPECT_NEAR(*clock.offset_s(), 0.1, 1e-6) << "a clock that was behind and is set right";
  AddReport(clock, 7, 0.1, 20);
  EXPECT_NEAR(*clock.offset_s(), 20.1, 1e-6) << "a clock that was right and is set wrong";
}

TEST(ReceiverClock, ForgetsWhatIsOld) {
  ReceiverClock clock;
  AddReport(clock, 0, 0, 0);
  // Slowly enough not to be a clock that was set.
  for (int i = 1; i <= 20; ++i) AddReport(clock, i, 0, 0.1 * i);
  EXPECT_GT(*clock.offset_s(), 1.2);
}

}  // namespace
}  // namespace livemap::receiver
