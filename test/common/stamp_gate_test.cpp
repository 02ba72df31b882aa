#include "common/stamp_gate.h"

#include <gmock/gmock.h>

#include <vector>

#include "common/time.h"

namespace livemap {
namespace {

using ::testing::ElementsAre;
using Verdict = StampGate::Verdict;

constexpr double kNowS = 1'700'000'000;
constexpr double kYearS = 365 * 86400.0;

std::int64_t Ns(double seconds) { return Nanoseconds(seconds); }

/// What becomes of stamps that come as the clock shows them.
std::vector<Verdict> Verdicts(StampGate& gate, const std::vector<double>& stamps_s,
                              double now_s = 0) {
  std::vector<Verdict> verdicts;
  for (const double stamp_s : stamps_s) verdicts.push_back(gate.Judge(Ns(stamp_s), Ns(now_s)));
  return verdicts;
}

TEST(StampGate, OneStampOfTheFutureIsRefusedAndChangesNothing) {
  for (const double now_s : {kNowS, 0.0}) {
    StampGate gate;
    EXPECT_EQ(gate.Judge(Ns(kNowS - 0.1), Ns(now_s)), Verdict::kAccepted);
    EXPECT_EQ(gate.Judge(Ns(kNowS + kYearS), Ns(now_s)),
              now_s > 0 ? Verdict::kAhead : Verdict::kStray);
    EXPECT_EQ(gate.Judge(Ns(kNowS), Ns(now_s)), Verdict::kAccepted);
    EXPECT_EQ(gate.counters().refused(), 1U);
    EXPECT_EQ(gate.counters().restarts, 0U);
  }
}

TEST(StampGate, ManyStampsOfTheFutureAreRefusedByTheClock) {
  StampGate gate;
  gate.Judge(Ns(kNowS), Ns(kNowS));
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(gate.Judge(Ns(kNowS + 10 + i), Ns(kNowS)), Verdict::kAhead);
  }
  EXPECT_EQ(gate.Judge(Ns(kNowS + 0.1), Ns(kNowS + 0.1)), Verdict::kAccepted);
}

TEST(StampGate, OneStampOfThePastIsRefusedAndChangesNothing) {
  StampGate gate;
  EXPECT_THAT(Verdicts(gate, {kNowS, kNowS - kYearS, kNowS + 0.1, 1.0, kNowS + 0.2}, kNowS + 0.2),
              ElementsAre(Verdict::kAccepted, Verdict::kStray, Verdict::kAccepted, Verdict::kStray,
                          Verdict::kAccepted));
}

TEST(StampGate, AWrongFirstStampIsForgottenOnceOthersComeNearTheClock) {
  StampGate gate;
  EXPECT_THAT(Verdicts(gate, {1.0, kNowS, kNowS + 0.1}, kNowS + 0.1),
              ElementsAre(Verdict::kAccepted, Verdict::kAccepted, Verdict::kAccepted));
}

TEST(StampGate, AWrongFirstStampIsOvercomeByThreeThatAgreeWithoutAClock) {
  StampGate gate;
  EXPECT_THAT(Verdicts(gate, {kNowS + kYearS, kNowS, kNowS + 0.1, kNowS + 0.2, kNowS + 0.3}),
              ElementsAre(Verdict::kAccepted, Verdict::kStray, Verdict::kStray, Verdict::kRestarted,
                          Verdict::kAccepted));
}

TEST(StampGate, ALoopOfTheClockBeginsTheStreamAnewAtOnce) {
  StampGate gate;
  EXPECT_THAT(Verdicts(gate, {kNowS, kNowS + 20}, kNowS + 20),
              ElementsAre(Verdict::kAccepted, Verdict::kAccepted));
  EXPECT_EQ(gate.Judge(Ns(kNowS + 20.1), Ns(kNowS)), Verdict::kAhead) << "a straggler";
  EXPECT_EQ(gate.Judge(Ns(kNowS + 0.1), Ns(kNowS + 0.1)), Verdict::kRestarted);
  EXPECT_EQ(gate.Judge(Ns(kNowS + 0.2), Ns(kNowS + 0.2)), Verdict::kAccepted);
}

TEST(StampGate, ABagThatIsPlayedAgainWithoutItsClockIsBelievedAfterThreeStamps) {
  StampGate gate;
  Verdicts(gate, {1000, 1010, 1020}, kNowS);
  EXPECT_THAT(
      Verdicts(gate, {1000, 1000.1, 1000.2, 1000.3}, kNowS),
      ElementsAre(Verdict::kStray, Verdict::kStray, Verdict::kRestarted, Verdict::kAccepted));
  EXPECT_EQ(gate.counters().restarts, 1U);
}

TEST(StampGate, TwoPublishersWithClocksApartNeverBeginTheStreamAnew) {
  StampGate gate;
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(gate.Judge(Ns(kNowS + i), 0), Verdict::kAccepted);
    EXPECT_EQ(gate.Judge(Ns(kNowS + i - 30), 0), Verdict::kStray);
  }
  EXPECT_EQ(gate.counters().restarts, 0U);
}

TEST(StampGate, DisorderWithinASecondIsLateAndRepeatedStampsToo) {
  StampGate gate;
  EXPECT_THAT(Verdicts(gate, {10, 9.5, 10, 10.5}),
              ElementsAre(Verdict::kAccepted, Verdict::kLate, Verdict::kLate, Verdict::kAccepted));
  EXPECT_EQ(gate.counters().refused(), 0U);
}

TEST(StampGate, AStampOfNothingIsRefused) {
  StampGate gate;
  EXPECT_THAT(Verdicts(gate, {0, -1}, kNowS), ElementsAre(Verdict::kInvalid, Verdict::kInvalid));
}

TEST(StampGate, ALongSilenceNearTheClockNeedsNoConfirmation) {
  StampGate gate;
  gate.Judge(Ns(kNowS), Ns(kNowS));
  EXPECT_EQ(gate.Judge(Ns(kNowS + 7200), Ns(kNowS + 7200)), Verdict::kAccepted);
}

TEST(ClockWatch, TellsOnceThatTheClockWasSetBack) {
  ClockWatch watch;
  EXPECT_FALSE(watch.HasGoneBack(0));
  EXPECT_FALSE(watch.HasGoneBack(Ns(100)));
  EXPECT_FALSE(watch.HasGoneBack(Ns(99.5))) << "a correction";
  EXPECT_TRUE(watch.HasGoneBack(Ns(50)));
  EXPECT_FALSE(watch.HasGoneBack(Ns(50.1)));
  EXPECT_FALSE(watch.HasGoneBack(0)) << "not begun";
}

}  // namespace
}  // namespace livemap
