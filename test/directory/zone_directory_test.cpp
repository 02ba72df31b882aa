#include "directory/zone_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "common/error.h"
#include "test/directory/test_authority.h"

namespace livemap::directory {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

Json Square(double south, double west, double side) {
  const double north = south + side;
  const double east = west + side;
  return Json::array({{west, south}, {east, south}, {east, north}, {west, north}, {west, south}});
}

Json Zone(const std::string& id, const Json& ring) {
  return {{"type", "Feature"},
          {"id", id},
          {"geometry", {{"type", "Polygon"}, {"coordinates", Json::array({ring})}}},
          {"properties", {{"brokers", {{{"host", id + ".example.org"}}}}}}};
}

Json Collection(const std::vector<Json>& zones) {
  return {{"type", "FeatureCollection"},
          {"livemap_zone_directory", 1},
          {"authority", "town"},
          {"version", 5},
          {"issued", "2026-02-01T00:00:00Z"},
          {"expires", "2026-05-01T00:00:00Z"},
          {"features", zones}};
}

ZoneDirectory ParseJson(const Json& json) { return ZoneDirectory::Parse(json.dump(), "zones"); }

std::string WhyNotText(const std::string& text) {
  try {
    ZoneDirectory::Parse(text, "zones");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}
std::string WhyNot(const Json& json) { return WhyNotText(json.dump()); }

/// The collection of one zone with something at the pointer put in place of what is there.
std::string WhyNotWith(const char* pointer, const Json& value) {
  Json json = Json::parse(DirectoryText(5));
  json[Json::json_pointer(pointer)] = value;
  return WhyNot(json);
}

/// West and east with 0.01 degrees in common, and a gap of 0.01 degrees before south.
ZoneDirectory Town() {
  return ParseJson(Collection({Zone("west", Square(40.40, -80.00, 0.05)),
                               Zone("east", Square(40.40, -79.96, 0.05)),
                               Zone("south", Square(40.34, -80.00, 0.05))}));
}

TEST(ZoneDirectory, ReadsVersionTimesAndZones) {
  const ZoneDirectory directory = ZoneDirectory::Parse(DirectoryText(12), "zones");
  EXPECT_EQ(directory.authority(), "town");
  EXPECT_EQ(directory.version(), 12U);
  EXPECT_EQ(directory.issued_ns(), 1'769'904'000'000'000'000);
  EXPECT_EQ(directory.expires_ns(), 1'777'593'600'000'000'000);
  ASSERT_EQ(directory.zones().size(), 1U);
  EXPECT_EQ(directory.zones()[0].id, "oakland");
  EXPECT_EQ(directory.zones()[0].name, "Oakland");
  ASSERT_EQ(directory.zones()[0].brokers.size(), 1U);
  EXPECT_EQ(directory.zones()[0].brokers[0].host, "zone.example.org");
  EXPECT_EQ(directory.zones()[0].brokers[0].port, 8883);
  EXPECT_EQ(directory.zones()[0].brokers[0].fingerprint, "");
}

TEST(ZoneDirectory, ReadsMultiPolygonsWithHolesAndLeavesOutWhatItDoesNotKnow) {
  Json zone = Zone("town", Square(40, -80, 0.1));
  zone["geometry"] = {{"type", "MultiPolygon"},
                      {"coordinates",
                       {Json::array({Square(40, -80, 0.1), Square(40.04, -79.96, 0.02)}),
                        Json::array({Square(41, -80, 0.1)})}}};
  zone["properties"]["colour"] = "red";
  const ZoneDirectory directory = ParseJson(Collection({zone}));
  EXPECT_EQ(directory.zones()[0].area.rings().size(), 3U);
  EXPECT_EQ(directory.Find({40.05, -79.95}, 0), std::nullopt);
  EXPECT_NE(directory.Find({41.05, -79.95}, 0), std::nullopt);
}

TEST(ZoneDirectory, AnOverlapIsDividedInItsMiddle) {
  const ZoneDirectory town = Town();
  const auto zone_at = [&](double longitude) {
    return town.zones()[town.Find({40.42, longitude}, 0)->zone].id;
  };
  EXPECT_EQ(zone_at(-79.9551), "west");
  EXPECT_EQ(zone_at(-79.9549), "east");
}

TEST(ZoneDirectory, AGapIsDividedInItsMiddleAsFarAsItIsNarrow) {
  const ZoneDirectory town = Town();
  const auto above = town.Find({40.3951, -79.98}, 2000);
  ASSERT_TRUE(above);
  EXPECT_EQ(town.zones()[above->zone].id, "west");
  EXPECT_NEAR(above->depth_m, -544, 1);
  const auto below = town.Find({40.3949, -79.98}, 2000);
  ASSERT_TRUE(below);
  EXPECT_EQ(town.zones()[below->zone].id, "south");
  EXPECT_EQ(town.Find({40.3949, -79.98}, 500), std::nullopt);
  EXPECT_EQ(town.Find({50, 0}, 2000), std::nullopt);
}

TEST(ZoneDirectory, WhatIsNoneIsRefusedInOneSentenceThatSaysWhere) {
  EXPECT_THAT(WhyNotText(std::string("{\"type\": ")),
              HasSubstr("'zones' is no JSON: it is wrong at byte"));
  EXPECT_THAT(WhyNotText(std::string("[]")), HasSubstr("accepted is an object"));
  EXPECT_THAT(WhyNotWith("/type", "Feature"), HasSubstr("'type' is \"Feature\""));
  EXPECT_THAT(WhyNotWith("/livemap_zone_directory", 2), HasSubstr("is 2, accepted is 1"));
  EXPECT_THAT(WhyNotWith("/authority", "a/b"), HasSubstr("'authority' is \"a/b\""));
  EXPECT_THAT(WhyNotWith("/version", 0), HasSubstr("'version' is 0"));
  EXPECT_THAT(WhyNotWith("/version", -1), HasSubstr("'version' is -1"));
  EXPECT_THAT(WhyNotWith("/version", 1.5), HasSubstr("'version' is 1.5"));
  EXPECT_THAT(WhyNotWith("/version", 9007199254740992U), HasSubstr("'version' is 90071992547409"));
  EXPECT_THAT(WhyNotWith("/issued", "yesterday"), HasSubstr("'issued' is \"yesterday\""));
  EXPECT_THAT(
      WhyNotWith("/expires", "2026-01-31T00:00:00Z"),
      HasSubstr("'expires' is 2026-01-31T00:00:00Z, accepted is a time after it was issued"));
  EXPECT_THAT(WhyNotWith("/features", Json::array()), HasSubstr("'features' is a list of 0"));
  EXPECT_THAT(WhyNotWith("/features/0/id", "a b"), HasSubstr("feature 0: 'id' is \"a b\""));
  EXPECT_THAT(WhyNotWith("/features/0/id", 7), HasSubstr("'id' is 7"));
  EXPECT_THAT(WhyNotWith("/features/0/properties/name", "\u202eolleh"), HasSubstr("'name' is"));
  EXPECT_THAT(WhyNotWith("/features/0/properties/brokers", Json::array()),
              HasSubstr("'brokers' is a list of 0"));
  EXPECT_THAT(WhyNotWith("/features/0/properties/brokers/0/host", "a b"), HasSubstr("'host' is"));
  EXPECT_THAT(WhyNotWith("/features/0/properties/brokers/0/host", "-oProxy"),
              HasSubstr("'host' is"));
  EXPECT_THAT(WhyNotWith("/features/0/properties/brokers/0/port", 65536), HasSubstr("'port' is"));
  EXPECT_THAT(WhyNotWith("/features/0/properties/brokers/0/port", -1), HasSubstr("'port' is"));
  EXPECT_THAT(WhyNotWith("/features/0/properties/brokers/0/fingerprint", "AB"),
              HasSubstr("'fingerprint' is \"AB\""));
  EXPECT_THAT(WhyNotWith("/features/0/geometry/type", "Point"),
              HasSubstr("the geometry's 'type' is \"Point\", accepted is Polygon or MultiPolygon"));
  EXPECT_THAT(WhyNotWith("/features/0/geometry/coordinates/0/4", {-79.0, 40.0}),
              HasSubstr("the last as the first"));
  EXPECT_THAT(WhyNotWith("/features/0/geometry/coordinates/0/1", {"west", 40.0}),
              HasSubstr("a corner is a list of 2, accepted is [longitude, latitude]"));
  EXPECT_THAT(WhyNotWith("/features/0/geometry/coordinates/0/1", {40.43, -89.94}),
              HasSubstr("accepted are degrees of WGS84"));
}

TEST(ZoneDirectory, TwoZonesOfOneIdAreRefused) {
  EXPECT_THAT(
      WhyNot(Collection({Zone("a", Square(40, -80, 0.1)), Zone("a", Square(41, -80, 0.1))})),
      HasSubstr("feature 1: the id 'a' is there twice"));
}

TEST(ZoneDirectory, ABombOfPolygonsIsRefused) {
  Json ring = Json::array();
  for (int i = 0; i < 50'001; ++i) ring.push_back({-80 + 1e-6 * i, 40});
  EXPECT_THAT(WhyNot(Collection({Zone("a", ring)})), HasSubstr("at most 50000 of all"));
  EXPECT_THAT(WhyNotText(std::string((2 << 20) + 1, ' ')),
              HasSubstr("accepted are at most 2097152"));
  EXPECT_THAT(WhyNotText(std::string(1 << 20, '[')), HasSubstr("nests values more than 12 deep"));
  EXPECT_THAT(WhyNotText(R"({"version": 1e999})"), HasSubstr("a number that is too large"));
}

TEST(ZoneChoice, AVehicleOnTheBorderStaysWithItsZone) {
  const ZoneDirectory town = Town();
  ZoneChoice choice(ZoneChoice::Config{});
  const auto zone_at = [&](double longitude) {
    const auto zone = choice.Update(town, {40.42, longitude});
    return zone ? town.zones()[*zone].id : "none";
  };
  // A ten-thousandth of a degree is 8.5 m here, and the border lies at -79.955.
  EXPECT_EQ(zone_at(-79.9560), "west");
  EXPECT_EQ(zone_at(-79.9548), "west");
  EXPECT_EQ(zone_at(-79.9546), "east");
  EXPECT_EQ(zone_at(-79.9552), "east");
  EXPECT_EQ(zone_at(-79.9554), "west");
}

TEST(ZoneChoice, FarFromAllZonesThereIsNone) {
  const ZoneDirectory town = Town();
  ZoneChoice choice(ZoneChoice::Config{});
  EXPECT_TRUE(choice.Update(town, {40.42, -79.98}));
  EXPECT_FALSE(choice.Update(town, {42, -79.98}));
  EXPECT_TRUE(choice.Update(town, {40.42, -79.98}));
}

TEST(ZoneChoice, AZoneThatIsNoLongerListedIsLeft) {
  ZoneChoice choice(ZoneChoice::Config{});
  const ZoneDirectory town = Town();
  EXPECT_EQ(town.zones()[*choice.Update(town, {40.42, -79.9551})].id, "west");
  const ZoneDirectory smaller = ParseJson(Collection({Zone("east", Square(40.40, -79.96, 0.05))}));
  EXPECT_EQ(smaller.zones()[*choice.Update(smaller, {40.42, -79.9551})].id, "east");
}

TEST(ZoneChoice, WaysThatAreNoneAreRefused) {
  EXPECT_THROW(ZoneChoice({-1, 0}), Error);
  EXPECT_THROW(ZoneChoice({0, std::nan("")}), Error);
}

TEST(FindOverlaps, TellsZonesThatClaimTheSameStreets) {
  const ZoneDirectory town = Town();
  const auto overlaps = FindOverlaps(town, 300);
  ASSERT_EQ(overlaps.size(), 1U);
  EXPECT_EQ(town.zones()[overlaps[0].first].id, "west");
  EXPECT_EQ(town.zones()[overlaps[0].second].id, "east");
  EXPECT_NEAR(overlaps[0].depth_m, 848, 2);
  EXPECT_TRUE(FindOverlaps(town, 900).empty());
}

}  // namespace
}  // namespace livemap::directory
