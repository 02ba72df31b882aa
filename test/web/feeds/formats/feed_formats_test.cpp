// The formats by themselves. Each says where the place is, which no swap of its axes leaves valid:
// a latitude of 40 and a longitude of -79 degrees.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "web/feeds/formats/cifs_feed.h"
#include "web/feeds/formats/csv_feed.h"
#include "web/feeds/formats/datex_feed.h"
#include "web/feeds/formats/denm_feed.h"
#include "web/feeds/formats/georss_feed.h"
#include "web/feeds/formats/gpx_feed.h"
#include "web/feeds/formats/wzdx_feed.h"

namespace livemap::web {
namespace {

constexpr std::int64_t kNewYearNs = 1'767'225'600'000'000'000;  // 2026-01-01T00:00:00Z
constexpr char kEvil[] = "</wpt><script>alert(\"1\")</script>\xff";

FeedHazard SampleHazard(const std::string& class_name = "deer") {
  zone::Hazard hazard;
  hazard.uuid = *Uuid::Parse("6c2f0a1b-1111-4222-8333-44445555abcd");
  hazard.class_name = class_name;
  hazard.position = {40.4433, -79.9436};
  hazard.covariance_m2 << 4, 0, 0, 1;
  hazard.presence = 0.95F;
  hazard.first_seen_ns = kNewYearNs;
  hazard.last_seen_ns = kNewYearNs + 60'000'000'000;
  hazard.updated_ns = kNewYearNs + 61'000'000'000;
  hazard.sequence = 7;
  hazard.course_rad = M_PI / 2;
  streets::StreetWords words;
  words.street = "Forbes Ave";
  words.near = "S Craig St";
  words.direction = "eastbound";
  return MakeFeedHazard(hazard, {}, words, kNewYearNs + 120'000'000'000);
}

FeedHead SampleHead() {
  return {"https://map.example", "https://map.example/feeds/x?a=1&b=2", "City & Sons", "us",
          kNewYearNs};
}

std::string WholeFeed(FeedFormat& format, const FeedHazard& hazard) {
  std::string text;
  format.Begin(SampleHead(), text);
  format.Add(hazard, text);
  while (format.End(text)) continue;
  return text;
}

TEST(FeedHazard, SaysWhereItLiesAndWhenItEnds) {
  EXPECT_EQ(SampleHazard().Title(), "deer, Forbes Ave, near S Craig St, eastbound");
  // A day after it was last seen, by the catalogue's defaults.
  EXPECT_EQ(SampleHazard().ends_ns, kNewYearNs + 86'460'000'000'000);
  zone::Hazard old = SampleHazard().hazard;
  const std::int64_t now_ns = kNewYearNs + 1'000'000'000'000'000;
  EXPECT_EQ(MakeFeedHazard(old, {}, {}, now_ns).ends_ns, now_ns + 600'000'000'000);
}

TEST(FeedCodes, AllShippedClassesHaveTheirOwn) {
  const auto catalogue = protocol::HazardCatalogue::Load(LIVEMAP_SOURCE_DIR "/config/hazards.yaml");
  for (const auto& entry : catalogue.classes()) {
    EXPECT_NE(CodesOf(entry.first).cifs_subtype, CodesOf("").cifs_subtype) << entry.first;
  }
  EXPECT_EQ(CodesOf("deer").cause_code, 11);
  EXPECT_EQ(CodesOf("moose").cause_code, 10);
}

TEST(CsvFeed, HasALineOfAsManyFieldsAsTheHeader) {
  CsvFeed feed;
  const std::string text = WholeFeed(feed, SampleHazard());
  const std::size_t end = text.find("\r\n");
  const std::string header = text.substr(0, end);
  EXPECT_THAT(text, testing::HasSubstr(",40.4433000,-79.9436000,2.0,"));
  EXPECT_THAT(text, testing::HasSubstr(",\"Forbes Ave\",\"S Craig St\",eastbound,,7\r\n"));
  EXPECT_EQ(std::count(header.begin(), header.end(), ','),
            std::count(text.begin() + static_cast<std::ptrdiff_t>(end), text.end(), ','));
}

TEST(CsvFeed, GuardsTextsOfTheDatabase) {
  FeedHazard hazard = SampleHazard();
  hazard.words.street = "=cmd|' /C calc'!A0";
  CsvFeed feed;
  EXPECT_THAT(WholeFeed(feed, hazard), testing::HasSubstr(",\"'=cmd|' /C calc'!A0\","));
}

TEST(GpxFeed, HasAWaypoint) {
  GpxFeed feed;
  EXPECT_THAT(WholeFeed(feed, SampleHazard()),
              testing::HasSubstr("<wpt lat=\"40.4433000\" lon=\"-79.9436000\">"
                                 "<time>2026-01-01T00:01:00Z</time><name>deer</name>"));
}

TEST(GeoRssFeed, SaysLatitudeFirst) {
  GeoRssFeed feed;
  const std::string text = WholeFeed(feed, SampleHazard());
  EXPECT_THAT(text, testing::HasSubstr("<georss:point>40.4433000 -79.9436000</georss:point>"));
  EXPECT_THAT(text, testing::HasSubstr("<id>https://map.example/feeds/x?a=1&amp;b=2</id>"));
  EXPECT_THAT(text, testing::HasSubstr("City &amp; Sons"));
}

TEST(XmlFeeds, ScriptsInTextsStayTexts) {
  FeedHazard hazard = SampleHazard();
  hazard.label = hazard.words.street = hazard.words.near = hazard.hazard.class_name = kEvil;
  GpxFeed gpx;
  GeoRssFeed georss;
  DatexFeed datex;
  for (FeedFormat* feed : std::initializer_list<FeedFormat*>{&gpx, &georss, &datex}) {
    const std::string text = WholeFeed(*feed, hazard);
    EXPECT_THAT(text, testing::Not(testing::HasSubstr("<script>")));
    EXPECT_THAT(text, testing::Not(testing::HasSubstr("\xff")));
    EXPECT_THAT(text, testing::HasSubstr("&lt;script&gt;"));
  }
}

TEST(CifsFeed, HasALineInTheDirectionOfTravelLatitudeFirst) {
  CifsFeed feed;
  const auto json = nlohmann::json::parse(WholeFeed(feed, SampleHazard()));
  const auto& incident = json["incidents"][0]["incident"];
  EXPECT_EQ(incident["type"], "HAZARD");
  EXPECT_EQ(incident["subtype"], "HAZARD_ON_SHOULDER_ANIMALS");
  EXPECT_EQ(incident["street"], "Forbes Ave");
  EXPECT_EQ(incident["direction"], "ONE_DIRECTION");
  EXPECT_EQ(incident["starttime"], "2026-01-01T00:00:00+00:00");
  const std::string polyline = incident["polyline"];
  EXPECT_EQ(polyline.substr(0, 22), "40.4433000 -79.9436000");
  // 20 m to the east.
  EXPECT_THAT(polyline.substr(22), testing::StartsWith(" 40.4433000 -79.9433"));
}

TEST(CifsFeed, WithoutACourseBothDirectionsCount) {
  FeedHazard hazard = SampleHazard("stopped_accident");
  hazard.hazard.course_rad = std::nan("");
  hazard.words = {};
  CifsFeed feed;
  const auto json = nlohmann::json::parse(WholeFeed(feed, hazard));
  const auto& incident = json["incidents"][0]["incident"];
  EXPECT_EQ(incident["type"], "ACCIDENT");
  EXPECT_FALSE(incident.contains("subtype"));
  EXPECT_EQ(incident["direction"], "BOTH_DIRECTIONS");
  EXPECT_EQ(incident["polyline"], "40.4433000 -79.9436000");
  EXPECT_EQ(incident["street"], "unknown");
}

TEST(DatexFeed, HasTheRecordOfItsCategory) {
  const auto record_of = [](const std::string& class_name) {
    DatexFeed feed;
    return WholeFeed(feed, SampleHazard(class_name));
  };
  EXPECT_THAT(record_of("deer"),
              testing::HasSubstr("<sit:animalPresenceType>wildAnimalsOnTheRoad<"));
  EXPECT_THAT(record_of("debris"), testing::HasSubstr("<sit:obstructionType>debris<"));
  EXPECT_THAT(record_of("stopped_accident"),
              testing::HasSubstr("<sit:obstructionType>unprotectedAccidentArea<"));
  EXPECT_THAT(record_of("traffic_cone"), testing::HasSubstr("xsi:type=\"sit:MaintenanceWorks\""));
  EXPECT_THAT(record_of("pothole"), testing::Not(testing::HasSubstr("situationRecord")));
  EXPECT_THAT(record_of("deer"), testing::HasSubstr("<loc:latitude>40.4433000</loc:latitude>"
                                                    "<loc:longitude>-79.9436000</loc:longitude>"));
  EXPECT_THAT(record_of("deer"), testing::HasSubstr("<com:country>us</com:country>"));
}

TEST(DenmFeed, HasCodesUnitsAndTheEllipseOfEtsi) {
  const auto message = nlohmann::json::parse(DenmJson(SampleHazard()).dump());
  EXPECT_EQ(message["header"]["messageID"], 1);
  const auto& management = message["denm"]["management"];
  EXPECT_EQ(management["actionID"]["originatingStationID"], 0x6c2f0a1b);
  EXPECT_EQ(management["actionID"]["sequenceNumber"], 0xabcd);
  // 22 years, 6 of them leap years, and 5 leap seconds; a minute later.
  EXPECT_EQ(management["detectionTime"], (22 * 365 + 6) * 86'400'000LL + 5'000 + 60'000);
  EXPECT_EQ(management["eventPosition"]["latitude"], 404'433'000);
  EXPECT_EQ(management["eventPosition"]["longitude"], -799'436'000);
  const auto& ellipse = management["eventPosition"]["positionConfidenceEllipse"];
  EXPECT_EQ(ellipse["semiMajorConfidence"], 392);  // 1.96 * 2 m, east and west.
  EXPECT_EQ(ellipse["semiMinorConfidence"], 196);
  EXPECT_EQ(ellipse["semiMajorOrientation"].get<int>() % 1800, 900);
  EXPECT_EQ(management["validityDuration"], 86'400);
  EXPECT_FALSE(management.contains("termination"));
  EXPECT_EQ(message["denm"]["situation"]["eventType"]["causeCode"], 11);
  EXPECT_EQ(message["denm"]["situation"]["eventType"]["subCauseCode"], 1);
  EXPECT_EQ(message["denm"]["situation"]["informationQuality"], 7);
  EXPECT_EQ(message["denm"]["location"]["eventPositionHeading"]["headingValue"], 900);
}

TEST(DenmFeed, EndsWhatEnded) {
  FeedHazard hazard = SampleHazard();
  const auto termination = [&](zone::HazardState state) {
    hazard.hazard.state = state;
    const Json message = DenmJson(hazard);
    EXPECT_FALSE(message["denm"].contains("situation"));
    return message["denm"]["management"]["termination"].get<std::string>();
  };
  EXPECT_EQ(termination(zone::HazardState::kGone), "isCancellation");
  EXPECT_EQ(termination(zone::HazardState::kRejected), "isNegation");
  EXPECT_EQ(termination(zone::HazardState::kCandidate), "isCancellation");
}

TEST(DenmFeed, WhatIsNotKnownIsUnavailable) {
  FeedHazard hazard = SampleHazard();
  hazard.hazard.covariance_m2(0, 0) = std::nan("");
  hazard.hazard.course_rad = std::nan("");
  const auto message = nlohmann::json::parse(DenmJson(hazard).dump());
  const auto& place = message["denm"]["management"]["eventPosition"];
  EXPECT_EQ(place["positionConfidenceEllipse"]["semiMajorConfidence"], 4095);
  EXPECT_EQ(place["altitude"]["altitudeValue"], 800'001);
  EXPECT_FALSE(message["denm"]["location"].contains("eventPositionHeading"));
}

TEST(WzdxFeed, MakesAWorkZone) {
  WzdxFeed feed;
  FeedHazard sign = SampleHazard("road_work_sign");
  const auto json = nlohmann::json::parse(WholeFeed(feed, sign));
  EXPECT_EQ(json["feed_info"]["publisher"], "City & Sons");
  ASSERT_EQ(json["features"].size(), 1U);
  const auto& zone = json["features"][0];
  EXPECT_EQ(zone["id"], sign.id);
  EXPECT_EQ(zone["geometry"]["coordinates"][0], nlohmann::json::array({-79.9436, 40.4433}));
  const auto& core = zone["properties"]["core_details"];
  EXPECT_EQ(core["road_names"], nlohmann::json::array({"Forbes Ave"}));
  EXPECT_EQ(core["direction"], "eastbound");
  EXPECT_EQ(core["description"], "1 sign");
  EXPECT_EQ(zone["properties"]["beginning_cross_street"], "S Craig St");
  EXPECT_EQ(zone["properties"]["location_method"], "sign-method");
}

TEST(WzdxFeed, WithoutWorkItIsEmpty) {
  WzdxFeed feed;
  EXPECT_EQ(nlohmann::json::parse(WholeFeed(feed, SampleHazard("pothole")))["features"].size(), 0U);
}

}  // namespace
}  // namespace livemap::web
