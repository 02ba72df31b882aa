#include "web/access/confirmed_sessions.h"

#include <gtest/gtest.h>

namespace livemap::web {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

TEST(ConfirmedSessions, APasswordCountsForItsOwnSessionUntilItsTimeIsOver) {
  ConfirmedSessions sessions(300);
  EXPECT_FALSE(sessions.IsConfirmed("mine", 0));
  sessions.Confirm("mine", 10 * kSecondNs);
  EXPECT_TRUE(sessions.IsConfirmed("mine", 309 * kSecondNs));
  EXPECT_FALSE(sessions.IsConfirmed("mine", 310 * kSecondNs));
  EXPECT_FALSE(sessions.IsConfirmed("another", 11 * kSecondNs));
  EXPECT_FALSE(sessions.IsConfirmed("", 11 * kSecondNs)) << "nobody has logged in";
}

TEST(ConfirmedSessions, AnotherPasswordBeginsTheTimeAnew) {
  ConfirmedSessions sessions(300);
  sessions.Confirm("mine", 0);
  sessions.Confirm("old", 0);
  sessions.Confirm("mine", 200 * kSecondNs);
  EXPECT_TRUE(sessions.IsConfirmed("mine", 450 * kSecondNs));
  EXPECT_FALSE(sessions.IsConfirmed("old", 450 * kSecondNs));
}

}  // namespace
}  // namespace livemap::web
