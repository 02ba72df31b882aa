#include "web/api/feed_api.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "test/web/feeds/answer_content.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"

namespace livemap::web {
namespace {

constexpr Visibility kPublicToldOnly{true, false, false};

std::string HeaderOf(const HttpResponse& answer, const std::string& name) {
  for (const auto& header : answer.headers) {
    if (header.first == name) return header.second;
  }
  return "";
}

class FeedApiTest : public testing::Test {
 protected:
  HttpResponse Ask(const std::string& target, const Visibility& sees = {},
                   const std::string& if_none_match = "") {
    HttpRequest question;
    question.method = "GET";
    question.target = target;
    question.host = "map.example:8080";
    question.if_none_match = if_none_match;
    return feeds_.Answer(ParseTarget(target), question, sees);
  }
  std::string Text(const std::string& target, const Visibility& sees = {}) {
    return ContentOf(Ask(target, sees)).text;
  }
  /// A hazard that drivers are told of: the catalogue wants one witness of a deer.
  std::string AddTold(const std::string& class_name = "deer", double north_deg = 0) {
    return Add(class_name, north_deg);
  }
  std::string Add(const std::string& class_name, double north_deg = 0) {
    return fixture_.zone->Handle(fixture_.MakeReport(class_name, {40.4433 + north_deg, -79.9436}))
        .hazard_uuid.ToString();
  }

  ZoneFixture fixture_;
  WebConfig options_ = TestOptions();
  FeedApi feeds_{{options_, *fixture_.zone, fixture_.catalogue, [this] { return now_ns_; }}};
  std::int64_t now_ns_ = ZoneFixture::kStartNs;
};

TEST_F(FeedApiTest, ListsTheFeeds) {
  const auto list = nlohmann::json::parse(Text("/feeds"));
  ASSERT_EQ(list["feeds"].size(), 8U);
  EXPECT_EQ(list["feeds"][0]["href"], "http://map.example:8080/feeds/wzdx.geojson");
  for (const auto& feed : list["feeds"]) {
    const std::string address = std::string(feed["href"]).substr(23);
    if (address == "/ogc") continue;
    EXPECT_EQ(Ask(address).status, 200) << address;
  }
  EXPECT_EQ(Ask("/feeds/none").status, 404);
}

TEST_F(FeedApiTest, DriversFeedsHaveNoCandidates) {
  const std::string told = AddTold();
  const std::string candidate = Add("traffic_cone", 0.01);
  for (const char* feed : {"/feeds/cifs.json", "/feeds/denm.ndjson", "/feeds/srti.xml"}) {
    EXPECT_THAT(Text(feed), testing::HasSubstr(told)) << feed;
    EXPECT_THAT(Text(feed), testing::Not(testing::HasSubstr(candidate))) << feed;
  }
  for (const char* feed : {"/feeds/hazards.csv", "/feeds/hazards.atom"}) {
    EXPECT_THAT(Text(feed), testing::HasSubstr(candidate)) << feed;
    EXPECT_THAT(Text(feed, kPublicToldOnly), testing::Not(testing::HasSubstr(candidate))) << feed;
    EXPECT_THAT(Text(feed, kPublicToldOnly), testing::HasSubstr(told)) << feed;
  }
}

TEST_F(FeedApiTest, WhoMaySeeNothingLogsIn) {
  AddTold();
  const Visibility nothing{false, false, false};
  EXPECT_EQ(Ask("/feeds/hazards.csv", nothing).status, 401);
  EXPECT_EQ(Ask("/feeds/wzdx.geojson", nothing).status, 401);
  EXPECT_EQ(Ask("/feeds/hazards.csv?state=candidate", kPublicToldOnly).status, 401);
}

TEST_F(FeedApiTest, SelectsByBoxClassAndState) {
  const std::string deer = AddTold("deer");
  const std::string debris = Add("debris", 0.2);
  EXPECT_THAT(Text("/feeds/hazards.csv?class=deer"), testing::HasSubstr(deer));
  EXPECT_THAT(Text("/feeds/hazards.csv?class=deer"), testing::Not(testing::HasSubstr(debris)));
  EXPECT_THAT(Text("/feeds/hazards.csv?bbox=-80,40.6,-79,41"), testing::HasSubstr(debris));
  EXPECT_THAT(Text("/feeds/hazards.csv?bbox=-80,40.6,-79,41"),
              testing::Not(testing::HasSubstr(deer)));
  EXPECT_THAT(Text("/feeds/hazards.csv?state=candidate"), testing::Not(testing::HasSubstr(deer)));
  EXPECT_THROW(Ask("/feeds/hazards.csv?limit=3"), BadRequest);
}

TEST_F(FeedApiTest, AClientThatHasTheFeedIsToldSoUntilSomethingChanges) {
  AddTold();
  const HttpResponse first = Ask("/feeds/hazards.csv");
  const std::string tag = HeaderOf(first, "ETag");
  EXPECT_EQ(tag.substr(0, 3), "W/\"");
  EXPECT_EQ(HeaderOf(first, "Cache-Control"), "no-cache");
  EXPECT_EQ(Ask("/feeds/hazards.csv", {}, "\"x\", " + tag).status, 304);
  EXPECT_EQ(Ask("/feeds/hazards.csv", {}, tag.substr(2)).status, 304);
  EXPECT_EQ(Ask("/feeds/hazards.csv", kPublicToldOnly, tag).status, 200);
  EXPECT_EQ(Ask("/feeds/hazards.csv?class=deer", {}, tag).status, 200);
  now_ns_ += 700'000'000'000;  // Expected ends have moved.
  EXPECT_EQ(Ask("/feeds/hazards.csv", {}, tag).status, 200);
  now_ns_ -= 700'000'000'000;
  AddTold("deer", 0.01);
  EXPECT_EQ(Ask("/feeds/hazards.csv", {}, tag).status, 200);
}

TEST_F(FeedApiTest, WhatEndedIsTerminated) {
  const std::string gone = AddTold();
  const std::string rejected = AddTold("deer", 0.01);
  const std::uint64_t before = fixture_.zone->Sequence();
  ASSERT_TRUE(fixture_.zone->Remove(*Uuid::Parse(gone), "crossed the road"));
  ASSERT_TRUE(fixture_.zone->Reject(*Uuid::Parse(rejected), "miller", "a statue"));
  const auto one = [&](const std::string& id) {
    return nlohmann::json::parse(Text("/feeds/denm/" + id))["denm"]["management"]["termination"];
  };
  EXPECT_EQ(one(gone), "isCancellation");
  EXPECT_EQ(one(rejected), "isNegation");
  EXPECT_EQ(Text("/feeds/denm.ndjson"), "");
  const std::string since = Text("/feeds/denm.ndjson?since=" + std::to_string(before));
  EXPECT_THAT(since, testing::HasSubstr(gone));
  EXPECT_THAT(since, testing::HasSubstr(rejected));
  const std::string candidate = Add("traffic_cone", 0.02);
  EXPECT_EQ(Ask("/feeds/denm/" + candidate).status, 404);
  EXPECT_THROW(Ask("/feeds/denm/x"), BadRequest);
}

TEST_F(FeedApiTest, IsWrittenInPiecesThatDoNotGrow) {
  fixture_.AddRow("deer", {40.2, -79.9436}, 1500);
  for (const char* feed : {"/feeds/cifs.json", "/feeds/denm.ndjson", "/feeds/srti.xml",
                           "/feeds/hazards.atom", "/feeds/hazards.csv", "/feeds/hazards.gpx"}) {
    const AnswerContent content = ContentOf(Ask(feed));
    EXPECT_GT(content.pieces, 10U) << feed;
    EXPECT_LT(content.longest_piece, 256U << 10) << feed;
  }
}

TEST_F(FeedApiTest, FewFeedsGatherAtOnce) {
  std::vector<HttpResponse> answers;
  for (int i = 0; i < GatheringSlots::kMost; ++i) answers.push_back(Ask("/feeds/wzdx.geojson"));
  EXPECT_EQ(Ask("/feeds/wzdx.geojson").status, 503);
  EXPECT_EQ(Ask("/feeds/cifs.json").status, 200);
  answers.pop_back();
  EXPECT_EQ(Ask("/feeds/wzdx.geojson").status, 200);
}

TEST_F(FeedApiTest, AHostThatIsNoneIsNotRepeated) {
  HttpRequest question;
  question.target = "/feeds";
  question.host = "x\"><script>";
  const std::string list = ContentOf(feeds_.Answer(ParseTarget("/feeds"), question, {})).text;
  EXPECT_THAT(list, testing::HasSubstr("http://localhost/feeds/"));
}

TEST_F(FeedApiTest, LinksBeginWithThePublicAddress) {
  options_.public_url = "https://city.example/map/";
  EXPECT_THAT(Text("/feeds"), testing::HasSubstr("\"https://city.example/map/feeds/cifs.json\""));
}

TEST_F(FeedApiTest, IsServedCompressedAndByTag) {
  fixture_.AddRow("deer", {40.2, -79.9436}, 50);
  WebServer server(options_, *fixture_.zone, fixture_.catalogue);
  const HttpResult answer = Get(server.port(), "/feeds/srti.xml", {{"Accept-Encoding", "gzip"}});
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.Field("Content-Encoding"), "gzip");
  EXPECT_EQ(answer.Field("ETag").substr(0, 3), "W/\"");
  EXPECT_EQ(Get(server.port(), "/feeds/srti.xml", {{"If-None-Match", answer.Field("ETag")}}).status,
            304);
  EXPECT_EQ(Get(server.port(), "/feeds/srti.xml?x=1").status, 400);
  EXPECT_EQ(Get(server.port(), "/feedsx").status, 404);
}

}  // namespace
}  // namespace livemap::web
