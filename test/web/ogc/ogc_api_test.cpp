#include "web/ogc/ogc_api.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "streets/street_map.h"
#include "test/web/feeds/answer_content.h"
#include "test/web/zone_fixture.h"

namespace livemap::web {
namespace {

constexpr char kItems[] = "/ogc/collections/hazards/items";
constexpr Visibility kOgcToldOnly{true, false, false};

/// Forbes Ave eastwards, way 11, crossed by S Craig St, way 12.
std::shared_ptr<const streets::StreetMap> OgcTown() {
  streets::StreetMapBuilder builder;
  streets::Street street;
  street.id = 11;
  builder.AddStreet(street, "Forbes Ave", {1, 2, 3});
  street.id = 12;
  builder.AddStreet(street, "S Craig St", {4, 2, 5});
  builder.SetPlace(1, {40.44, -79.96});
  builder.SetPlace(2, {40.44, -79.95});
  builder.SetPlace(3, {40.44, -79.94});
  builder.SetPlace(4, {40.43, -79.95});
  builder.SetPlace(5, {40.45, -79.95});
  return std::make_shared<const streets::StreetMap>(builder.Build());
}

class OgcApiTest : public testing::Test {
 protected:
  HttpResponse Ask(const std::string& target, const Visibility& sees = {}) {
    HttpRequest question;
    question.method = "GET";
    question.target = target;
    question.host = "map.example";
    return api_.Answer(ParseTarget(target), question, sees);
  }
  nlohmann::json AskJson(const std::string& target, const Visibility& sees = {}) {
    return nlohmann::json::parse(ContentOf(Ask(target, sees)).text);
  }
  std::string Add(const std::string& class_name, double latitude, double longitude) {
    return fixture_.zone->Handle(fixture_.MakeReport(class_name, {latitude, longitude}))
        .hazard_uuid.ToString();
  }
  static std::string LinkOf(const nlohmann::json& json, const std::string& relation) {
    for (const auto& link : json["links"]) {
      if (link["rel"] == relation) return link["href"];
    }
    return "";
  }

  ZoneFixture fixture_{OgcTown()};
  WebConfig options_ = TestOptions();
  OgcApi api_{{options_, *fixture_.zone, fixture_.catalogue, [] { return ZoneFixture::kStartNs; }}};
};

TEST_F(OgcApiTest, TheLandingPageLeadsEverywhere) {
  for (const char* address : {"/ogc", "/ogc/"}) {
    const auto page = AskJson(address);
    EXPECT_EQ(LinkOf(page, "service-desc"), "http://map.example/ogc/api");
    EXPECT_EQ(LinkOf(page, "conformance"), "http://map.example/ogc/conformance");
    EXPECT_EQ(LinkOf(page, "data"), "http://map.example/ogc/collections");
  }
  const auto collections = AskJson("/ogc/collections")["collections"];
  ASSERT_EQ(collections.size(), 3U);
  for (const auto& collection : collections) {
    EXPECT_EQ(AskJson(LinkOf(collection, "self").substr(18)), collection);
    EXPECT_EQ(Ask(LinkOf(collection, "items").substr(18)).status, 200);
  }
  EXPECT_EQ(AskJson("/ogc/conformance")["conformsTo"].size(), 3U);
}

TEST_F(OgcApiTest, TheDescriptionReferencesWhatItHas) {
  const HttpResponse answer = Ask("/ogc/api");
  EXPECT_EQ(answer.content_type, kOpenApiType);
  const auto document = nlohmann::json::parse(answer.content);
  EXPECT_EQ(document["openapi"], "3.0.3");
  EXPECT_EQ(document["servers"][0]["url"], "http://map.example/ogc");
  const std::string text = answer.content;
  const std::string mark = "\"$ref\":\"#";
  std::size_t references = 0;
  for (std::size_t at = text.find(mark); at != std::string::npos; at = text.find(mark, at + 1)) {
    const std::size_t begin = at + mark.size();
    const nlohmann::json::json_pointer place(text.substr(begin, text.find('"', begin) - begin));
    EXPECT_TRUE(document.contains(place)) << place;
    ++references;
  }
  EXPECT_GT(references, 20U);
}

TEST_F(OgcApiTest, PagesByNextLinksHaveEachFeatureOnce) {
  std::set<std::string> added;
  for (int i = 0; i < 7; ++i) added.insert(Add("deer", 40.3 + 0.01 * i, -79.95));
  std::set<std::string> found;
  std::size_t pages = 0;
  std::string address = std::string(kItems) + "?limit=3&bbox=-80,40,-79,41";
  while (!address.empty()) {
    const auto page = AskJson(address);
    EXPECT_EQ(page["numberReturned"], page["features"].size());
    EXPECT_LE(page["features"].size(), 3U);
    EXPECT_EQ(LinkOf(page, "self"), "http://map.example" + address);
    for (const auto& feature : page["features"]) {
      EXPECT_TRUE(found.insert(feature["id"]).second);
    }
    const std::string next = LinkOf(page, "next");
    address = next.empty() ? "" : next.substr(18);
    ++pages;
  }
  EXPECT_EQ(found, added);
  EXPECT_EQ(pages, 3U);
}

TEST_F(OgcApiTest, TheLastPageHasNoNextLink) {
  for (int i = 0; i < 3; ++i) Add("deer", 40.3 + 0.01 * i, -79.95);
  EXPECT_EQ(LinkOf(AskJson(std::string(kItems) + "?limit=3"), "next"), "");
  EXPECT_NE(LinkOf(AskJson(std::string(kItems) + "?limit=2"), "next"), "");
}

TEST_F(OgcApiTest, SelectsByBoxAndTime) {
  const std::string id = Add("deer", 40.44, -79.955);
  const auto count = [&](const std::string& parameters) {
    return AskJson(kItems + ("?" + parameters))["features"].size();
  };
  EXPECT_EQ(count("bbox=-80,40,-79,41"), 1U);
  EXPECT_EQ(count("bbox=40,-80,41,-79"), 0U);  // Axes swapped.
  EXPECT_EQ(count("datetime=2026-01-01T00:00:00Z"), 1U);
  EXPECT_EQ(count("datetime=2026-01-01T00:00:01Z/.."), 0U);
  EXPECT_EQ(count("datetime=../2026-01-01T00:00:00Z"), 1U);
  const auto feature = AskJson(kItems + ("/" + id));
  EXPECT_EQ(feature["geometry"]["coordinates"], nlohmann::json::array({-79.955, 40.44}));
  EXPECT_EQ(LinkOf(feature, "collection"), "http://map.example/ogc/collections/hazards");
}

TEST_F(OgcApiTest, RefusesAsTheStandardSays) {
  const HttpResponse answer = Ask(std::string(kItems) + "?colour=red");
  EXPECT_EQ(answer.status, 400);
  const auto refusal = nlohmann::json::parse(answer.content);
  EXPECT_EQ(refusal["code"], "InvalidParameterValue");
  EXPECT_EQ(refusal["description"],
            "the parameter 'colour' is unknown, accepted are bbox, datetime, limit and cursor");
  for (const char* target :
       {"/ogc?f=json", "/ogc/conformance?x", "/ogc/collections/hazards?limit=3",
        "/ogc/collections/hazards/items?bbox=1,2,3",
        "/ogc/collections/hazards/items/6c2f0a1b-1111-4222-8333-44445555abcd?limit=3"}) {
    EXPECT_EQ(Ask(target).status, 400) << target;
  }
  for (const char* target : {"/ogc/none", "/ogc/collections/none", "/ogc/collections/none/items",
                             "/ogc/collections/hazards/itemsx", "/ogc/collections/hazards/items/x",
                             "/ogc/collections/hazards/items/", "/ogc/collections/streets/items/-1",
                             "/ogc/collections/"}) {
    EXPECT_EQ(Ask(target).status, 404) << target;
  }
}

TEST_F(OgcApiTest, WhatMayNotBeSeenIsNotThere) {
  const std::string candidate = Add("pothole", 40.44, -79.955);
  const std::string told = Add("deer", 40.44, -79.945);
  fixture_.zone->HandleMapChanges({fixture_.MakeMapChange("sign", {40.44, -79.945})});
  const auto features = AskJson(kItems, kOgcToldOnly)["features"];
  ASSERT_EQ(features.size(), 1U);
  EXPECT_EQ(features[0]["id"], told);
  EXPECT_EQ(Ask(kItems + ("/" + candidate), kOgcToldOnly).status, 404);
  EXPECT_EQ(AskJson("/ogc/collections", kOgcToldOnly)["collections"].size(), 2U);
  EXPECT_EQ(Ask("/ogc/collections/map_changes/items", kOgcToldOnly).status, 404);
  EXPECT_EQ(AskJson("/ogc/collections/map_changes/items")["features"].size(), 1U);
  EXPECT_EQ(AskJson("/ogc/collections/streets/items",
                    kOgcToldOnly)["features"][0]["properties"]["hazards"],
            1);
  EXPECT_EQ(Ask("/ogc", {false, false, false}).status, 401);
}

TEST_F(OgcApiTest, CountsHazardsOfStreets) {
  Add("deer", 40.44, -79.955);
  Add("pothole", 40.44, -79.945);
  Add("pothole", 40.435, -79.95);
  Add("pothole", 41, -79.95);  // On no street.
  const auto page = AskJson("/ogc/collections/streets/items?limit=1");
  ASSERT_EQ(page["features"].size(), 1U);
  const auto& forbes = page["features"][0];
  EXPECT_EQ(forbes["id"], 11);
  EXPECT_EQ(forbes["properties"]["name"], "Forbes Ave");
  EXPECT_EQ(forbes["properties"]["hazards"], 2);
  EXPECT_EQ(forbes["properties"]["by_class"]["pothole"], 1);
  EXPECT_EQ(forbes["geometry"]["type"], "LineString");
  EXPECT_EQ(forbes["geometry"]["coordinates"][0], nlohmann::json::array({-79.96, 40.44}));
  EXPECT_EQ(forbes["geometry"]["coordinates"].size(), 3U);
  const auto next = AskJson(LinkOf(page, "next").substr(18));
  ASSERT_EQ(next["features"].size(), 1U);
  EXPECT_EQ(next["features"][0]["id"], 12);
  EXPECT_EQ(LinkOf(next, "next"), "");
  EXPECT_EQ(AskJson("/ogc/collections/streets/items/12")["properties"]["hazards"], 1);
  EXPECT_EQ(Ask("/ogc/collections/streets/items/13").status, 404);
  const auto count = [&](const std::string& parameters) {
    return AskJson("/ogc/collections/streets/items?" + parameters)["features"].size();
  };
  EXPECT_EQ(count("bbox=-79.97,40.4399,-79.955,40.4401"), 1U);
  EXPECT_EQ(count("bbox=170,40,-79.955,41"), 1U);
  EXPECT_EQ(count("datetime=2020-01-01T00:00:00Z"), 0U);
}

}  // namespace
}  // namespace livemap::web
