#include "web/ogc/ogc_query.h"

#include <gtest/gtest.h>

#include <string>

namespace livemap::web {
namespace {

constexpr std::int64_t kOgcSecondNs = 1'000'000'000;

OgcQuery ParseOgc(const std::string& parameters) {
  return ParseOgcQuery(ParseTarget("/ogc/collections/hazards/items?" + parameters));
}

TEST(ParseOgcQuery, ReadsAllParameters) {
  const OgcQuery query = ParseOgc("bbox=-80,40,-79,41&limit=5&cursor=17");
  EXPECT_EQ(query.box->south_west.latitude_deg, 40);
  EXPECT_EQ(query.limit, 5U);
  EXPECT_EQ(query.cursor, 17U);
  EXPECT_FALSE(query.time);
}

TEST(ParseOgcQuery, HeightsOfABoxDoNotCount) {
  const OgcQuery query = ParseOgc("bbox=-80,40,-100,-79,41,9000");
  EXPECT_EQ(query.box->south_west.latitude_deg, 40);
  EXPECT_EQ(query.box->north_east.longitude_deg, -79);
}

TEST(ParseOgcQuery, ALargerLimitMeansTheLargest) {
  EXPECT_EQ(ParseOgc("limit=10001").limit, kMaxOgcItems);
  EXPECT_EQ(ParseOgc("limit=18446744073709551615").limit, kMaxOgcItems);
}

class BadOgcParameters : public testing::TestWithParam<const char*> {};

TEST_P(BadOgcParameters, AreRefused) { EXPECT_THROW(ParseOgc(GetParam()), BadRequest); }

INSTANTIATE_TEST_SUITE_P(
    ParseOgcQuery, BadOgcParameters,
    testing::Values("bbox=1,2,3", "bbox=1,2,3,4,5", "bbox=1,2,x,3,4,5", "bbox=1,2,3,4,5,6,7",
                    "bbox=40,-200,41,-79", "limit=0", "limit=-1", "limit=x", "limit=1.5",
                    "limit=", "cursor=x", "cursor=-1", "f=json", "crs=x", "limit=1&limit=2",
                    "datetime=", "datetime=2026", "datetime=2026-01-01",
                    "datetime=2026-02-30T00:00:00Z", "datetime=2026-01-01T24:00:00Z",
                    "datetime=2026-01-01T00:00:00",
                    "datetime=2026-01-01T00:00:00+01:00",  // A '+' is a blank.
                    "datetime=2026-01-01T00:00:00.Z", "datetime=../..", "datetime=/",
                    "datetime=2026-01-02T00:00:00Z/2026-01-01T00:00:00Z",
                    "datetime=9999-01-01T00:00:00Z", "datetime=2026-01-01T00:00:00Z/x"));

TEST(ParseDatetime, ReadsTimesAndIntervals) {
  const TimeSpan moment = ParseDatetime("2026-01-01T00:00:00Z");
  EXPECT_EQ(moment.begin_ns, 1'767'225'600 * kOgcSecondNs);
  EXPECT_EQ(moment.end_ns, moment.begin_ns);
  EXPECT_EQ(ParseDatetime("2026-01-01t01:30:00.25+01:30").begin_ns,
            moment.begin_ns + kOgcSecondNs / 4);
  EXPECT_EQ(ParseDatetime("1969-12-31T19:00:00-05:00").begin_ns, 0);
  EXPECT_EQ(ParseDatetime("2024-02-29T00:00:00Z/..").begin_ns, 1'709'164'800 * kOgcSecondNs);
  EXPECT_EQ(ParseDatetime("/1970-01-01T00:00:01Z").end_ns, kOgcSecondNs);
}

TEST(TimeSpan, MeetsWhatHasAMomentInCommon) {
  const TimeSpan span{10, 20};
  EXPECT_TRUE(span.Meets(0, 10));
  EXPECT_TRUE(span.Meets(20, 30));
  EXPECT_TRUE(span.Meets(12, 13));
  EXPECT_FALSE(span.Meets(0, 9));
  EXPECT_FALSE(span.Meets(21, 30));
}

TEST(NextPage, KeepsTheOtherParameters) {
  const RequestTarget target =
      ParseTarget("/ogc/items?limit=2&cursor=4&datetime=2026-01-01T00:00:00%2B01:00/..");
  EXPECT_EQ(NextPage(target, 9),
            "/ogc/items?limit=2&datetime=2026-01-01T00:00:00%2b01:00/..&cursor=9");
}

}  // namespace
}  // namespace livemap::web
