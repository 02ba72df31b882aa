#include "region/region_desk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>

#include "accounts/account_store.h"
#include "common/clock.h"
#include "region/region_server.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::region {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

constexpr char kPassphrase[] = "correct horse battery";
const geo::GeoPoint kInNorth{40.4433, -79.9436};
const geo::GeoPoint kInSouth{40.30, -79.95};

/// Bounds a hang.
void WaitFor(const std::function<bool()>& is_done) {
  for (int i = 0; i < 3000 && !is_done(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_TRUE(is_done());
}

/// Somebody at a browser: keeps the cookie and the CSRF token.
struct Visitor {
  std::string cookie;
  std::string csrf_token;

  web::Headers WithCookie() const { return {{"Cookie", cookie}}; }
  web::Headers ThatDecides() const {
    return {{"Cookie", cookie}, {"X-CSRF-Token", csrf_token}, {"Content-Type", "application/json"}};
  }
};

/// Two real zones, and a region with accounts that follows them with their tokens.
class RegionDeskTest : public testing::Test {
 protected:
  RegionDeskTest() {
    // Passwords are slow to hash, so that nobody guesses them.
    static const web::TemporaryFolder once;
    const std::string file = once.path() + "/accounts.sqlite";
    if (!std::filesystem::exists(file)) {
      accounts::AccountStore people(file, {});
      people.Add("jones", accounts::Role::kViewer, kPassphrase, SystemNs());
      people.Add("alice", accounts::Role::kOfficial, kPassphrase, SystemNs());
      people.Add("root", accounts::Role::kAdmin, kPassphrase, SystemNs());
    }
    std::filesystem::copy_file(file, options_.accounts_file);
    Start(web::TokenFile::region_token());
  }

  void Start(const std::string& north_token) {
    server_.reset();
    region_.reset();
    Region::Config config;
    config.directory = folder_.path();
    config.ask_every_s = 0.1;
    config.longest_pause_s = 0.2;
    config.zones = {
        {"north", "The North", Url(*north_server_), north_token, std::nullopt},
        {"south", "", Url(*south_server_), web::TokenFile::region_token(), std::nullopt}};
    for (RegionZone& zone : config.zones) zone.with_candidates = true;
    region_ = std::make_unique<Region>(
        config, north_.catalogue, [this] { return north_.now_ns.load(); },
        [](const std::string&) {});
    server_ = std::make_unique<RegionServer>(options_, *region_, north_.catalogue);
    WaitFor([this] { return region_->HasAskedAll(); });
  }

  static web::WebConfig ZoneOptions(const std::string& token_file) {
    web::WebConfig options = web::TestOptions();
    options.token_file = token_file;
    return options;
  }
  static std::string Url(const web::WebServer& server) {
    return "http://127.0.0.1:" + std::to_string(server.port());
  }
  /// A candidate, by the region's id.
  std::string Add(const std::string& zone, web::ZoneFixture& fixture,
                  const geo::GeoPoint& position) {
    const Uuid hazard = fixture.zone->Handle(fixture.MakeReport("pothole", position)).hazard_uuid;
    const Uuid id = RegionHazardId(zone, hazard);
    WaitFor([&] { return region_->map().Find(id).has_value(); });
    return id.ToString();
  }
  bool IsGone(const std::string& id) const {
    return region_->map().Find(*Uuid::Parse(id))->state == zone::HazardState::kGone;
  }
  std::string AddNorth() { return Add("north", north_, kInNorth); }
  std::string AddSouth() { return Add("south", south_, kInSouth); }

  web::HttpResult Get(const std::string& target, const web::Headers& headers = {}) const {
    return web::Get(server_->port(), target, headers);
  }
  web::HttpResult Post(const std::string& target, const std::string& body,
                       const web::Headers& headers) const {
    return web::Request(server_->port(), "POST", target, headers, body);
  }
  web::HttpResult Decide(const std::string& hazard, const std::string& what,
                         const std::string& body, const Visitor& visitor) const {
    return Post("/api/v1/hazards/" + hazard + "/" + what, body, visitor.ThatDecides());
  }
  /// By the password.
  Visitor LogInAs(const std::string& name) const {
    const auto answer =
        Post("/api/v1/session", nlohmann::json{{"name", name}, {"password", kPassphrase}}.dump(),
             {{"Content-Type", "application/json"}});
    EXPECT_EQ(answer.status, 200) << answer.body;
    const std::string cookie = answer.Field("Set-Cookie");
    return {cookie.substr(0, cookie.find(';')), answer.Json().value("csrf_token", "")};
  }
  /// As somebody who has logged in before.
  Visitor LogIn(const std::string& name) const {
    accounts::AccountStore people(options_.accounts_file, {});
    const std::string cookie =
        "livemap_" + people.id() + '=' + people.OpenSession(name, SystemNs());
    return {cookie, Get("/api/v1/session", {{"Cookie", cookie}}).Json().value("csrf_token", "")};
  }
  std::set<std::string> Decided(const Visitor& visitor) const {
    std::set<std::string> lines;
    const auto trail = Get("/api/v1/decisions", visitor.WithCookie()).Json();
    for (const auto& one : trail["decisions"]) {
      lines.insert(one["zone"].get<std::string>() + ' ' + one["decision"].get<std::string>() +
                   " by " + one["official"].get<std::string>() + " about " +
                   one["subject"].get<std::string>());
    }
    return lines;
  }

  web::TemporaryFolder folder_;
  web::WebConfig options_ = [this] {
    web::WebConfig options = web::TestOptions();
    options.accounts_file = folder_.path() + "/accounts.sqlite";
    return options;
  }();
  web::TokenFile tokens_;
  web::ZoneFixture north_;
  web::ZoneFixture south_;
  std::unique_ptr<web::WebServer> north_server_ =
      std::make_unique<web::WebServer>(ZoneOptions(tokens_.path()), *north_.zone, north_.catalogue);
  std::unique_ptr<web::WebServer> south_server_ =
      std::make_unique<web::WebServer>(ZoneOptions(tokens_.path()), *south_.zone, south_.catalogue);
  std::unique_ptr<Region> region_;
  std::unique_ptr<RegionServer> server_;
};

TEST_F(RegionDeskTest, CandidatesAreSeenByThoseAloneWhoHaveLoggedIn) {
  const std::string id = AddNorth();
  EXPECT_EQ(Get("/api/v1/hazards").Json()["features"].size(), 0U);
  EXPECT_EQ(Get("/api/v1/hazards/" + id).status, 404);
  EXPECT_EQ(Get("/api/v1/hazards?state=candidate").status, 401);
  EXPECT_THAT(Get("/feeds/hazards.csv").body, testing::Not(HasSubstr(id)));
  const Visitor viewer = LogIn("jones");
  const auto seen = Get("/api/v1/hazards?state=candidate", viewer.WithCookie()).Json();
  ASSERT_EQ(seen["features"].size(), 1U);
  EXPECT_EQ(seen["features"][0]["id"], id);
  EXPECT_THAT(Get("/api/v1/hazards/points", viewer.WithCookie()).body, HasSubstr(id));
  EXPECT_EQ(Get("/api/v1/session", viewer.WithCookie()).Json()["sees"],
            (nlohmann::json{{"told", true}, {"candidates", true}, {"vehicles", false}}));
  EXPECT_EQ(Get("/api/v1/changes", viewer.WithCookie()).Json()["features"].size(), 0U);
}

TEST_F(RegionDeskTest, ADecisionIsMadeInTheHazardsZoneInTheNameOfWhoDecided) {
  const std::string north = AddNorth();
  const std::string south = AddSouth();
  const Visitor alice = LogIn("alice");
  const auto confirmed = Decide(north, "confirm", "", alice);
  ASSERT_EQ(confirmed.status, 200) << confirmed.body;
  EXPECT_EQ(confirmed.Json()["id"], north);
  EXPECT_EQ(confirmed.Json()["properties"]["state"], "active");
  const auto rejected = Decide(south, "reject", R"({"reason": "a shadow"})", alice);
  ASSERT_EQ(rejected.status, 200) << rejected.body;
  const auto decision = rejected.Json()["properties"]["decision_id"];
  EXPECT_EQ(Decided(alice),
            (std::set<std::string>{"north confirm by alice at metro about " + north,
                                   "south reject by alice at metro about " + south}));
  EXPECT_EQ(north_.zone->Decisions(UINT64_MAX, 10).at(0).official, "alice at metro");
  // Everybody sees what was confirmed, and only that.
  WaitFor([&] { return Get("/api/v1/hazards").Json()["features"].size() == 1; });
  EXPECT_EQ(Get("/api/v1/hazards").Json()["features"][0]["id"], north);
  // Rejected it has left the region's map; it can be taken back all the same.
  const auto undone =
      Decide(south, "undo", nlohmann::json{{"decision_id", decision}}.dump(), alice);
  ASSERT_EQ(undone.status, 200) << undone.body;
  EXPECT_EQ(undone.Json()["properties"]["state"], "candidate");
  EXPECT_EQ(south_.zone->Decisions(UINT64_MAX, 10).size(), 2U);
}

TEST_F(RegionDeskTest, ADecisionFromTheTrailCanBeTakenBackAfterTheRegionWasStartedAgain) {
  const std::string south = AddSouth();
  const Visitor alice = LogIn("alice");
  ASSERT_EQ(Decide(south, "reject", R"({"reason": "a shadow"})", alice).status, 200);
  WaitFor([&] { return IsGone(south); });
  Start(web::TokenFile::region_token());
  EXPECT_EQ(Decide(south, "undo", "", alice).status, 404) << "it was known without being named";
  EXPECT_THAT(Decided(alice), SizeIs(1));
  EXPECT_EQ(Get("/api/v1/hazards/" + south, alice.WithCookie()).Json()["properties"]["state"],
            "rejected");
  EXPECT_EQ(Decide(south, "undo", "", alice).status, 200);
}

TEST_F(RegionDeskTest, AHazardsHistorySightingsAndDeskAreThoseOfItsZone) {
  const std::string north = AddNorth();
  const Visitor alice = LogIn("alice");
  const auto read = [&](const std::string& below) {
    return Get("/api/v1/hazards/" + north + below, alice.WithCookie());
  };
  EXPECT_EQ(read("/events").Json()["id"], north);
  EXPECT_EQ(read("/events?limit=1").Json()["events"].size(), 1U);
  EXPECT_EQ(read("/sightings").Json()["sightings"].size(), 1U);
  EXPECT_EQ(read("/frame").Json()["state"], "none");
  EXPECT_EQ(read("/confirm").status, 405);
  EXPECT_EQ(read("/else").status, 404);
  EXPECT_EQ(Decide(north, "comment", R"({"text": "ask the owner"})", alice).status, 200);
  EXPECT_EQ(Decide(north, "assign", R"({"team": "Roads north"})", alice).status, 200);
  EXPECT_EQ(Decide(north, "class", R"({"class": "debris"})", alice).status, 200);
  EXPECT_EQ(Decide(north, "move", R"({"position": [-79.9437, 40.4434]})", alice).status, 200);
  const auto assigned = Get("/api/v1/assignments", alice.WithCookie()).Json();
  ASSERT_TRUE(assigned["assignments"].is_array()) << assigned;
  ASSERT_EQ(assigned["assignments"].size(), 1U) << assigned;
  EXPECT_EQ(assigned["assignments"][0]["hazard"], north);
  EXPECT_EQ(assigned["assignments"][0]["zone"], "north");
  EXPECT_EQ(Decide(north, "close", "", alice).status, 200);
  const auto counted = Get("/api/v1/statistics?weeks=2", alice.WithCookie()).Json();
  EXPECT_EQ(counted["all"]["repaired"], 1) << counted;
  EXPECT_EQ(counted["missing"].size(), 0U);
  EXPECT_EQ(counted["weeks"].size(), 1U);
}

TEST_F(RegionDeskTest, APictureComesFromTheZoneThatTheSightingNames) {
  auto report = north_.MakeReport("pothole", kInNorth);
  report.image_format = "png";
  report.image = web::OnePixelPng();
  const Uuid hazard = north_.zone->Handle(report).hazard_uuid;
  const Uuid id = RegionHazardId("north", hazard);
  WaitFor([&] { return region_->map().Find(id).has_value(); });
  const Visitor alice = LogIn("alice");
  const auto feature = Get("/api/v1/hazards/" + id.ToString(), alice.WithCookie()).Json();
  const std::string address = feature["properties"]["image"];
  EXPECT_THAT(address, testing::MatchesRegex("/images/[0-9a-f]+\\?zone=north"));
  const auto picture = Get(address, alice.WithCookie());
  EXPECT_EQ(picture.status, 200);
  EXPECT_EQ(picture.Field("Content-Type"), "image/jpeg");
  EXPECT_EQ(picture.body.substr(0, 3), "\xFF\xD8\xFF");
  EXPECT_EQ(Get(address).status, 401) << "strangers see pictures of candidates";
  const std::string path = address.substr(0, address.find('?'));
  EXPECT_EQ(Get(path + "?zone=south", alice.WithCookie()).status, 404);
  for (const char* query : {"", "?zone=elsewhere", "?zone=north&zone=south", "?zone=../north"}) {
    EXPECT_EQ(Get(path + query, alice.WithCookie()).status, 400) << query;
  }
}

TEST_F(RegionDeskTest, WhatAnOfficialSawIsComparedWithWhatIsThere) {
  const std::string north = AddNorth();
  const Visitor alice = LogIn("alice");
  const auto seen = Get("/api/v1/hazards?state=candidate", alice.WithCookie()).Json();
  const std::uint64_t sequence = seen["features"][0]["properties"]["sequence"];
  const auto body = [](std::uint64_t number) {
    return nlohmann::json{{"sequence", number}, {"position", {-79.9436, 40.4433}}}.dump();
  };
  const auto old = Decide(north, "confirm", body(sequence - 1), alice);
  EXPECT_EQ(old.status, 409);
  EXPECT_EQ(old.Json()["changed"], true);
  EXPECT_EQ(Decide(north, "confirm", body(sequence), alice).status, 200);
  // The zone knows better than the region's map, which follows it.
  north_.zone->Reject(region_->map().OriginOf(*Uuid::Parse(north))->hazard, "miller", "gone");
  EXPECT_EQ(Decide(north, "confirm", body(sequence), alice).status, 409);
}

TEST_F(RegionDeskTest, HazardsOfOneZoneAloneAreMerged) {
  const std::string north = AddNorth();
  const std::string other = Add("north", north_, {40.4533, -79.9436});
  const std::string south = AddSouth();
  const Visitor alice = LogIn("alice");
  const auto merge = [&](const std::string& with) {
    return Decide(north, "merge", nlohmann::json{{"other", with}}.dump(), alice);
  };
  const auto refused = merge(south);
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body,
              AllOf(HasSubstr("'south'"), HasSubstr("accepted is one of zone 'north'")));
  EXPECT_EQ(merge("00000000-0000-4000-8000-000000000001").status, 404);
  EXPECT_TRUE(north_.zone->Decisions(UINT64_MAX, 10).empty());
  // Both ids are the zone's by now: it says that the two are too far apart, or that it is done.
  EXPECT_THAT(merge(other).status, testing::AnyOf(200, 409));
  EXPECT_THAT(merge(other).body, testing::Not(HasSubstr("knows no")));
}

TEST_F(RegionDeskTest, StrangersViewersAndForgedRequestsDecideNothing) {
  const std::string north = AddNorth();
  const std::string target = "/api/v1/hazards/" + north + "/confirm";
  EXPECT_EQ(Post(target, "", {}).status, 401);
  EXPECT_EQ(Post(target, "", {{"Authorization", "Bearer " + web::TokenFile::token()}}).status, 401)
      << "a zone's token counts at the region";
  EXPECT_EQ(Decide(north, "confirm", "", LogIn("jones")).status, 403);
  Visitor forger = LogIn("alice");
  const std::string right = forger.csrf_token;
  forger.csrf_token = std::string(64, '0');
  EXPECT_EQ(Decide(north, "confirm", "", forger).status, 403);
  forger.csrf_token = right;
  auto headers = forger.ThatDecides();
  headers.emplace_back("Origin", "https://evil.example");
  EXPECT_EQ(Post(target, "", headers).status, 403);
  headers = forger.ThatDecides();
  headers.emplace_back("X-LiveMap-On-Behalf-Of", "root");
  EXPECT_EQ(Post(target, "", headers).status, 403) << "alice decides as root";
  for (const char* address : {"/api/v1/decisions", "/api/v1/assignments", "/api/v1/statistics"}) {
    EXPECT_EQ(Get(address).status, 401) << address;
  }
  EXPECT_EQ(Get("/api/v1/hazards/" + north + "/sightings").status, 401);
  EXPECT_EQ(Get("/api/v1/hazards/" + north + "/events").status, 401);
  EXPECT_TRUE(north_.zone->Decisions(UINT64_MAX, 10).empty());
}

TEST_F(RegionDeskTest, ASessionIsWorthNothingAfterTheLogOut) {
  const std::string north = AddNorth();
  const Visitor alice = LogInAs("alice");
  EXPECT_EQ(web::Request(server_->port(), "DELETE", "/api/v1/session", alice.ThatDecides()).status,
            200);
  EXPECT_EQ(Decide(north, "confirm", "", alice).status, 401);
  EXPECT_EQ(Get("/api/v1/decisions", alice.WithCookie()).status, 401);
  EXPECT_TRUE(north_.zone->Decisions(UINT64_MAX, 10).empty());
}

TEST_F(RegionDeskTest, ATokenThatMayNotSpeakForOthersDecidesNothing) {
  const std::string north = AddNorth();
  Start(web::TokenFile::token());
  const auto answer = Decide(north, "confirm", "", LogIn("alice"));
  EXPECT_EQ(answer.status, 403);
  EXPECT_THAT(answer.body, AllOf(HasSubstr("'north' refuses"), HasSubstr("speaks-for-others")));
  Start("");
  EXPECT_THAT(Decide(north, "confirm", "", LogIn("alice")).body, HasSubstr("has no token of"));
  EXPECT_TRUE(north_.zone->Decisions(UINT64_MAX, 10).empty());
}

TEST_F(RegionDeskTest, OfAZoneThatIsDownNothingIsDecidedAndTheOthersGoOn) {
  const std::string north = AddNorth();
  const std::string south = AddSouth();
  const Visitor alice = LogIn("alice");
  ASSERT_EQ(Decide(south, "comment", R"({"text": "seen"})", alice).status, 200);
  south_server_.reset();
  for (const char* what : {"confirm", "comment"}) {
    const auto answer = Decide(south, what, R"({"text": "seen"})", alice);
    EXPECT_EQ(answer.status, 503);
    EXPECT_THAT(answer.body, HasSubstr("zone 'south' does not answer"));
  }
  EXPECT_EQ(Get("/api/v1/hazards/" + south + "/events", alice.WithCookie()).status, 503);
  EXPECT_EQ(Get("/api/v1/hazards/" + south, alice.WithCookie()).Json()["properties"]["state"],
            "candidate");
  EXPECT_EQ(Decide(north, "confirm", "", alice).status, 200);
  WaitFor([this] { return !region_->status(1).is_up; });
  const auto trail = Get("/api/v1/decisions", alice.WithCookie()).Json();
  EXPECT_EQ(trail["missing"], (nlohmann::json{"south"}));
  EXPECT_EQ(trail["decisions"].size(), 1U);
  EXPECT_EQ(south_.zone->Decisions(UINT64_MAX, 10).size(), 1U) << "something was written late";
}

TEST_F(RegionDeskTest, TheTrailIsOneListTheNewestFirstAndOfOneZoneGoesOn) {
  const std::string north = AddNorth();
  const std::string south = AddSouth();
  const Visitor alice = LogIn("alice");
  for (int i = 0; i < 3; ++i) {
    for (auto* zone : {&north_, &south_}) zone->now_ns += 1'000'000'000;
    const std::string body = nlohmann::json{{"text", "note " + std::to_string(i)}}.dump();
    ASSERT_EQ(Decide(i == 1 ? south : north, "comment", body, alice).status, 200);
  }
  const auto get = [&](const std::string& query) {
    return Get("/api/v1/decisions" + query, alice.WithCookie()).Json();
  };
  const auto all = get("");
  ASSERT_EQ(all["decisions"].size(), 3U) << all;
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(all["decisions"][static_cast<std::size_t>(i)]["reason"],
              "note " + std::to_string(2 - i));
  }
  EXPECT_EQ(get("?limit=2")["decisions"].size(), 2U);
  EXPECT_EQ(get("?limit=2")["truncated"], true);
  const auto first = get("?zone=north&limit=1");
  EXPECT_EQ(first["decisions"][0]["reason"], "note 2");
  EXPECT_EQ(get("?zone=north&limit=1&before=" + first["next"].dump())["decisions"][0]["reason"],
            "note 0");
  EXPECT_EQ(get("?hazard=" + south)["decisions"].size(), 1U);
  for (const char* query : {"?zone=elsewhere", "?before=3", "?zone=north&zone=south", "?x=1"}) {
    EXPECT_EQ(Get("/api/v1/decisions" + std::string(query), alice.WithCookie()).status, 400)
        << query;
  }
}

TEST_F(RegionDeskTest, AnAdminManagesTheRegionsAccountsAndNobodyElseDoes) {
  const auto list = [&](const Visitor& visitor) {
    return Get("/api/v1/accounts", visitor.WithCookie());
  };
  EXPECT_EQ(list(LogIn("root")).Json()["accounts"].size(), 3U);
  EXPECT_EQ(list(LogIn("alice")).status, 403);
  EXPECT_EQ(Get("/api/v1/accounts").status, 401);
}

TEST_F(RegionDeskTest, WhatZonesAloneDecideIsNotDecidedHere) {
  const Visitor alice = LogIn("alice");
  for (const char* target : {"/api/v1/vehicles/car-1/distrust", "/api/v1/changes/x/decision"}) {
    EXPECT_EQ(Post(target, "", alice.ThatDecides()).status, 404) << target;
  }
  EXPECT_EQ(Post("/api/v1/hazards/x/confirm", "", alice.ThatDecides()).status, 400);
  auto headers = alice.ThatDecides();
  headers.pop_back();
  headers.emplace_back("Content-Type", "text/plain");
  EXPECT_EQ(Post("/api/v1/hazards/" + AddNorth() + "/confirm", "{}", headers).status, 415);
}

}  // namespace
}  // namespace livemap::region
