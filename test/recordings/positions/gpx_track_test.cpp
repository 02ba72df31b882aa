#include "recordings/positions/gpx_track.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::recordings {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::string GpxRefusal(const std::string& text) {
  try {
    ParseGpx(text, "a.gpx");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

std::string Gpx(const std::string& points, const std::string& attributes = "version=\"1.1\"") {
  return "<?xml version=\"1.0\"?>\n<gpx " + attributes + "><trk><trkseg>\n" + points +
         "</trkseg></trk></gpx>\n";
}

std::string Point(const std::string& time, const std::string& more = "",
                  const std::string& longitude = "9.5") {
  return "<trkpt lat=\"48.25\" lon=\"" + longitude + "\">" +
         (time.empty() ? "" : "<time>" + time + "</time>") + more + "</trkpt>\n";
}

TEST(GpxTrack, SpeedAndCourseComeFromGpx10AndFromExtensions) {
  const RecordedTrack old =
      ParseGpx(Gpx(Point("2026-01-31T12:00:00Z", "<course>91.5</course><speed>3</speed>") +
                       Point("2026-01-31T12:00:01.500Z"),
                   "version=\"1.0\""),
               "a.gpx");
  ASSERT_THAT(old.positions, SizeIs(2));
  EXPECT_DOUBLE_EQ(*old.positions[0].course_deg, 91.5);
  EXPECT_DOUBLE_EQ(*old.positions[0].speed_mps, 3);
  EXPECT_EQ(old.positions[1].stamp_ns - old.positions[0].stamp_ns, 1'500'000'000);
  EXPECT_FALSE(old.positions[1].speed_mps);
  const std::string extension =
      "<ele>200</ele><extensions><g:TrackPointExtension><g:speed>4.5</g:speed>"
      "<g:course>10</g:course></g:TrackPointExtension></extensions>";
  const RecordedTrack recent = ParseGpx(
      Gpx(Point("2026-01-31T12:00:00Z", extension) + Point("2026-01-31T12:00:01Z"),
          "version=\"1.1\" xmlns:g=\"http://www.garmin.com/xmlschemas/TrackPointExtension/v2\""),
      "a.gpx");
  EXPECT_DOUBLE_EQ(*recent.positions[0].speed_mps, 4.5);
  EXPECT_DOUBLE_EQ(*recent.positions[0].altitude_m, 200);
}

TEST(GpxTrack, PointsOutOfOrderRepeatedAndWithoutTimeAreMendedWithANote) {
  const RecordedTrack track =
      ParseGpx(Gpx(Point("2026-01-31T12:00:02Z") + Point("") + Point("2026-01-31T12:00:00Z") +
                   Point("2026-01-31T12:00:02Z") + Point("2026-01-31T12:05:00Z")),
               "a.gpx");
  EXPECT_THAT(track.positions, SizeIs(3));
  EXPECT_THAT(track.notes,
              ::testing::UnorderedElementsAre(HasSubstr("1 points without a time"),
                                              HasSubstr("earlier time than the line before"),
                                              HasSubstr("1 positions of a time that another has"),
                                              HasSubstr("1 gap of more than 10 s")));
}

TEST(GpxTrack, TwoPlacesAtOneTimeAreRefusedByBothLines) {
  EXPECT_THAT(
      GpxRefusal(Gpx(Point("2026-01-31T12:00:02Z") + Point("2026-01-31T12:00:02Z", "", "9.6"))),
      HasSubstr("lines 3 and 4 of 'a.gpx' state two places at 2026-01-31T12:00:02.000Z"));
}

TEST(GpxTrack, WrongValuesAreRefusedWithTheirLine) {
  EXPECT_THAT(GpxRefusal(Gpx(Point("yesterday"))),
              AllOf(HasSubstr("line 3 of 'a.gpx'"), HasSubstr("'yesterday'")));
  EXPECT_THAT(GpxRefusal(Gpx(Point("2026-01-31T12:00:02Z", "", "nan"))), HasSubstr("line 3"));
  EXPECT_THAT(GpxRefusal(Gpx(Point("2026-01-31T12:00:02Z", "", "181"))), HasSubstr("48.25, 181"));
  EXPECT_THAT(GpxRefusal(Gpx(Point("2026-01-31T12:00:02Z", "<speed>-1</speed>"))),
              HasSubstr("the speed '-1'"));
  EXPECT_THAT(GpxRefusal("<kml></kml>"), HasSubstr("accepted is <gpx>"));
  EXPECT_THAT(GpxRefusal("lat,lon\n"), HasSubstr("line 1 of 'a.gpx' is no XML"));
  EXPECT_THAT(GpxRefusal(""), HasSubstr("'a.gpx' is no XML"));
  EXPECT_THAT(GpxRefusal("<!DOCTYPE gpx [<!ENTITY a \"b\">]>\n<gpx></gpx>"), HasSubstr("DOCTYPE"));
}

TEST(GpxTrack, APlannedRouteWithoutTimesIsRefused) {
  EXPECT_THAT(GpxRefusal(Gpx(Point("") + Point(""))), HasSubstr("no point of 'a.gpx' has a time"));
}

}  // namespace
}  // namespace livemap::recordings
