#include "recordings/positions/position_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"
#include "common/utc_text.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::string TableRefusal(const std::string& text) {
  try {
    ParsePositionTable(text, std::nullopt, "a.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(PositionTable, ColumnsAreFoundByTheirNames) {
  const RecordedTrack track = ParsePositionTable(
      "Satellites,Longitude,Latitude,Speed (km/h),Time\n8,9.5,48.25,36,2026-01-31T12:34:56Z\n"
      "8,9.5,48.25,,1769862897.5\n8,,,,2026-01-31T12:34:59Z\n",
      std::nullopt, "a.csv");
  ASSERT_THAT(track.positions, SizeIs(2));
  EXPECT_DOUBLE_EQ(track.positions[0].position.longitude_deg, 9.5);
  EXPECT_EQ(Rfc3339(track.positions[1].stamp_ns), "2026-01-31T12:34:57.500Z");
  EXPECT_FALSE(track.positions[1].speed_mps);
  EXPECT_THAT(track.notes, Contains(HasSubstr("1 lines without a position")));
}

TEST(PositionTable, ASpeedHasTheUnitOfItsColumn) {
  const RecordedTrack track = ParsePositionTable(
      "time,lat,lon,speed_kmh\n1769862896,1,2,36\n1769862897,1,2,36\n", std::nullopt, "a.csv");
  EXPECT_NEAR(*track.positions[0].speed_mps, 10, 1e-9);
}

TEST(PositionTable, BetweenSemicolonsACommaIsTheDecimalMark) {
  const RecordedTrack track = ParsePositionTable(
      "time;lat;lon\n1769862896000;48,25;9,5\n1769862897000;48,25;9,5\n", std::nullopt, "a.csv");
  EXPECT_DOUBLE_EQ(track.positions[0].position.latitude_deg, 48.25);
  EXPECT_EQ(Rfc3339(track.positions[0].stamp_ns), "2026-01-31T12:34:56.000Z");
}

TEST(PositionTable, ATimeWithoutAZoneNeedsOne) {
  const std::string table = "time,lat,lon\n2026-01-31 14:34:56,1,2\n2026-01-31 14:34:57,1,2\n";
  EXPECT_THAT(TableRefusal(table), HasSubstr("line 2 of 'a.csv' has the time '2026-01-31 14:34:56' "
                                             "without a zone: --time-zone"));
  EXPECT_EQ(Rfc3339(ParsePositionTable(table, 7200, "a.csv").begin_ns()),
            "2026-01-31T12:34:56.000Z");
}

TEST(PositionTable, WrongLinesAreRefused) {
  EXPECT_THAT(TableRefusal(""), HasSubstr("'a.csv' is empty"));
  EXPECT_THAT(TableRefusal("x,y\n1,2\n"), HasSubstr("line 1 of 'a.csv' is 'x,y'"));
  EXPECT_THAT(TableRefusal("time,lat,lon\n1769862896,91,2\n"), HasSubstr("line 2 of 'a.csv'"));
  EXPECT_THAT(TableRefusal("time,lat,lon\n12,1,2\n"), HasSubstr("the time '12'"));
  EXPECT_THAT(TableRefusal("time,lat,lon\n1769862896,1,2\n"), HasSubstr("1 positions with a time"));
}

}  // namespace
}  // namespace livemap::recordings
