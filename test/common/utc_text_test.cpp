#include "common/utc_text.h"

#include <gtest/gtest.h>

namespace livemap {
namespace {

TEST(Rfc3339, WritesMillisecondsOfAnyStamp) {
  EXPECT_EQ(Rfc3339(0), "1970-01-01T00:00:00.000Z");
  EXPECT_EQ(Rfc3339(1'500'999'999), "1970-01-01T00:00:01.500Z");
  EXPECT_EQ(Rfc3339(-1'000'000), "1969-12-31T23:59:59.999Z");
  EXPECT_EQ(Rfc3339(1'767'225'600'250'000'000), "2026-01-01T00:00:00.250Z");
}

TEST(Rfc3339, WritesWholeSecondsAndDaysOfTheSameMoment) {
  EXPECT_EQ(Rfc3339Seconds(1'767'225'600'250'000'000), "2026-01-01T00:00:00Z");
  EXPECT_EQ(Rfc3339Seconds(-1'000'000), "1969-12-31T23:59:59Z");
  EXPECT_EQ(UtcDay(1'767'225'599'999'000'000), "2025-12-31");
  EXPECT_EQ(UtcDay(-1), "1969-12-31");
}

TEST(Rfc3339, IsReadAsItIsWritten) {
  EXPECT_EQ(ParseRfc3339Seconds("1970-01-01T00:00:00Z"), 0);
  EXPECT_EQ(ParseRfc3339Seconds("2026-01-01T00:00:00Z"), 1'767'225'600'000'000'000);
  EXPECT_EQ(ParseRfc3339Seconds("2024-02-29T23:59:59Z"), 1'709'251'199'000'000'000);
}

TEST(Rfc3339, OtherTextsAndDatesThatAreNoneAreNotRead) {
  for (const char* text :
       {"", "2026-01-01", "2026-01-01T00:00:00", "2026-01-01 00:00:00Z", "2026-01-01T00:00:00+0",
        "2026-02-29T00:00:00Z", "2026-13-01T00:00:00Z", "2026-00-10T00:00:00Z",
        "2026-01-01T24:00:00Z", "2026-01-01T00:60:00Z", "2026-01-01T00:00:60Z",
        "1969-12-31T23:59:59Z", "2106-01-01T00:00:00Z", "2026-01-0xT00:00:00Z"}) {
    EXPECT_EQ(ParseRfc3339Seconds(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace livemap
