#include "web/officials/official_api.h"

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
    server_ = std::make_unique<WebServer>(Options(), *fixture_.zone, fixture_.catalogue);
  }

  WebConfig Options() const {
    WebConfig options = TestOptions();
    options.token_file = tokens_.path();
    return options;
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

TEST_F(OfficialApiTest, AnUndoThatNamesItsDecisionLeavesALaterOneAlone) {
  const std::string id = Add("pothole");
  const auto rejection =
      Post(id, "reject", kReason, tokens_.token()).Json()["properties"]["decision_id"];
  ASSERT_TRUE(rejection.is_number_unsigned());
  const auto confirmation =
      Post(id, "confirm", "", tokens_.token()).Json()["properties"]["decision_id"];
  const auto undo = [&](const nlohmann::json& decision) {
    return Post(id, "undo", nlohmann::json{{"decision_id", decision}}.dump(), tokens_.token());
  };
  const HttpResult refused = undo(rejection);
  EXPECT_EQ(refused.status, 409);
  EXPECT_EQ(refused.Json()["error"],
            "another decision about the hazard was made since, and nothing is undone");
  EXPECT_EQ(StateOf(id), "active");
  for (const nlohmann::json& bad : {nlohmann::json(0), nlohmann::json("1"), nlohmann::json(-1)}) {
    EXPECT_THAT(undo(bad).Json()["error"].get<std::string>(),
                HasSubstr("the decision_id is not accepted"))
        << bad;
  }
  EXPECT_EQ(Post(id, "reject", R"({"reason": "x", "decision_id": 1})", tokens_.token()).status,
            400);
  EXPECT_EQ(undo(confirmation).status, 200);
  EXPECT_EQ(StateOf(id), "rejected");
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

TEST_F(OfficialApiTest, AHazardThatChangedSinceItWasSeenIsLeftWithWhatChanged) {
  const std::string id = Add();
  const auto feature = Get(port(), "/api/v1/hazards/" + id).Json();
  const nlohmann::json seen{{"reason", "nothing there"},
                            {"sequence", feature["properties"]["sequence"]},
                            {"position", feature["geometry"]["coordinates"]}};
  ASSERT_EQ(Post(id, "reject", kReason, tokens_.token()).status, 200);
  const HttpResult refused = Post(id, "confirm", seen.dump(), tokens_.token());
  EXPECT_EQ(refused.status, 409);
  EXPECT_EQ(refused.Json()["changed"], true);
  EXPECT_THAT(std::string(refused.Json()["error"]), HasSubstr("and is rejected now"));
  for (const char* body :
       {R"({"reason": "x", "sequence": "1"})", R"({"reason": "x", "position": [1, 2]})",
        R"({"reason": "x", "sequence": 1, "position": [1]})",
        R"({"reason": "x", "sequence": 1, "position": [0, 91]})"}) {
    EXPECT_EQ(Post(id, "confirm", body, tokens_.token()).status, 400) << body;
  }
  EXPECT_EQ(Post(id, "undo", R"({"sequence": 1})", tokens_.token()).status, 400);
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
  EXPECT_EQ(Get(port(), "/api/v1/vehicles/car-1/distrust").status, 401);
  const HttpResult put = Request(port(), "PUT", "/api/v1/vehicles/car-1/distrust", {}, "");
  EXPECT_EQ(put.status, 405);
  EXPECT_EQ(put.Field("Allow"), "GET, HEAD, POST");
  EXPECT_EQ(Get(port(), "/api/v1/vehicles/car-1/trust").Field("Allow"), "POST");
  EXPECT_EQ(StateOf(id), "candidate");
}

TEST_F(OfficialApiTest, DistrustIsShownBeforeItIsDoneAndCanBeTakenBack) {
  const std::string id = Add("pothole");
  const Headers token{{"Authorization", "Bearer " + tokens_.token()},
                      {"Content-Type", "application/json"}};
  const std::string address = "/api/v1/vehicles/car-1";
  const auto preview = Get(port(), address + "/distrust", token).Json();
  EXPECT_EQ(preview["vehicle"], "car-1");
  EXPECT_EQ(preview["distrusted"], false);
  EXPECT_EQ(preview["hazards"], 1);
  EXPECT_EQ(preview["would_change"], 1);
  EXPECT_EQ(preview["would_vanish"], 1);
  ASSERT_EQ(preview["examples"].size(), 1U);
  EXPECT_EQ(
      preview["examples"][0],
      (nlohmann::json{{"id", id}, {"class", "pothole"}, {"from", "candidate"}, {"to", "gone"}}));
  EXPECT_EQ(preview["decisions"].size(), 0U);
  EXPECT_EQ(StateOf(id), "candidate") << "a look changes nothing";
  EXPECT_EQ(Get(port(), "/api/v1/vehicles/car-77/distrust", token).status, 404);
  EXPECT_EQ(Get(port(), address + "/distrust?x=1", token).status, 400);

  EXPECT_EQ(Distrust("car-1", kReason, tokens_.token()).Json()["hazards"], 1);
  EXPECT_EQ(StateOf(id), "gone");
  EXPECT_EQ(Request(port(), "POST", address + "/trust", {}, "").status, 401);
  const HttpResult trusted = Request(port(), "POST", address + "/trust", token, "");
  ASSERT_EQ(trusted.status, 200) << trusted.body;
  EXPECT_EQ(trusted.Json(), (nlohmann::json{{"vehicle", "car-1"}, {"hazards", 1}}));
  EXPECT_EQ(StateOf(id), "candidate");
  EXPECT_EQ(LastReason(id), "words of car-1 restored by miller");
  const auto history = Get(port(), address + "/distrust", token).Json()["decisions"];
  ASSERT_EQ(history.size(), 2U);
  EXPECT_EQ(history[0]["decision"], "trust");
  EXPECT_EQ(history[1]["decision"], "distrust");
  EXPECT_EQ(history[1]["undone"], true);
  EXPECT_EQ(history[1]["official"], "miller");
}

TEST_F(OfficialApiTest, ADecisionIsUndoneAndTheSameAgainChangesNothing) {
  const std::string id = Add("pothole");
  EXPECT_EQ(Post(id, "undo", "", tokens_.token()).status, 409);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Post(id, "reject", kReason, tokens_.token()).status, 200);
  const auto events = Get(port(), "/api/v1/hazards/" + id + "/events").Json()["events"];
  EXPECT_EQ(events.size(), 2U) << "added, rejected";
  const HttpResult undone = Post(id, "undo", R"({"reason": "wrong one"})", tokens_.token());
  ASSERT_EQ(undone.status, 200) << undone.body;
  EXPECT_EQ(undone.Json()["properties"]["state"], "candidate");
  EXPECT_EQ(LastReason(id), "reject undone by miller: wrong one");
  const std::uint64_t sequence = fixture_.zone->Sequence();
  EXPECT_EQ(Post(id, "undo", "", tokens_.token()).status, 200);
  EXPECT_EQ(fixture_.zone->Sequence(), sequence);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Post(id, "confirm", kReason, tokens_.token()).status, 200);
  EXPECT_EQ(fixture_.zone->Sequence(), sequence + 1);
  EXPECT_EQ(Post("00000000-0000-4000-8000-000000000000", "undo", "", tokens_.token()).status, 404);
  EXPECT_EQ(Post("x", "undo", "", tokens_.token()).status, 400);
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

TEST_F(OfficialApiTest, AWrongTokenIsCountedOnceWhateverItAsksFor) {
  Add();
  const std::string preview = "/api/v1/vehicles/car-1/distrust";
  for (const std::string& address : {preview, std::string("/api/v1/hazards")}) {
    const WebServer server(Options(), *fixture_.zone, fixture_.catalogue);
    for (int i = 1; i < OfficialAuthenticator::kMaxWrong; ++i) {
      const Headers wrong{{"Authorization", "Bearer guess" + std::to_string(i)}};
      EXPECT_NE(Get(server.port(), address, wrong).status, 429) << address;
    }
    const Headers right{{"Authorization", "Bearer " + tokens_.token()}};
    EXPECT_EQ(Get(server.port(), preview, right).status, 200) << "after wrong ones at " << address;
  }
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
        "{\"reason\": \"a\\nb\"}", "{\"reason\": \"\\u202e\"}", "{\"reason\": \"  \"}",
        "{\"reason\": \"\\u3000\\u00a0\"}", "{\"reason\": \"\\u2800\"}", "{\"reason\": \"x\"",
        "\xff"}) {
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
  EXPECT_EQ(again.status, 200) << "it is rejected already";
  EXPECT_EQ(again.Json()["properties"]["state"], "rejected");
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
