// Map changes in the API and on the live stream.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/officials/official_decision.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;

const geo::GeoPoint kCrossing{40.4433, -79.9436};

class MapChangeApiTest : public testing::Test {
 protected:
  MapChangeApiTest() {
    WebConfig options = TestOptions();
    options.token_file = tokens_.path();
    server_ = std::make_unique<WebServer>(options, *fixture_.zone, fixture_.catalogue);
  }

  /// The id of the map change that a vehicle tells of.
  std::string Tell(const std::string& vehicle = "car-1", bool vanished = false,
                   const geo::GeoPoint& position = kCrossing) {
    fixture_.now_ns += 1'000'000'000;
    protocol::MapChangeReport report = fixture_.MakeMapChange("traffic_cone", position);
    report.vehicle_id = vehicle;
    report.vanished = vanished;
    const protocol::Receipt receipt = fixture_.zone->HandleMapChanges({report}).at(0);
    EXPECT_EQ(receipt.status, protocol::Receipt::Status::kCommitted) << receipt.reason;
    return receipt.hazard_uuid.ToString();
  }
  nlohmann::json Features(const std::string& query = "") {
    return Get(port(), "/api/v1/changes" + query).Json()["features"];
  }
  HttpResult Decide(const std::string& id, const std::string& body, const std::string& token) {
    Headers headers{{"Content-Type", "application/json"}};
    if (!token.empty()) headers.emplace_back("Authorization", "Bearer " + token);
    return Request(port(), "POST", "/api/v1/changes/" + id + "/decision", headers, body);
  }
  int port() const { return server_->port(); }

  TokenFile tokens_;
  ZoneFixture fixture_;
  std::unique_ptr<WebServer> server_;
};

TEST_F(MapChangeApiTest, AChangeIsAGeoJsonFeature) {
  const std::string id = Tell();
  const auto list = Get(port(), "/api/v1/changes");
  EXPECT_EQ(list.Field("Content-Type"), "application/geo+json");
  EXPECT_EQ(list.Json()["sequence"], 1);
  EXPECT_EQ(list.Json()["truncated"], false);
  const auto feature = list.Json()["features"].at(0);
  EXPECT_EQ(feature["id"], id);
  EXPECT_EQ(feature["geometry"]["coordinates"], nlohmann::json({-79.9436, 40.4433}));
  const auto& properties = feature["properties"];
  EXPECT_EQ(properties["class"], "traffic_cone");
  EXPECT_EQ(properties["label"], "Traffic cone");
  EXPECT_EQ(properties["colour"], "#ffaec9");
  EXPECT_EQ(properties["direction"], "appeared");
  EXPECT_EQ(properties["state"], "proposed");
  EXPECT_EQ(properties["vehicles"], 1);
  EXPECT_EQ(properties["first_seen"], "2026-01-01T00:00:01.000Z");
  EXPECT_EQ(Get(port(), "/api/v1/changes/" + id).Json(), feature);
  EXPECT_EQ(Get(port(), "/api/v1/hazards").Json()["features"].size(), 0U);
}

TEST_F(MapChangeApiTest, ListsFilterByBoxStateAndSequence) {
  Tell();
  const std::string far = Tell("car-1", true, {41, -79});
  Tell("car-2", false, {41, -79});  // The opposite, later: undone.
  EXPECT_EQ(Features().size(), 1U);
  EXPECT_EQ(Features("?bbox=-80,40,-79.5,40.5").size(), 1U);
  EXPECT_EQ(Features("?bbox=-80,41,-79.5,42").size(), 0U);
  EXPECT_EQ(Features("?state=undone").at(0)["id"], far);
  EXPECT_EQ(Features("?state=undone,dismissed").size(), 1U);
  const auto since = Features("?since=1");
  ASSERT_EQ(since.size(), 1U);
  EXPECT_EQ(since[0]["properties"]["action"], "removed");
  EXPECT_EQ(Features("?since=1&state=undone")[0]["properties"]["action"], "updated");
}

TEST_F(MapChangeApiTest, WrongRequestsAreToldWhatIsAccepted) {
  const auto error = [&](const std::string& address, int status) {
    const HttpResult result = Get(port(), "/api/v1/changes" + address);
    EXPECT_EQ(result.status, status) << address;
    return result.Json()["error"].get<std::string>();
  };
  EXPECT_THAT(error("?state=gone", 400), HasSubstr("proposed, confirmed, undone and dismissed"));
  EXPECT_THAT(error("?box=1,2,3,4", 400), HasSubstr("bbox, since, limit and state"));
  EXPECT_THAT(error("/none", 400), HasSubstr("no UUID"));
  EXPECT_THAT(error("/00000000-0000-4000-8000-000000000000", 404), HasSubstr("no map change"));
  EXPECT_THAT(error("/00000000-0000-4000-8000-000000000000/events", 404), HasSubstr("no map"));
  EXPECT_THAT(error("/" + Tell() + "/decision", 405), HasSubstr("accepted is POST"));
  error("es", 404);
}

TEST_F(MapChangeApiTest, AnOfficialDismissesAndPutsBackAndTheHistorySaysWhy) {
  const std::string id = Tell();
  const HttpResult dismissed =
      Decide(id, R"({"decision": "dismiss", "reason": "a shadow"})", tokens_.token());
  ASSERT_EQ(dismissed.status, 200) << dismissed.body;
  EXPECT_EQ(dismissed.Json()["properties"]["state"], "dismissed");
  EXPECT_EQ(Features().size(), 0U);
  EXPECT_EQ(Decide(id, R"({"decision": "dismiss", "reason": "x"})", tokens_.token()).status, 409);
  EXPECT_EQ(Decide(id, R"({"decision": "confirm"})", tokens_.token()).status, 200);
  const auto events = Get(port(), "/api/v1/changes/" + id + "/events").Json()["events"];
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[0]["from"], nullptr);
  EXPECT_EQ(events[1]["reason"], "dismissed by miller: a shadow");
  EXPECT_EQ(events[2]["to"], "confirmed");
}

TEST_F(MapChangeApiTest, AnUndoThatNamesItsDecisionLeavesALaterOneAlone) {
  const std::string id = Tell();
  const auto decide = [&](const std::string& body) { return Decide(id, body, tokens_.token()); };
  const auto dismissed = decide(R"({"decision": "dismiss", "reason": "a shadow"})").Json();
  const auto confirmed = decide(R"({"decision": "confirm"})").Json();
  const auto undo = [&](const nlohmann::json& decided) {
    return decide(
        nlohmann::json{{"decision", "undo"}, {"decision_id", decided["properties"]["decision_id"]}}
            .dump());
  };
  EXPECT_EQ(undo(dismissed).status, 409);
  EXPECT_EQ(undo(confirmed).Json()["properties"]["state"], "dismissed");
  EXPECT_EQ(decide(R"({"decision": "confirm", "decision_id": 1})").status, 400);
}

TEST_F(MapChangeApiTest, NobodyDecidesWithoutATokenOrAsNobodyShould) {
  const std::string id = Tell();
  EXPECT_EQ(Decide(id, R"({"decision": "confirm"})", "").status, 401);
  EXPECT_EQ(Decide(id, R"({"decision": "confirm"})", "wrong-token-of-some-length").status, 401);
  for (const char* body :
       {"", "[]", "{}", R"({"decision": "remove"})", R"({"decision": "dismiss"})",
        R"({"decision": 1})", R"({"decision": "confirm", "why": "x"})",
        R"({"decision": "confirm", "reason": "a\nb"})"}) {
    const HttpResult answer = Decide(id, body, tokens_.token());
    EXPECT_EQ(answer.status, 400) << body;
    EXPECT_THAT(answer.body, HasSubstr("accepted is")) << body;
  }
  EXPECT_EQ(
      Decide("00000000-0000-4000-8000-000000000000", R"({"decision": "confirm"})", tokens_.token())
          .status,
      404);
  EXPECT_EQ(Features().at(0)["properties"]["state"], "proposed");
}

TEST_F(MapChangeApiTest, TheLiveStreamTellsEachEvent) {
  StreamClient client(port());
  client.NextOfType("live");
  const std::string id = Tell("car-1");
  Tell("car-2");
  fixture_.zone->DismissMapChange(*Uuid::Parse(id), "miller", "why");
  std::uint64_t sequence = 0;
  for (const char* action : {"added", "updated", "removed"}) {
    const nlohmann::json message = client.NextOfType("change");
    EXPECT_EQ(message["action"], action);
    EXPECT_EQ(message["sequence"], ++sequence);
    EXPECT_EQ(message["feature"]["id"], id);
  }
}

TEST_F(MapChangeApiTest, TheStreamReplaysHazardsAndChangesInOneOrderWithoutAGap) {
  constexpr int kRounds = 300;  // More than one page of the replay of each.
  for (int i = 0; i < kRounds; ++i) {
    const double north = 0.0005 * i;
    fixture_.AddRow("pothole", {40 + north, -79}, 1);
    Tell("car-" + std::to_string(i % 3), false, {41 + north, -79});
  }
  StreamClient client(port(), "/ws?since=0");
  client.NextOfType("hello");
  for (std::uint64_t sequence = 1; sequence <= 2 * kRounds; ++sequence) {
    const nlohmann::json message = client.Next();
    ASSERT_EQ(message["sequence"], sequence);
    ASSERT_EQ(message["type"], sequence % 2 == 1 ? "hazard" : "change");
  }
  EXPECT_EQ(client.Next()["type"], "live");
}

}  // namespace
}  // namespace livemap::web
