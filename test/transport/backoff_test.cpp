#include "transport/backoff.h"

#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::transport {
namespace {

TEST(Backoff, DoublesUpToTheMaximumWithJitterBelow) {
  Backoff backoff(1.0, 8.0, 1);
  for (const double expected : {1.0, 2.0, 4.0, 8.0, 8.0, 8.0}) {
    const double delay = backoff.NextDelayS();
    EXPECT_GE(delay, expected / 2);
    EXPECT_LE(delay, expected);
  }
}

TEST(Backoff, StartsAgainAfterAReset) {
  Backoff backoff(1.0, 64.0, 1);
  for (int i = 0; i < 5; ++i) backoff.NextDelayS();
  backoff.Reset();
  EXPECT_LE(backoff.NextDelayS(), 1.0);
}

TEST(Backoff, DiffersBetweenSeedsAndRepeatsWithOne) {
  EXPECT_EQ(Backoff(1, 8, 5).NextDelayS(), Backoff(1, 8, 5).NextDelayS());
  EXPECT_NE(Backoff(1, 8, 5).NextDelayS(), Backoff(1, 8, 6).NextDelayS());
}

TEST(Backoff, RefusesDelaysThatWouldHammerOrShrink) {
  EXPECT_THROW(Backoff(0, 1, 1), Error);
  EXPECT_THROW(Backoff(2, 1, 1), Error);
}

}  // namespace
}  // namespace livemap::transport
