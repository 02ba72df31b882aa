#include "receiver/receiver_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/time.h"

namespace livemap::receiver {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kStartNs = 1'795'653'934'000'000'000;
const char* const kUsb = "/dev/ttyACM0";
const char* const kOther = "/dev/ttyUSB1";

/// A watch with clocks that the test moves.
class ReceiverWatchTest : public testing::Test {
 protected:
  ReceiverWatch::Now Now() const {
    return {kStartNs + Nanoseconds(seconds_ + clock_ahead_s_), Nanoseconds(seconds_)};
  }
  void Connect() { watch_.OnConnection(true, "", Now()); }
  void PlugIn(const std::string& path = kUsb) { watch_.OnDevices({{path, true}}); }

  /// A report of this moment, 11 m further east for each second.
  ReceiverReport Report(const std::string& device = kUsb) const {
    ReceiverReport report;
    report.device = device;
    report.mode = ReceiverReport::kSpace;
    report.stamp_ns = kStartNs + Nanoseconds(seconds_);
    report.latitude_deg = 45;
    report.longitude_deg = 7 + 1.4e-4 * seconds_;
    report.radial_error_m = 5;
    report.speed_mps = 11;
    report.course_deg = 90;
    return report;
  }
  ReceiverReport ReportWithoutFix(const std::string& device = kUsb) const {
    ReceiverReport report;
    report.device = device;
    report.mode = ReceiverReport::kNone;
    return report;
  }
  ReceiverWatch::Taken Take(const ReceiverReport& report) {
    seconds_ += 0.1;
    ReceiverWatch::Taken taken = watch_.OnReport(report, Now());
    seconds_ += 0.9;
    return taken;
  }
  ReceiverState State() const { return watch_.state(Now().steady_ns); }
  std::string Sentence() const { return watch_.Describe(Now().steady_ns); }

  double seconds_ = 1000;
  double clock_ahead_s_ = 0;
  ReceiverWatch watch_{ReceiverWatch::Config{}};
};

TEST_F(ReceiverWatchTest, SaysWhatIsWrongFromTheOutsideToTheInside) {
  EXPECT_EQ(State(), ReceiverState::kNoGpsd);
  watch_.OnConnection(false, "127.0.0.1:2947: Connection refused", Now());
  EXPECT_EQ(State(), ReceiverState::kNoGpsd);
  EXPECT_THAT(Sentence(), HasSubstr("no gpsd: 127.0.0.1:2947: Connection refused"));
  Connect();
  watch_.OnDevices({});
  EXPECT_EQ(State(), ReceiverState::kNoReceiver);
  EXPECT_THAT(Sentence(), HasSubstr("plug it in"));
  PlugIn();
  EXPECT_EQ(State(), ReceiverState::kNoFix);
  Take(ReportWithoutFix());
  watch_.OnSatellites(kUsb, 2, 5);
  EXPECT_THAT(Sentence(), HasSubstr("no fix: 2 of 5 satellites"));
  EXPECT_TRUE(Take(Report()).fix);
  EXPECT_EQ(State(), ReceiverState::kFix);
}

TEST_F(ReceiverWatchTest, NamesAReceiverThatGpsdCannotOpen) {
  Connect();
  watch_.OnDevices({{kUsb, false}});
  EXPECT_EQ(State(), ReceiverState::kNoReceiver);
  EXPECT_THAT(Sentence(), HasSubstr("cannot open /dev/ttyACM0"));
}

TEST_F(ReceiverWatchTest, AReceiverThatIsUnpluggedIsGoneAtOnceAndBackWithItsFirstReport) {
  Connect();
  PlugIn();
  Take(Report());
  watch_.OnDevices({});
  EXPECT_EQ(State(), ReceiverState::kNoReceiver);
  EXPECT_EQ(watch_.device(), "");
  // It may come back under another name.
  PlugIn(kOther);
  EXPECT_TRUE(Take(Report(kOther)).fix);
  EXPECT_EQ(State(), ReceiverState::kFix);
}

TEST_F(ReceiverWatchTest, AReceiverThatSaysNothingIsSilent) {
  Connect();
  PlugIn();
  Take(Report());
  seconds_ += 4.5;
  EXPECT_EQ(State(), ReceiverState::kSilent);
  EXPECT_THAT(Sentence(), HasSubstr("/dev/ttyACM0"));
  Take(Report());
  EXPECT_EQ(State(), ReceiverState::kFix);
}

TEST_F(ReceiverWatchTest, WithholdsFixesWhileTheClocksAreApart) {
  Connect();
  PlugIn();
  for (const double ahead_s : {-30.0, 30.0}) {
    clock_ahead_s_ = ahead_s;
    EXPECT_FALSE(Take(Report()).fix);
    EXPECT_EQ(State(), ReceiverState::kClockWrong);
    EXPECT_THAT(Sentence(), HasSubstr(ahead_s > 0 ? "30.1 s ahead" : "29.9 s behind"));
  }
  EXPECT_EQ(watch_.counters().withheld, 2U);
  clock_ahead_s_ = 0;
  EXPECT_TRUE(Take(Report()).fix);
  EXPECT_EQ(State(), ReceiverState::kFix);
}

TEST_F(ReceiverWatchTest, KnowsAReceiverThatCountsItsWeeksAnew) {
  Connect();
  ReceiverReport report = Report();
  report.stamp_ns -= Nanoseconds(1024.0 * 7 * 86400);
  EXPECT_FALSE(Take(report).fix);
  EXPECT_THAT(Sentence(), HasSubstr("1024 weeks"));
}

TEST_F(ReceiverWatchTest, AReportThatABusyComputerTookLateIsNoWrongClock) {
  Connect();
  PlugIn();
  Take(Report());
  const ReceiverReport late = Report();
  seconds_ += 4;
  EXPECT_TRUE(Take(late).fix);
  EXPECT_EQ(State(), ReceiverState::kFix);
}

TEST_F(ReceiverWatchTest, GivesAMomentOnce) {
  Connect();
  PlugIn();
  const ReceiverReport report = Report();
  EXPECT_TRUE(Take(report).fix);
  // A leap second, which UTC's seconds since 1970 count twice, is a repetition too.
  EXPECT_FALSE(Take(report).fix);
  EXPECT_EQ(watch_.counters().repeated, 1U);
  EXPECT_EQ(State(), ReceiverState::kFix);
}

TEST_F(ReceiverWatchTest, CountsRefusesAndGoesOn) {
  Connect();
  PlugIn();
  ReceiverReport nowhere = Report();
  nowhere.latitude_deg = kNotStated;
  EXPECT_TRUE(Take(nowhere).says_no_fix);
  EXPECT_EQ(State(), ReceiverState::kNoFix);
  EXPECT_THAT(Sentence(), HasSubstr("not on the earth"));
  ReceiverReport absurd = Report();
  absurd.speed_mps = 1e6;
  const ReceiverWatch::Taken taken = Take(absurd);
  EXPECT_TRUE(taken.fix);
  EXPECT_FALSE(taken.velocity);
  EXPECT_TRUE(Take(Report()).velocity);
  EXPECT_EQ(watch_.counters().refused, 1U);
  EXPECT_EQ(watch_.counters().velocities_refused, 1U);
  EXPECT_EQ(watch_.counters().fixes, 2U);
  EXPECT_EQ(watch_.counters().velocities, 1U);
}

TEST_F(ReceiverWatchTest, CountsJumpsAndLeavesThemToThoseWhoKnowTheTrack) {
  Connect();
  PlugIn();
  Take(Report());
  Take(Report());
  EXPECT_EQ(watch_.counters().jumps, 0U);
  ReceiverReport away = Report();
  away.latitude_deg += 0.1;
  EXPECT_TRUE(Take(away).fix);
  EXPECT_EQ(watch_.counters().jumps, 1U);
}

TEST_F(ReceiverWatchTest, ListensToOneOfTwoReceiversUntilItHasNoMoreToSay) {
  Connect();
  watch_.OnDevices({{kUsb, true}, {kOther, true}});
  Take(ReportWithoutFix(kUsb));
  EXPECT_TRUE(Take(Report(kOther)).fix) << "one with a fix is better than one without";
  EXPECT_FALSE(Take(Report(kUsb)).fix);
  EXPECT_EQ(watch_.counters().reports_of_others, 1U);
  EXPECT_EQ(watch_.device(), kOther);
  watch_.OnDevices({{kUsb, true}});
  EXPECT_TRUE(Take(Report(kUsb)).fix);
  seconds_ += 6;
  EXPECT_TRUE(Take(Report(kOther)).fix) << "the first one is silent";
}

TEST_F(ReceiverWatchTest, ListensOnlyToTheReceiverThatIsAskedFor) {
  ReceiverWatch::Config config;
  config.device = kOther;
  watch_ = ReceiverWatch(config);
  Connect();
  PlugIn(kUsb);
  EXPECT_FALSE(Take(Report(kUsb)).fix);
  EXPECT_EQ(State(), ReceiverState::kNoReceiver);
  EXPECT_THAT(Sentence(), HasSubstr("gpsd has no /dev/ttyUSB1 but /dev/ttyACM0"));
  PlugIn(kOther);
  EXPECT_TRUE(Take(Report(kOther)).fix);
}

}  // namespace
}  // namespace livemap::receiver
