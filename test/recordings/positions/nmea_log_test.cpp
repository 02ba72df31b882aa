#include "recordings/positions/nmea_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>

#include "common/error.h"
#include "common/utc_text.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::string Sentence(const std::string& body) {
  unsigned int sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  char text[8];
  std::snprintf(text, sizeof text, "*%02X\r\n", sum);
  return "$" + body + text;
}

std::string Rmc(const std::string& time, const std::string& date, const std::string& status = "A") {
  return Sentence("GPRMC," + time + "," + status + ",4815.000,N,00930.000,W,19.4384,90.0," + date +
                  ",,");
}

std::string NmeaRefusal(const std::string& text) {
  try {
    ParseNmea(text, "a.nmea");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(NmeaLog, TheSentencesOfOneTimeAreOnePosition) {
  const RecordedTrack track = ParseNmea(
      Sentence("GNGGA,123456.00,4815.000,N,00930.000,W,1,08,0.9,210.0,M,47.0,M,,") +
          Rmc("123456.00", "310126") + Sentence("GNGST,123456.00,1.1,2.0,1.0,45,3.0,4.0,9.0") +
          Sentence("GNGGA,123457.00,4815.000,N,00930.000,W,1,08,0.9,210.0,M,47.0,M,,") +
          Sentence("GNVTG,45.0,T,,M,10.0,N,18.5,K,A"),
      "a.nmea");
  ASSERT_THAT(track.positions, SizeIs(2));
  const RecordedPosition& first = track.positions[0];
  EXPECT_EQ(Rfc3339(first.stamp_ns), "2026-01-31T12:34:56.000Z");
  EXPECT_NEAR(first.position.latitude_deg, 48.25, 1e-9);
  EXPECT_NEAR(first.position.longitude_deg, -9.5, 1e-9);
  EXPECT_NEAR(*first.speed_mps, 10, 1e-3);
  EXPECT_DOUBLE_EQ(*first.course_deg, 90);
  EXPECT_DOUBLE_EQ(*first.altitude_m, 210);
  EXPECT_NEAR(*first.sigma_m, std::sqrt(12.5), 1e-9);
  const RecordedPosition& second = track.positions[1];
  EXPECT_EQ(Rfc3339(second.stamp_ns), "2026-01-31T12:34:57.000Z");
  EXPECT_DOUBLE_EQ(*second.course_deg, 45);
  EXPECT_NEAR(*second.speed_mps, 5.144, 1e-3);
}

TEST(NmeaLog, ATimeAfterMidnightIsOfTheNextDay) {
  const RecordedTrack track =
      ParseNmea(Rmc("235959.5", "311225") +
                    Sentence("GPGGA,000000.5,4815.000,N,00930.000,W,1,08,0.9,210.0,M,47.0,M,,"),
                "a.nmea");
  ASSERT_THAT(track.positions, SizeIs(2));
  EXPECT_EQ(Rfc3339(track.positions[1].stamp_ns), "2026-01-01T00:00:00.500Z");
}

TEST(NmeaLog, YearsOfTwoDigitsAre1980To2079) {
  EXPECT_EQ(Rfc3339(ParseNmea(Rmc("000000", "010199") + Rmc("000001", "010199"), "a").begin_ns()),
            "1999-01-01T00:00:00.000Z");
}

TEST(NmeaLog, CorruptAndInvalidSentencesAreLeftOutWithANote) {
  std::string corrupt = Rmc("120002", "310126");
  corrupt[20] = '9';
  const RecordedTrack track = ParseNmea("[12] " + Rmc("120000", "310126") + corrupt +
                                            Rmc("120003", "310126", "V") + Rmc("120004", "310126"),
                                        "a.nmea");
  EXPECT_THAT(track.positions, SizeIs(2));
  EXPECT_THAT(track.notes, Contains(HasSubstr("1 sentences without a valid checksum")));
  EXPECT_THAT(track.notes, Contains(HasSubstr("1 positions that the receiver calls invalid")));
}

TEST(NmeaLog, WhatIsNoLogIsRefused) {
  EXPECT_THAT(NmeaRefusal("hello\n"), HasSubstr("'a.nmea' has no NMEA sentence"));
  EXPECT_THAT(NmeaRefusal("$GPRMC,1*00\n$GPRMC,2*00\n"), HasSubstr("2 sentences without a valid"));
  EXPECT_THAT(NmeaRefusal(Rmc("250000", "310126")), HasSubstr("line 1 of 'a.nmea' has the time"));
  EXPECT_THAT(NmeaRefusal(Rmc("120000", "310226")), HasSubstr("the date '310226'"));
  EXPECT_THAT(
      NmeaRefusal(Sentence("GPGGA,000000.5,4815.000,N,00930.000,W,1,08,0.9,210.0,M,47.0,M,,")),
      HasSubstr("has no date"));
  EXPECT_THAT(NmeaRefusal(Sentence("GPRMC,120000,A,9115.000,N,00930.000,W,1,1,310126,,")),
              HasSubstr("a place on the earth"));
  EXPECT_THAT(NmeaRefusal(Sentence("GPRMC,120000,A,4860.000,N,00930.000,W,1,1,310126,,")),
              HasSubstr("the coordinate '4860.000,N'"));
  EXPECT_THAT(NmeaRefusal(Sentence("GPRMC,120000,A,48152222222222.0,N,00930.000,W,1,1,310126,,")),
              HasSubstr("the coordinate '48152222222222.0,N'"));
}

}  // namespace
}  // namespace livemap::recordings
