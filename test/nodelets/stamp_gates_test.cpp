#include "nodelets/stamp_gates.h"

#include <gtest/gtest.h>

#include "common/time.h"

namespace livemap::nodelets {
namespace {

constexpr std::int64_t kNoClock = 0;

/// Inputs without a clock, as those of a bag that is played again without its clock.
class StampGatesTest : public ::testing::Test {
 protected:
  /// Whether everything begins anew with this stamp, s.
  bool BeginsAnew(const std::string& input, double stamp_s, double steady_s) {
    const StampGates::Judgement judgement =
        gates_.Judge(input, Nanoseconds(stamp_s), kNoClock, steady_s);
    verdict_ = judgement.verdict;
    return judgement.begins_anew;
  }
  /// An input of one stamp a second, or every `period_s`; how often everything began anew with it.
  int Play(const std::string& input, double stamp_s, double steady_s, int count,
           double period_s = 1) {
    int times = 0;
    for (int i = 0; i < count; ++i) {
      times += BeginsAnew(input, stamp_s + i * period_s, steady_s + i * period_s) ? 1 : 0;
    }
    return times;
  }

  StampGates gates_{StampGates::Config{}};
  StampGate::Verdict verdict_ = StampGate::Verdict::kInvalid;
};

TEST_F(StampGatesTest, AnInputThatIsSlowerThanTheOthersBelongsToTheirReset) {
  Play("an image", 1000, 0, 100, 0.1);
  Play("a fix", 1000, 0, 5, 2);
  EXPECT_EQ(Play("an image", 1000, 10, 100, 0.1), 1);
  EXPECT_EQ(Play("a fix", 1000, 10, 2, 2), 0);
  EXPECT_EQ(verdict_, StampGate::Verdict::kStray) << "it is not confirmed yet";
  EXPECT_EQ(Play("a fix", 1004, 14, 8, 2), 0) << "4 s after the images: what came since stays";
  EXPECT_EQ(verdict_, StampGate::Verdict::kAccepted);
  EXPECT_EQ(gates_.resets(), 1U);
}

TEST_F(StampGatesTest, EachTimeThatAllInputsGoBackEverythingBeginsAnewOnce) {
  for (int round = 0; round < 4; ++round) {
    Play("an image", 1000, 20 * round, 20);
    Play("a fix", 1000, 20 * round, 20);
    EXPECT_EQ(gates_.resets(), static_cast<std::uint64_t>(round));
  }
}

TEST_F(StampGatesTest, AnInputThatGoesBackAloneBeginsAnewThoughOthersDidLongAgo) {
  Play("an image", 1000, 0, 10);
  Play("a fix", 1000, 0, 10);
  EXPECT_EQ(Play("an image", 500, 10, 10), 1);
  EXPECT_EQ(Play("a fix", 1010, 10, 10), 0) << "it goes on";
  EXPECT_EQ(Play("a fix", 500, 20, 10), 1) << "stamps of it were believed since";
}

TEST_F(StampGatesTest, StragglersOfBeforeDoNotMakeASecondReset) {
  Play("an image", 1000, 0, 100, 0.1);
  Play("detections", 1000, 0.5, 100, 0.1);
  EXPECT_EQ(Play("an image", 1000, 10, 10, 0.1), 1);
  BeginsAnew("detections", 1009.99, 10.5);
  EXPECT_EQ(verdict_, StampGate::Verdict::kAccepted);
  EXPECT_EQ(Play("detections", 1000, 10.6, 10, 0.1), 0);
}

TEST_F(StampGatesTest, WhereStragglersMustBeForgottenTooTheyMakeASecondReset) {
  StampGates::Config config;
  config.together_s = 0;
  gates_ = StampGates(config);
  Play("odom", 1000, 0, 100, 0.1);
  Play("base_link", 1000, 0.5, 100, 0.1);
  EXPECT_EQ(Play("odom", 1000, 10, 10, 0.1), 1);
  BeginsAnew("base_link", 1009.99, 10.5);
  EXPECT_EQ(Play("base_link", 1000, 10.6, 10, 0.1), 1);
}

TEST_F(StampGatesTest, AClockThatGoesBackBeginsAllInputsAnewAtOnce) {
  const auto judge = [this](const std::string& input, double stamp_s, double now_s,
                            double steady_s) {
    return gates_.Judge(input, Nanoseconds(stamp_s), Nanoseconds(now_s), steady_s);
  };
  judge("an image", 1000, 1000, 0);
  judge("a fix", 1000, 1000, 0);
  EXPECT_TRUE(judge("an image", 500, 500, 10).begins_anew);
  const StampGates::Judgement fix = judge("a fix", 500, 500, 10);
  EXPECT_FALSE(fix.begins_anew);
  EXPECT_EQ(fix.verdict, StampGate::Verdict::kAccepted);
  EXPECT_FALSE(gates_.CheckClock(Nanoseconds(501), 11));
  EXPECT_TRUE(gates_.CheckClock(Nanoseconds(400), 20));
  EXPECT_EQ(gates_.resets(), 2U);
}

TEST_F(StampGatesTest, AnInputWithAGateOfItsOwnMayGoBackFurther) {
  StampGate::Config config;
  config.set_back_s = 60;
  gates_.Set("events", config);
  Play("events", 1000, 0, 30);
  EXPECT_EQ(Play("events", 1000, 30, 5), 0);
  EXPECT_EQ(verdict_, StampGate::Verdict::kLate);
  EXPECT_EQ(gates_.refused(), 0U);
}

}  // namespace
}  // namespace livemap::nodelets
