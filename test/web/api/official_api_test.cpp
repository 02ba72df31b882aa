#include "web/api/official_api.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;

const geo::GeoPoint kPlace{40.4433, -79.9436};
constexpr char kReason[] = R"({"reason": "filled yesterday"})";

class OfficialApiTest : public testing::Test {
 protected:
  OfficialApiTest() {
    WebConfig options = TestOptions();
    options.token_file = tokens_.path();
    server_ = std::make_unique<WebServer>(options, *fixture_.zone, fixture_.catalogue);
  }

  /// The id of a new hazard, told to drivers or not.
  std::string Add(const std::string& class_name = "pothole") {
    const protocol::Receipt receipt =
        fixture_.zone->Handle(fixture_.MakeReport(class_name, kPlace));
    EXPECT_EQ(receipt.status, protocol::Receipt::Status::kCommitted) << receipt.reason;
    return receipt.hazard_uuid.ToString();
  }
  HttpResult Post(const std::string& id, const std::string& what, const std::string& body,
                  const std::string& token, Headers headers = {}) {
    if (!token.empty()) headers.emplace_back("Authorization", "Bearer " + token);
    headers.emplace_back("Content-Type", "application/json");
    return Request(port(), "POST", "/api/v1/hazards/" + id + "/" + what, headers, body);
  }
  HttpResult Distrust(const std::string& vehicle, const std::string& body,
                      const std::string& token) {
    Headers headers{{"Content-Type", "application/json"}};
    if (!token.empty()) headers.emplace_back("Authorization", "Bearer " + token);
    return Request(port(), "POST", "/api/v1/vehicles/" + vehicle + "/distrust", headers, body);
  }
  std::string LastReason(const std::string& id) {
    const auto events = Get(port(), "/api/v1/hazards/" + id + "/events?limit=1").Json()["events"];
    return events.empty() ? "" : events[0]["reason"].get<std::string>();
  }
  std::string StateOf(const std::string& id) {
    return Get(port(), "/api/v1/hazards/" + id).Json()["properties"]["state"];
  }
  int port() const { return server_->port(); }

  TokenFile tokens_;
  ZoneFixture fixture_;
  std::unique_ptr<WebServer> server_;
};

TEST_F(OfficialApiTest, ARejectedHazardLeavesTheMapWithTheReasonInItsHistory) {
  const std::string id = Add();
  const HttpResult answer = Post(id, "reject", kReason, tokens_.token());
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.Json()["properties"]["state"], "rejected");
  EXPECT_EQ(Get(port(), "/api/v1/hazards").Json()["features"].size(), 0U);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + id).Json()["properties"]["active"], false);

  const auto events = Get(port(), "/api/v1/hazards/" + id + "/events").Json()["events"];
  ASSERT_GE(events.size(), 2U);
  EXPECT_EQ(events[0]["from"], nullptr);
  const auto& last = events[events.size() - 1];
  EXPECT_EQ(last["to"], "rejected");
  EXPECT_EQ(last["action"], "removed");
  EXPECT_EQ(last["sequence"], fixture_.zone->Sequence());
  EXPECT_THAT(last["reason"].get<std::string>(), HasSubstr("filled yesterday"));
  EXPECT_THAT(last["reason"].get<std::string>(), HasSubstr("miller"));
  EXPECT_EQ(last["time"], "2026-01-01T00:00:00.000Z");
}

TEST_F(OfficialApiTest, AConfirmationIsEnoughForDrivers) {
  const std::string id = Add("pothole");
  ASSERT_EQ(StateOf(id), "candidate") << "one vehicle suffices already";
  EXPECT_EQ(Post(id, "confirm", "", tokens_.token()).status, 200);
  EXPECT_EQ(StateOf(id), "active");
  EXPECT_EQ(Post(id, "confirm", "{}", tokens_.token()).status, 200);
}

TEST_F(OfficialApiTest, AConfirmationsReasonIsKeptInTheHistory) {
  const std::string id = Add("pothole");
  EXPECT_EQ(Post(id, "confirm", R"({"reason": "I was there"})", tokens_.token()).status, 200);
  EXPECT_EQ(LastReason(id), "confirmed by miller: I was there");
  EXPECT_EQ(Post(id, "confirm", R"({"reason": "still there"})", tokens_.token()).status, 200);
  EXPECT_EQ(LastReason(id), "confirmed by miller: still there");
  EXPECT_EQ(Post(id, "confirm", "", tokens_.token()).status, 200);
  EXPECT_EQ(LastReason(id), "confirmed by miller");
}

TEST_F(OfficialApiTest, ADistrustedVehiclesWordsAreWithdrawn) {
  const std::string id = Add("pothole");
  const HttpResult answer = Distrust("car-1", R"({"reason": "stolen"})", tokens_.token());
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.Json(), (nlohmann::json{{"vehicle", "car-1"}, {"hazards", 1}}));
  EXPECT_EQ(StateOf(id), "gone");
  EXPECT_EQ(LastReason(id), "words of car-1 withdrawn by miller: stolen");
  EXPECT_EQ(Distrust("car%2d1", kReason, tokens_.token()).Json()["hazards"], 0);
}

TEST_F(OfficialApiTest, OnlyOfficialsDistrustAndOnlyVehiclesThatThereAre) {
  const std::string id = Add("pothole");
  EXPECT_EQ(Distrust("car-1", kReason, "").status, 401);
  EXPECT_EQ(Distrust("car-1", kReason, "x" + tokens_.token()).status, 401);
  EXPECT_EQ(Distrust("car-1", "", tokens_.token()).status, 400) << "a reason is needed";
  EXPECT_EQ(Distrust("car-77", kReason, tokens_.token()).status, 404);
  EXPECT_EQ(Distrust("%0a", kReason, tokens_.token()).status, 404);
  const HttpResult get = Get(port(), "/api/v1/vehicles/car-1/distrust");
  EXPECT_EQ(get.status, 405);
  EXPECT_EQ(get.Field("Allow"), "POST");
  EXPECT_EQ(StateOf(id), "candidate");
}

TEST_F(OfficialApiTest, TheStreamTellsADecision) {
  const std::string id = Add("pothole");
  StreamClient client(port());
  client.NextOfType("live");
  ASSERT_EQ(Post(id, "confirm", "", tokens_.token()).status, 200);
  const auto confirmed = client.NextOfType("hazard");
  EXPECT_EQ(confirmed["action"], "updated");
  EXPECT_EQ(confirmed["feature"]["properties"]["state"], "active");
  ASSERT_EQ(Post(id, "reject", kReason, tokens_.token()).status, 200);
  const auto rejected = client.NextOfType("hazard");
  EXPECT_EQ(rejected["action"], "removed");
  EXPECT_EQ(rejected["feature"]["properties"]["state"], "rejected");
}

TEST_F(OfficialApiTest, WithoutTheTokenNothingHappens) {
  const std::string id = Add();
  const HttpResult none = Post(id, "reject", kReason, "");
  EXPECT_EQ(none.status, 401);
  EXPECT_THAT(none.Field("WWW-Authenticate"), HasSubstr("Bearer"));
  const HttpResult wrong = Post(id, "reject", kReason, "x" + tokens_.token());
  EXPECT_EQ(wrong.status, 401);
  EXPECT_EQ(wrong.Json()["error"], "the token is wrong");
  EXPECT_EQ(wrong.Field("Content-Type"), "application/json");
  EXPECT_NE(StateOf(id), "rejected");
}

TEST_F(OfficialApiTest, WithoutATokenFileNobodyMayDecide) {
  const std::string id = Add();
  const WebServer closed(TestOptions(), *fixture_.zone, fixture_.catalogue);
  const HttpResult answer = Request(closed.port(), "POST", "/api/v1/hazards/" + id + "/reject",
                                    {{"Authorization", "Bearer " + tokens_.token()}}, kReason);
  EXPECT_EQ(answer.status, 403);
  EXPECT_THAT(answer.Json()["error"].get<std::string>(), HasSubstr("without a token file"));
  EXPECT_EQ(Get(closed.port(), "/api/v1/config").Json()["officials"], false);
  EXPECT_EQ(Get(port(), "/api/v1/config").Json()["officials"], true);
}

TEST_F(OfficialApiTest, GuessersAreKeptOut) {
  const std::string id = Add();
  int status = 0;
  for (int i = 0; i <= OfficialAuthenticator::kMaxWrong; ++i) {
    status = Post(id, "reject", kReason, "guess" + std::to_string(i)).status;
  }
  EXPECT_EQ(status, 429);
  const HttpResult right = Post(id, "reject", kReason, tokens_.token());
  EXPECT_EQ(right.status, 429);
  EXPECT_EQ(right.Field("Retry-After"), "60");
  EXPECT_NE(StateOf(id), "rejected");
}

TEST_F(OfficialApiTest, PagesOfAnotherOriginMayNotDecide) {
  const std::string id = Add();
  const HttpResult foreign =
      Post(id, "reject", kReason, tokens_.token(), {{"Origin", "https://evil.example"}});
  EXPECT_EQ(foreign.status, 403);
  EXPECT_NE(StateOf(id), "rejected");
  const HttpResult preflight =
      Request(port(), "OPTIONS", "/api/v1/hazards/" + id + "/reject",
              {{"Origin", "https://evil.example"}, {"Access-Control-Request-Method", "POST"}});
  EXPECT_EQ(preflight.status, 405);
  EXPECT_EQ(preflight.Field("Access-Control-Allow-Origin"), "");
  const std::string own = "http://127.0.0.1:" + std::to_string(port());
  EXPECT_EQ(Post(id, "reject", kReason, tokens_.token(), {{"Origin", own}}).status, 200);
}

TEST_F(OfficialApiTest, SaysWhatIsWrongWithTheBody) {
  const std::string id = Add();
  for (const std::string body :
       {"", "{}", "[]", "7", "{\"reason\": \"\"}", "{\"reason\": 7}", "{\"why\": \"x\"}",
        "{\"reason\": \"a\\nb\"}", "{\"reason\": \"\\u202e\"}", "{\"reason\": \"x\"", "\xff"}) {
    const HttpResult answer = Post(id, "reject", body, tokens_.token());
    EXPECT_EQ(answer.status, 400) << body;
    EXPECT_THAT(answer.Json()["error"].get<std::string>(), HasSubstr("accepted is")) << body;
  }
  const std::string longest(120, 'x');
  EXPECT_EQ(Post(id, "reject", R"({"reason": "x)" + longest + "\"}", tokens_.token()).status, 400);
  EXPECT_EQ(Post(id, "reject", std::string(5000, ' '), tokens_.token()).status, 413);
  EXPECT_EQ(
      Request(port(), "POST", "/api/v1/hazards/" + id + "/reject",
              {{"Authorization", "Bearer " + tokens_.token()}, {"Content-Type", "text/plain"}},
              kReason)
          .status,
      415);
  EXPECT_NE(StateOf(id), "rejected");
  EXPECT_EQ(Post(id, "reject", R"({"reason": ")" + longest + "\"}", tokens_.token()).status, 200);
}

TEST_F(OfficialApiTest, KnowsWhichHazardsCanBeDecided) {
  const std::string id = Add();
  const std::string unknown = "00000000-0000-4000-8000-000000000000";
  EXPECT_EQ(Post(unknown, "reject", kReason, tokens_.token()).status, 404);
  EXPECT_EQ(Post("1%27or%271", "confirm", "", tokens_.token()).status, 400);
  EXPECT_EQ(Post(id, "reject", kReason, tokens_.token()).status, 200);
  const HttpResult again = Post(id, "reject", kReason, tokens_.token());
  EXPECT_EQ(again.status, 409);
  EXPECT_THAT(again.body, ::testing::HasSubstr("rejected already"));
  EXPECT_EQ(Post(id, "confirm", "", tokens_.token()).status, 200) << "a rejection can be revoked";
  ASSERT_TRUE(fixture_.zone->Remove(*Uuid::Parse(id), "test"));
  const HttpResult gone = Post(id, "confirm", "", tokens_.token());
  EXPECT_EQ(gone.status, 409);
  EXPECT_THAT(gone.body, ::testing::HasSubstr("gone"));
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + unknown + "/events").status, 404);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/x/events").status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + id + "/events?limit=0").status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + id + "/events?limit=1").Json()["events"].size(), 1U);
}

TEST_F(OfficialApiTest, DecisionsAreOnlyPosted) {
  const std::string id = Add();
  const HttpResult get = Get(port(), "/api/v1/hazards/" + id + "/reject",
                             {{"Authorization", "Bearer " + tokens_.token()}});
  EXPECT_EQ(get.status, 405);
  EXPECT_EQ(get.Field("Allow"), "POST");
  EXPECT_EQ(Post(id, "reject?x=1", kReason, tokens_.token()).status, 400);
  EXPECT_EQ(Post(id, "adopt", kReason, tokens_.token()).status, 405);
}

TEST_F(OfficialApiTest, ATokenFileThatIsNotAcceptedStopsTheServer) {
  WebConfig options = TestOptions();
  options.token_file = "/nowhere/tokens";
  try {
    const WebServer server(options, *fixture_.zone, fixture_.catalogue);
    FAIL() << "it runs without its tokens";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("token file '/nowhere/tokens' cannot be read"));
  }
}

}  // namespace
}  // namespace livemap::web
