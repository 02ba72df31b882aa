#include "region/zone_answer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "common/error.h"
#include "protocol/hazard_catalogue.h"
#include "test/region/told_hazards.h"
#include "web/json/json.h"

namespace livemap::region {
namespace {

using testing::HasSubstr;
using web::Json;

Json Feature(std::uint8_t number = 1, std::uint64_t sequence = 7) {
  const ToldHazard told = Told(number, sequence);
  return web::HazardFeature(told.hazard, protocol::HazardCatalogue(), told.words);
}

Json Answer(const Json& features) {
  return {{"type", "FeatureCollection"},
          {"features", features},
          {"sequence", 9},
          {"truncated", false},
          {"log", "6f1c0d5e-8f6c-4d7e-9a55-0a8f0f3c8e11"}};
}

std::string WhyRefused(const std::string& text, std::uint64_t after = 0) {
  try {
    ParseZoneAnswer(text, after, kNowNs);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ZoneAnswer, HasWhatAZoneTells) {
  Json gone = Feature(2, 9);
  gone["properties"]["state"] = "gone";
  const ZoneAnswer answer = ParseZoneAnswer(Answer({Feature(), gone}).dump(), 3, kNowNs);
  EXPECT_EQ(answer.log.ToString(), "6f1c0d5e-8f6c-4d7e-9a55-0a8f0f3c8e11");
  EXPECT_EQ(answer.sequence, 9U);
  EXPECT_FALSE(answer.is_truncated);
  EXPECT_EQ(answer.refused, 0U) << answer.refusal;
  ASSERT_EQ(answer.hazards.size(), 2U);
  const zone::Hazard& hazard = answer.hazards[0].hazard;
  EXPECT_EQ(hazard.uuid, IdOf(1));
  EXPECT_EQ(hazard.class_name, "pothole");
  EXPECT_DOUBLE_EQ(hazard.position.latitude_deg, 40.44);
  EXPECT_DOUBLE_EQ(hazard.position.longitude_deg, -79.94);
  EXPECT_EQ(hazard.last_seen_ns, kNowNs);
  EXPECT_EQ(hazard.sequence, 7U);
  EXPECT_EQ(answer.hazards[0].words.street, "Forbes Ave");
  EXPECT_TRUE(answer.hazards[0].IsThere());
  EXPECT_FALSE(answer.hazards[1].IsThere());
}

TEST(ZoneAnswer, KeepsTheMillisecondsOfAStamp) {
  Json feature = Feature();
  feature["properties"]["last_seen"] = "2025-12-31T23:59:59.250Z";
  const ZoneAnswer answer = ParseZoneAnswer(Answer(Json::array({feature})).dump(), 0, kNowNs);
  ASSERT_EQ(answer.hazards.size(), 1U) << answer.refusal;
  EXPECT_EQ(answer.hazards[0].hazard.last_seen_ns, kNowNs - 750'000'000);
}

TEST(ZoneAnswer, LeavesOutAHazardThatNoZoneCanHaveAndSaysWhy) {
  const auto set = [](const char* name, const Json& value) {
    Json feature = Feature();
    feature["properties"][name] = value;
    return feature;
  };
  const auto place = [](const Json& coordinates) {
    Json feature = Feature();
    feature["geometry"]["coordinates"] = coordinates;
    return feature;
  };
  for (const Json& feature : {set("id", "no uuid"),
                              set("id", 5),
                              set("class", ""),
                              set("class", "a\nb"),
                              set("class", std::string(65, 'a')),
                              set("class",
                                  "\xe2\x80\xae"
                                  "evil"),
                              set("confidence", 1.5),
                              set("confidence", nullptr),
                              set("presence", -0.1),
                              set("presence", "1"),
                              set("sightings", -1),
                              set("sightings", 5e9),
                              set("vehicles", 0.5),
                              set("state", "broken"),
                              set("first_seen", "yesterday"),
                              set("last_seen", "2026-01-03T00:00:00.000Z"),
                              set("updated", "1969-12-31T23:59:59.000Z"),
                              set("updated", "2026-01-01T00:00:00.0x0Z"),
                              set("sequence", 1e17),
                              set("position_sigma_m", -1),
                              set("position_sigma_m", "wide"),
                              place({0, 91}),
                              place({"0", 0}),
                              place({0}),
                              place(nullptr),
                              Json(7),
                              Json::object()}) {
    const ZoneAnswer answer = ParseZoneAnswer(Answer({feature, Feature(2)}).dump(), 0, kNowNs);
    EXPECT_EQ(answer.hazards.size(), 1U) << feature;
    EXPECT_EQ(answer.refused, 1U) << feature;
    EXPECT_THAT(answer.refusal, HasSubstr("a hazard's '")) << feature;
  }
}

TEST(ZoneAnswer, KeepsAHazardWhoseStreetIsNoText) {
  Json feature = Feature();
  feature["properties"]["street"] = "a\x01";
  feature["properties"]["near"] = 5;
  feature["properties"]["direction"] = std::string(300, 'n');
  const ZoneAnswer answer = ParseZoneAnswer(Answer(Json::array({feature})).dump(), 0, kNowNs);
  ASSERT_EQ(answer.hazards.size(), 1U);
  EXPECT_EQ(answer.hazards[0].words.street, "");
  EXPECT_EQ(answer.hazards[0].words.near, "");
  EXPECT_EQ(answer.hazards[0].words.direction, "");
}

TEST(ZoneAnswer, RefusesWhatIsNoAnswerOfAZone) {
  EXPECT_THAT(WhyRefused(""), HasSubstr("no JSON"));
  EXPECT_THAT(WhyRefused("<html>"), HasSubstr("no JSON"));
  EXPECT_THAT(WhyRefused(std::string(kMaxAnswerBytes + 1, ' ')), HasSubstr("bytes"));
  EXPECT_THAT(WhyRefused(std::string(100000, '[')), HasSubstr("deep"));
  EXPECT_THAT(WhyRefused("[1e999]"), HasSubstr("too large"));
  EXPECT_THAT(WhyRefused("5"), HasSubstr("'log'"));
  for (const char* name : {"log", "sequence", "truncated", "features"}) {
    Json answer = Answer({});
    answer.erase(name);
    EXPECT_EQ(WhyRefused(answer.dump()), "'" + std::string(name) + "' is missing");
    answer[name] = "x";
    EXPECT_THAT(WhyRefused(answer.dump()), HasSubstr("'" + std::string(name) + "' is not"));
  }
  Json many = Json::array();
  for (std::size_t i = 0; i <= kHazardsPerAnswer; ++i) many.push_back(1);
  EXPECT_THAT(WhyRefused(Answer(many).dump()), HasSubstr("at most 1000 hazards"));
}

TEST(ZoneAnswer, RefusesACutAnswerThatDoesNotGoOn) {
  Json answer = Answer(Json::array());
  answer["truncated"] = true;
  EXPECT_EQ(WhyRefused(answer.dump(), 8), "");
  EXPECT_THAT(WhyRefused(answer.dump(), 9), HasSubstr("above 9"));
}

TEST(ToldHazard, IsReadBackAsItIsKept) {
  const ToldHazard told = ParseToldHazard(Feature(3, 5).dump(), kNowNs);
  EXPECT_EQ(web::ToText(web::HazardFeature(told.hazard, protocol::HazardCatalogue(), told.words)),
            web::ToText(Feature(3, 5)));
}

}  // namespace
}  // namespace livemap::region
