#include "web/access/access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "accounts/account_store.h"
#include "common/clock.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;
using testing::Not;

const geo::GeoPoint kSeenAt{40.4433, -79.9436};
constexpr char kPassphrase[] = "correct horse battery";

/// Somebody at a browser: keeps the cookie and the CSRF token.
struct Browser {
  std::string cookie;
  std::string csrf_token;

  Headers WithCookie() const { return {{"Cookie", cookie}}; }
  Headers ThatDecides() const {
    return {{"Cookie", cookie}, {"X-CSRF-Token", csrf_token}, {"Content-Type", "application/json"}};
  }
};

class AccessTest : public testing::Test {
 protected:
  AccessTest() {
    accounts().Add("jones", accounts::Role::kViewer, kPassphrase, SystemNs());
    accounts().Add("miller", accounts::Role::kOfficial, kPassphrase, SystemNs());
    Start(PublicSees::kAll);
  }

  std::string AccountsFile() const { return folder_.path() + "/accounts.sqlite"; }
  /// As `livemap zone user` opens them, beside the server.
  accounts::AccountStore& accounts() {
    if (!accounts_) accounts_.emplace(AccountsFile(), accounts::AccountStore::Config{});
    return *accounts_;
  }

  void Start(PublicSees public_sees) {
    WebConfig options = TestOptions();
    options.accounts_file = AccountsFile();
    options.public_sees = public_sees;
    options.token_file = tokens_.path();
    options.heartbeat_s = 0.2;
    server_.reset();
    server_ = std::make_unique<WebServer>(options, *fixture_.zone, fixture_.catalogue);
  }
  int port() const { return server_->port(); }

  HttpResult Post(const std::string& target, const std::string& body, Headers headers = {}) {
    headers.emplace_back("Content-Type", "application/json");
    return Request(port(), "POST", target, headers, body);
  }
  HttpResult TryLogIn(const std::string& name, const std::string& password) {
    return Post("/api/v1/session", nlohmann::json{{"name", name}, {"password", password}}.dump());
  }
  Browser LogIn(const std::string& name) {
    const HttpResult answer = TryLogIn(name, kPassphrase);
    EXPECT_EQ(answer.status, 200) << answer.body;
    const std::string cookie = answer.Field("Set-Cookie");
    return {cookie.substr(0, cookie.find(';')), answer.Json().value("csrf_token", "")};
  }
  std::string Add(const std::string& class_name = "pothole") {
    return fixture_.zone->Handle(fixture_.MakeReport(class_name, kSeenAt)).hazard_uuid.ToString();
  }
  HttpResult Reject(const std::string& hazard, const Headers& headers) {
    return Request(port(), "POST", "/api/v1/hazards/" + hazard + "/reject", headers,
                   R"({"reason": "filled yesterday"})");
  }
  std::size_t HazardsSeen(const std::string& query, const Headers& headers = {}) {
    return Get(port(), "/api/v1/hazards" + query, headers).Json()["features"].size();
  }

  TokenFile tokens_;
  TemporaryFolder folder_;
  ZoneFixture fixture_;
  std::optional<accounts::AccountStore> accounts_;
  std::unique_ptr<WebServer> server_;
};

TEST_F(AccessTest, ASessionsCookieIsForThisServerAndNoScriptReadsIt) {
  const HttpResult answer = TryLogIn("miller", kPassphrase);
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.Json()["name"], "miller");
  EXPECT_EQ(answer.Json()["role"], "official");
  const std::string cookie = answer.Field("Set-Cookie");
  for (const char* attribute : {"Path=/;", "Secure;", "HttpOnly;", "SameSite=Strict;"}) {
    EXPECT_THAT(cookie, HasSubstr(attribute));
  }
  EXPECT_THAT(answer.body, Not(HasSubstr(cookie.substr(17, 64)))) << "the page is told the token";
}

TEST_F(AccessTest, AnOfficialDecidesByTheSessionInHisName) {
  const std::string hazard = Add();
  const HttpResult answer = Reject(hazard, LogIn("miller").ThatDecides());
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.Json()["properties"]["state"], "rejected");
  const auto history = Get(port(), "/api/v1/hazards/" + hazard + "/events");
  EXPECT_THAT(history.body, HasSubstr("miller"));
}

TEST_F(AccessTest, TheAuditTrailSaysWhoDecidedWhatAndWhatWasTakenBack) {
  const std::string hazard = Add();
  const Browser browser = LogIn("miller");
  const auto rejected = Reject(hazard, browser.ThatDecides()).Json()["properties"]["decision_id"];
  ASSERT_EQ(Request(port(), "POST", "/api/v1/hazards/" + hazard + "/undo", browser.ThatDecides(),
                    R"({"reason": "the wrong one"})")
                .status,
            200);
  EXPECT_EQ(Get(port(), "/api/v1/decisions").status, 401) << "strangers are told who decides";
  const auto trail = Get(port(), "/api/v1/decisions", LogIn("jones").WithCookie()).Json();
  ASSERT_EQ(trail["decisions"].size(), 2U);
  const auto& undo = trail["decisions"][0];
  const auto& reject = trail["decisions"][1];
  EXPECT_EQ(reject["id"], rejected);
  EXPECT_EQ(reject["decision"], "reject");
  EXPECT_EQ(reject["about"], "hazard");
  EXPECT_EQ(reject["subject"], hazard);
  EXPECT_EQ(reject["official"], "miller");
  EXPECT_EQ(reject["reason"], "filled yesterday");
  EXPECT_EQ(reject["undone_by"], undo["id"]);
  EXPECT_EQ(undo["decision"], "undo");
  EXPECT_EQ(undo["about"], "hazard");
  EXPECT_EQ(undo["undone_by"], nullptr);
  EXPECT_EQ(trail["next"], nullptr);

  const auto page = Get(port(), "/api/v1/decisions?limit=1", browser.WithCookie()).Json();
  EXPECT_EQ(page["next"], undo["id"]);
  const auto rest =
      Get(port(), "/api/v1/decisions?before=" + page["next"].dump(), browser.WithCookie()).Json();
  ASSERT_EQ(rest["decisions"].size(), 1U);
  EXPECT_EQ(rest["decisions"][0]["id"], rejected);
  EXPECT_EQ(Get(port(), "/api/v1/decisions?limit=0", browser.WithCookie()).status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/decisions?official=miller", browser.WithCookie()).status, 400);
}

TEST_F(AccessTest, WithoutTheSessionsOwnCsrfTokenNothingIsDecided) {
  const std::string hazard = Add();
  Browser browser = LogIn("miller");
  const std::string right = browser.csrf_token;
  for (const std::string& forged : {std::string(), std::string(64, '0'), right.substr(1) + "0"}) {
    browser.csrf_token = forged;
    const HttpResult answer = Reject(hazard, browser.ThatDecides());
    EXPECT_EQ(answer.status, 403) << forged;
    EXPECT_THAT(answer.body, HasSubstr("X-CSRF-Token"));
  }
  browser.csrf_token = LogIn("miller").csrf_token;
  EXPECT_EQ(Reject(hazard, browser.ThatDecides()).status, 403) << "another session's token";
  browser.csrf_token = right;
  EXPECT_EQ(Reject(hazard, browser.ThatDecides()).status, 200);
}

TEST_F(AccessTest, ATokenThatSpeaksForOthersDecidesInTheNameThatItGives) {
  const std::string hazard = Add();
  const auto reject = [&](const std::string& id, const std::string& token,
                          const std::string& name) {
    return Reject(id, {{"Authorization", "Bearer " + token},
                       {"Content-Type", "application/json"},
                       {"X-LiveMap-On-Behalf-Of", name}});
  };
  const std::string region = TokenFile::region_token();
  const HttpResult refused = reject(hazard, TokenFile::token(), "alice");
  EXPECT_EQ(refused.status, 403);
  EXPECT_THAT(refused.body, HasSubstr("speaks-for-others"));
  // With " at metro" it has 65 bytes.
  EXPECT_EQ(reject(hazard, region, std::string(56, 'a')).status, 400);
  // A tab, no UTF-8, a text that runs backwards, a control character of Latin-1, no width.
  for (const char* hostile : {"a\tb", "\xff\xfe",
                              "\xe2\x80\xae"
                              "ecila",
                              "\xc2\x85", "\xe2\x80\x8b"}) {
    const HttpResult answer = reject(hazard, region, hostile);
    EXPECT_EQ(answer.status, 400) << hostile;
    EXPECT_THAT(answer.body, HasSubstr("accepted is a printable name"));
  }
  EXPECT_TRUE(fixture_.zone->Decisions(UINT64_MAX, 10).empty());
  EXPECT_EQ(reject(hazard, region, "J\xc3\xbcrgen").status, 200);
  EXPECT_EQ(fixture_.zone->Decisions(UINT64_MAX, 1).at(0).official, "J\xc3\xbcrgen at metro");
  EXPECT_EQ(reject(Add("debris"), region, std::string(55, 'a')).status, 200);
  EXPECT_EQ(fixture_.zone->Decisions(UINT64_MAX, 1).at(0).official.size(), 64U);
}

TEST_F(AccessTest, WhoHasLoggedInSpeaksForNobodyElse) {
  const std::string hazard = Add();
  Headers headers = LogIn("miller").ThatDecides();
  headers.emplace_back("X-LiveMap-On-Behalf-Of", "root");
  EXPECT_EQ(Reject(hazard, headers).status, 403);
  EXPECT_TRUE(fixture_.zone->Decisions(UINT64_MAX, 10).empty());
}

TEST_F(AccessTest, WhatChangesNothingNeedsNoCsrfToken) {
  Add();
  const Browser browser = LogIn("miller");
  const std::string vehicle = fixture_.MakeReport("pothole", kSeenAt).vehicle_id;
  EXPECT_EQ(Get(port(), "/api/v1/vehicles/" + vehicle + "/distrust", browser.WithCookie()).status,
            200);
  EXPECT_EQ(Get(port(), "/api/v1/vehicles/nobody/distrust", browser.WithCookie()).status, 404);
}

TEST_F(AccessTest, AViewerAndAStrangerDecideNothing) {
  const std::string hazard = Add();
  EXPECT_EQ(Reject(hazard, LogIn("jones").ThatDecides()).status, 403);
  const HttpResult stranger = Reject(hazard, {{"Content-Type", "application/json"}});
  EXPECT_EQ(stranger.status, 401);
  EXPECT_THAT(stranger.body, HasSubstr("log in"));
  EXPECT_EQ(Reject(hazard, {{"Content-Type", "application/json"},
                            {"Authorization", "Bearer " + tokens_.token()}})
                .status,
            200)
      << "a program's token no longer counts";
}

TEST_F(AccessTest, AtTheDeskAViewerAForgedTokenAndAStrangerDoNothing) {
  const std::string hazard = Add();
  const Browser official = LogIn("miller");
  const Browser viewer = LogIn("jones");
  const std::pair<const char*, const char*> decisions[] = {
      {"comment", R"({"text": "asked the water works"})"},
      {"assign", R"({"team": "Roads"})"},
      {"class", R"({"class": "debris"})"},
      {"move", R"({"position": [-79.9436, 40.4434]})"},
      {"merge", R"({"other": "00000000-0000-4000-8000-000000000001"})"},
      {"close", "{}"}};
  for (const auto& [what, body] : decisions) {
    const std::string target = "/api/v1/hazards/" + hazard + "/" + what;
    EXPECT_EQ(Request(port(), "POST", target, viewer.ThatDecides(), body).status, 403) << what;
    EXPECT_EQ(Post(target, body).status, 401) << what;
    Browser forged = official;
    forged.csrf_token = viewer.csrf_token;
    EXPECT_EQ(Request(port(), "POST", target, forged.ThatDecides(), body).status, 403) << what;
  }
  EXPECT_TRUE(Get(port(), "/api/v1/decisions", official.WithCookie()).Json()["decisions"].empty());
}

TEST_F(AccessTest, WhatTheDeskReadsIsForThoseWhoHaveLoggedIn) {
  const std::string hazard = Add();
  const Browser viewer = LogIn("jones");
  for (const std::string& target :
       {std::string("/api/v1/assignments"), std::string("/api/v1/statistics"),
        "/api/v1/decisions?hazard=" + hazard, "/api/v1/hazards/" + hazard + "/sightings"}) {
    EXPECT_EQ(Get(port(), target).status, 401) << target;
    EXPECT_EQ(Get(port(), target, viewer.WithCookie()).status, 200) << target;
  }
}

TEST_F(AccessTest, AStolenSessionIsWorthNothingAfterTheLogOut) {
  const std::string hazard = Add();
  const Browser browser = LogIn("miller");
  EXPECT_EQ(Get(port(), "/api/v1/session", browser.WithCookie()).Json()["name"], "miller");
  Browser forged = browser;
  forged.csrf_token = std::string(64, '0');
  EXPECT_EQ(Request(port(), "DELETE", "/api/v1/session", forged.ThatDecides()).status, 403);
  const HttpResult out = Request(port(), "DELETE", "/api/v1/session", browser.ThatDecides());
  EXPECT_EQ(out.status, 200) << out.body;
  EXPECT_THAT(out.Field("Set-Cookie"), HasSubstr("Max-Age=0"));
  EXPECT_EQ(Reject(hazard, browser.ThatDecides()).status, 401);
  EXPECT_EQ(Get(port(), "/api/v1/vehicles", browser.WithCookie()).status, 401);
  EXPECT_EQ(Get(port(), "/api/v1/session", browser.WithCookie()).Json()["name"], nullptr);
}

TEST_F(AccessTest, WhatTheOperatorTakesAwayIsGoneAtOnce) {
  const std::string hazard = Add();
  const Browser browser = LogIn("miller");
  accounts().SetRole("miller", accounts::Role::kViewer);
  EXPECT_EQ(Reject(hazard, browser.ThatDecides()).status, 403);
  accounts().Remove("miller");
  EXPECT_EQ(Reject(hazard, browser.ThatDecides()).status, 401);
  EXPECT_EQ(TryLogIn("miller", kPassphrase).status, 401);
}

TEST_F(AccessTest, WrongPasswordsAreAnsweredAlikeAndSoonNoMore) {
  const std::string unknown = TryLogIn("nobody", kPassphrase).body;
  for (int i = 1; i < Access::kMaxWrongPasswords; ++i) {
    const HttpResult answer = TryLogIn("miller", "wrong password " + std::to_string(i));
    ASSERT_EQ(answer.status, 401) << i;
    EXPECT_EQ(answer.body, unknown);
  }
  const HttpResult locked = TryLogIn("miller", kPassphrase);
  EXPECT_EQ(locked.status, 429) << "the right one is still tried";
  EXPECT_EQ(locked.Field("Retry-After"), "60");
}

TEST_F(AccessTest, ALogInOfAnotherOriginOrAnotherShapeIsRefused) {
  EXPECT_EQ(Post("/api/v1/session", R"({"name": "miller", "password": "correct horse battery"})",
                 {{"Origin", "https://evil.example"}})
                .status,
            403);
  for (const char* body : {"", "[]", "{", R"({"name": "miller"})", R"({"name": 1, "password": 2})",
                           R"({"name": "m", "password": "p", "role": "admin"})"}) {
    EXPECT_EQ(Post("/api/v1/session", body).status, 400) << body;
  }
  EXPECT_EQ(
      Request(port(), "POST", "/api/v1/session", {{"Content-Type", "text/plain"}}, "{}").status,
      415);
  EXPECT_EQ(Request(port(), "PUT", "/api/v1/session").status, 405);
}

TEST_F(AccessTest, VehiclesAreForThoseWhoHaveLoggedIn) {
  EXPECT_EQ(Get(port(), "/api/v1/vehicles").status, 401);
  EXPECT_EQ(Get(port(), "/api/v1/vehicles", LogIn("jones").WithCookie()).status, 200);
  EXPECT_EQ(
      Get(port(), "/api/v1/vehicles", {{"Authorization", "Bearer " + tokens_.token()}}).status,
      200);
}

TEST_F(AccessTest, ThePublicSeesWhatItMay) {
  const std::string candidate = Add("pothole");
  const std::string told = Add("deer");  // One report is enough to warn of an animal.
  const Headers jones = LogIn("jones").WithCookie();
  EXPECT_EQ(HazardsSeen(""), 2U);

  Start(PublicSees::kTold);
  EXPECT_EQ(HazardsSeen(""), 1U);
  EXPECT_EQ(HazardsSeen("?since=0"), 1U);
  EXPECT_EQ(Get(port(), "/api/v1/hazards?state=candidate").status, 401);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/points").body.find(candidate), std::string::npos);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + candidate).status, 404);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + told).status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + told + "/events").status, 401);
  EXPECT_EQ(Get(port(), "/api/v1/changes").status, 401);
  EXPECT_EQ(HazardsSeen("", jones), 2U);

  Start(PublicSees::kNothing);
  for (const char* target : {"/api/v1/hazards", "/api/v1/hazards/points", "/api/v1/changes",
                             "/api/v1/vehicles", "/images/0"}) {
    EXPECT_EQ(Get(port(), target).status, 401) << target;
  }
  EXPECT_EQ(Get(port(), "/api/v1/config").status, 200) << "the page cannot show its log-in";
  EXPECT_EQ(HazardsSeen("", jones), 2U);
}

TEST_F(AccessTest, AStreamTellsWhatItsClientMaySeeAndEndsWithTheLogIn) {
  Start(PublicSees::kTold);
  const Browser browser = LogIn("jones");
  StreamClient viewer(port(), "/ws", "", 0, browser.cookie);
  StreamClient stranger(port());
  viewer.NextOfType("live");
  stranger.NextOfType("live");
  zone::VehicleState vehicle;
  vehicle.vehicle_id = "car-1";
  vehicle.position = kSeenAt;
  vehicle.stamp_ns = ZoneFixture::kStartNs;
  ASSERT_TRUE(fixture_.zone->UpdateVehicle(vehicle));
  const std::string candidate = Add("pothole");
  const std::string told = Add("deer");
  EXPECT_EQ(viewer.NextOfType("vehicle")["feature"]["id"], "car-1");
  EXPECT_EQ(viewer.NextOfType("hazard")["feature"]["id"], candidate);
  for (nlohmann::json message = stranger.Next();; message = stranger.Next()) {
    ASSERT_NE(message["type"], "vehicle");
    if (message["type"] != "hazard") continue;
    EXPECT_EQ(message["feature"]["id"], told) << "the candidate was told to a stranger";
    break;
  }
  Request(port(), "DELETE", "/api/v1/session", browser.ThatDecides());
  EXPECT_THROW(viewer.NextOfType("never"), boost::system::system_error);
  EXPECT_EQ(stranger.NextOfType("beat")["type"], "beat") << "everybody's stream was closed";
}

TEST_F(AccessTest, AClosedMapHasNoStreamForStrangers) {
  Start(PublicSees::kNothing);
  EXPECT_THROW(StreamClient{port()}, boost::system::system_error);
  StreamClient viewer(port(), "/ws", "", 0, LogIn("jones").cookie);
  EXPECT_EQ(viewer.Next()["type"], "hello");
}

TEST_F(AccessTest, WithoutAnAccountEverythingIsAsItWas) {
  accounts().Remove("jones");
  accounts().Remove("miller");
  EXPECT_EQ(Get(port(), "/api/v1/vehicles").status, 200);
  EXPECT_EQ(TryLogIn("miller", kPassphrase).status, 403);
  EXPECT_EQ(Get(port(), "/api/v1/session").Json()["has_accounts"], false);
}

}  // namespace
}  // namespace livemap::web
