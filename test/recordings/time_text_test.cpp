#include "recordings/time_text.h"

#include <gtest/gtest.h>

#include "common/utc_text.h"

namespace livemap::recordings {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
// 2026-01-31T12:34:56Z.
constexpr std::int64_t kStamp = 1769862896 * kSecond;

TEST(TimeText, TimesOfDevicesAreReadWhateverTheirSeparators) {
  for (const char* text : {"2026-01-31T12:34:56Z", "2026:01:31 12:34:56Z", "20260131T123456Z",
                           "2026-01-31T14:34:56+02:00", "2026-01-31T09:04:56-0330"}) {
    const auto time = ParseTimeText(text);
    ASSERT_TRUE(time) << text;
    EXPECT_EQ(time->stamp_ns, kStamp) << text;
    EXPECT_TRUE(time->has_zone) << text;
  }
  const auto local = ParseTimeText("2026/01/31 12:34:56.25");
  ASSERT_TRUE(local);
  EXPECT_EQ(local->stamp_ns, kStamp + kSecond / 4);
  EXPECT_FALSE(local->has_zone);
}

TEST(TimeText, WhatIsNoTimeIsNone) {
  for (const char* text :
       {"", "2026-01-31", "2026-02-30T00:00:00Z", "2026-13-01T00:00:00Z", "1904-01-01T00:00:00Z",
        "2026-01-31T24:00:00Z", "2026-01-31T12:34:56Zx", "2026-01-31T12:34:56+99:00",
        "2026-01-31T12:34:56.", "99999-01-31T12:34:56Z"}) {
    EXPECT_FALSE(ParseTimeText(text)) << text;
  }
}

TEST(TimeText, ALeapDayIsInLeapYearsAlone) {
  EXPECT_TRUE(ParseTimeText("2024-02-29T00:00:00Z"));
  EXPECT_FALSE(ParseTimeText("2025-02-29T00:00:00Z"));
  EXPECT_FALSE(ParseTimeText("2100-02-29T00:00:00Z"));
}

TEST(TimeText, ATimeIsWrittenAsItIsRead) {
  EXPECT_EQ(Rfc3339(kStamp + 250'000'000), "2026-01-31T12:34:56.250Z");
  EXPECT_EQ(ParseTimeText(Rfc3339(kStamp))->stamp_ns, kStamp);
}

TEST(TimeText, ZonesHaveSignHoursAndMinutes) {
  EXPECT_EQ(ParseZone("+02:00"), 7200);
  EXPECT_EQ(ParseZone("-0330"), -12600);
  EXPECT_EQ(ParseZone("2"), 7200);
  EXPECT_EQ(ParseZone("Z"), 0);
  EXPECT_FALSE(ParseZone("CET"));
  EXPECT_FALSE(ParseZone("+99:00"));
}

TEST(TimeText, ARecordersFileNameSaysWhenItBegan) {
  for (const char* name : {"20260131_123456.mp4", "2026_0131_123456_001F.MP4",
                           "VID_20260131_123456.mov", "2026-01-31 12-34-56.mp4"}) {
    EXPECT_EQ(TimeOfFileName(name), kStamp) << name;
  }
  EXPECT_FALSE(TimeOfFileName("GH010123.MP4"));
  EXPECT_FALSE(TimeOfFileName("123456789012345678.mp4"));
}

}  // namespace
}  // namespace livemap::recordings
