#include "web/api/query.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "web/http/origin.h"
#include "web/http/static_files.h"
#include "web/http/web_config.h"

namespace livemap::web {
namespace {

HazardQuery Hazards(const std::string& parameters) {
  return ParseHazardQuery(ParseTarget("/api/v1/hazards?" + parameters));
}

std::string Complaint(const std::string& parameters) {
  try {
    Hazards(parameters);
  } catch (const BadRequest& mistake) {
    return mistake.what();
  }
  return "";
}

TEST(ParseTarget, SplitsAndDecodesPathAndParameters) {
  const RequestTarget target = ParseTarget("/a%20b/c?x=1%2C2&y=a+b&z&=v&&w=p=q#part");
  EXPECT_EQ(target.path, "/a b/c");
  const std::vector<std::pair<std::string, std::string>> expected{
      {"x", "1,2"}, {"y", "a b"}, {"z", ""}, {"", "v"}, {"w", "p=q"}};
  EXPECT_EQ(target.parameters, expected);
}

TEST(ParseTarget, RefusesMalformedAndOversizedAddresses) {
  EXPECT_THROW(ParseTarget(""), BadRequest);
  EXPECT_THROW(ParseTarget("http://host/"), BadRequest);
  EXPECT_THROW(ParseTarget("/%"), BadRequest);
  EXPECT_THROW(ParseTarget("/%4"), BadRequest);
  EXPECT_THROW(ParseTarget("/%zz"), BadRequest);
  EXPECT_THROW(ParseTarget("/%+1"), BadRequest);
  EXPECT_THROW(ParseTarget("/a%00b"), BadRequest);
  EXPECT_THROW(ParseTarget("/" + std::string(5000, 'a')), BadRequest);
  std::string many = "/?";
  for (int i = 0; i < 40; ++i) many += "a&";
  EXPECT_THROW(ParseTarget(many), BadRequest);
}

TEST(ParseHazardQuery, ReadsBoxSinceAndLimit) {
  const HazardQuery query = Hazards("bbox=-80.5,40,-79.25,41.5&since=17&limit=5");
  ASSERT_TRUE(query.box);
  EXPECT_EQ(query.box->south_west.longitude_deg, -80.5);
  EXPECT_EQ(query.box->south_west.latitude_deg, 40);
  EXPECT_EQ(query.box->north_east.longitude_deg, -79.25);
  EXPECT_EQ(query.box->north_east.latitude_deg, 41.5);
  EXPECT_EQ(query.since, 17U);
  EXPECT_EQ(query.limit, 5U);
  EXPECT_FALSE(Hazards("").box);
  EXPECT_FALSE(Hazards("").since);
}

TEST(ParseHazardQuery, AcceptsABoxAcrossTheAntimeridian) {
  EXPECT_TRUE(Hazards("bbox=179,-20,-179,-10").box->Contains({-15, 179.5}));
}

TEST(ParseHazardQuery, NamesParameterValueAndWhatIsAccepted) {
  EXPECT_THAT(Complaint("bbox=1,2,3"), testing::HasSubstr("bbox is '1,2,3', accepted is minLon"));
  EXPECT_THAT(Complaint("since=-1"), testing::HasSubstr("since is '-1', accepted is"));
  EXPECT_THAT(Complaint("limit=0"), testing::HasSubstr("limit is '0', accepted is"));
}

class BadParameters : public testing::TestWithParam<const char*> {};

TEST_P(BadParameters, AreRefused) { EXPECT_THROW(Hazards(GetParam()), BadRequest); }

INSTANTIATE_TEST_SUITE_P(
    ParseHazardQuery, BadParameters,
    testing::Values("bbox=", "bbox=1,2,3", "bbox=1,2,3,4,5", "bbox=a,2,3,4", "bbox=1,2,3,4x",
                    "bbox=nan,2,3,4", "bbox=inf,2,3,4", "bbox=-181,2,3,4", "bbox=1,2,181,4",
                    "bbox=1,-91,3,4", "bbox=1,2,3,91", "bbox=1,4,3,2", "bbox=1e999,2,3,4",
                    "bbox=%201,2,3,4", "since=", "since=-1", "since=1.5", "since=x",
                    "since=9223372036854775808", "since=99999999999999999999999", "limit=0",
                    "limit=-5", "limit=50001", "limit=1e3", "box=1,2,3,4", "since=1&since=2"));

TEST(ParseStreamQuery, AcceptsOnlySince) {
  EXPECT_EQ(ParseStreamQuery(ParseTarget("/ws?since=4")), 4U);
  EXPECT_FALSE(ParseStreamQuery(ParseTarget("/ws")));
  EXPECT_THROW(ParseStreamQuery(ParseTarget("/ws?from=4")), BadRequest);
}

TEST(Origin, OnlyOwnAndListedPagesMayOpenTheStream) {
  EXPECT_TRUE(IsAllowedOrigin("", "map.example:8080", {}));
  EXPECT_TRUE(IsAllowedOrigin("http://map.example:8080", "map.example:8080", {}));
  EXPECT_TRUE(IsAllowedOrigin("https://map.example", "map.example", {}));
  EXPECT_FALSE(IsAllowedOrigin("http://evil.example", "map.example:8080", {}));
  EXPECT_FALSE(IsAllowedOrigin("http://map.example:8080.evil.example", "map.example:8080", {}));
  EXPECT_FALSE(IsAllowedOrigin("null", "map.example:8080", {}));
  EXPECT_FALSE(IsAllowedOrigin("http://", "", {}));
  EXPECT_TRUE(IsAllowedOrigin("https://city.example", "map:1", {"https://city.example"}));
  EXPECT_TRUE(IsAllowedOrigin("https://map.example", "map.example", {}, true));
  EXPECT_FALSE(IsAllowedOrigin("http://map.example", "map.example", {}, true));
}

TEST(TileSource, AdmitsOnlyTheTilesHost) {
  EXPECT_EQ(TileSource(""), "");
  EXPECT_EQ(TileSource("/tiles/{z}/{x}/{y}.png"), "");
  EXPECT_EQ(TileSource("https://{s}.tiles.example/{z}/{x}/{y}.png"), "https://*.tiles.example");
  EXPECT_EQ(TileSource("http://localhost:8081/{z}/{x}/{y}.png"), "http://localhost:8081");
}

TEST(TileSource, RefusesWhatIsNoTileAddress) {
  EXPECT_THROW(TileSource("https://tiles.example/"), Error);
  EXPECT_THROW(TileSource("ftp://tiles.example/{z}/{x}/{y}"), Error);
  EXPECT_THROW(TileSource("https://a; script-src */{z}/{x}/{y}"), Error);
  EXPECT_THROW(TileSource("javascript:alert(1)/{z}/{x}/{y}"), Error);
}

TEST(StaticFiles, FindsOnlyFilesOfTheFolder) {
  const StaticFiles files(LIVEMAP_SOURCE_DIR "/web");
  ASSERT_TRUE(files.Find("index.html"));
  EXPECT_EQ(files.Find("index.html")->content_type, "text/html; charset=utf-8");
  EXPECT_TRUE(files.Find("icons/pothole.svg"));
  for (const char* name : {"", "icons", "icons/", "../package.xml", "icons/../index.html",
                           "/etc/passwd", "./index.html", "index.html\n", "icons//pothole.svg",
                           "icons\\pothole.svg", "..", "absent.html"}) {
    EXPECT_FALSE(files.Find(name)) << name;
  }
}

TEST(Validate, NamesTheBadOption) {
  WebConfig options;
  options.web_root = "/nowhere";
  try {
    Validate(options);
    FAIL() << "a missing web_root was accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("web_root is '/nowhere', accepted is"));
  }
  options.web_root = LIVEMAP_SOURCE_DIR "/web";
  EXPECT_NO_THROW(Validate(options));
  options.feed_country = "other";  // DATEX II version 3 takes two letters.
  EXPECT_THROW(Validate(options), Error);
  options.feed_country = "us";
  options.port = 70000;
  EXPECT_THROW(Validate(options), Error);
}

}  // namespace
}  // namespace livemap::web
