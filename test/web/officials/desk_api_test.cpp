// The officials' console by HTTP.
#include "web/officials/desk_api.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

using testing::HasSubstr;

const geo::GeoPoint kDeskPlace{40.4433, -79.9436};

class DeskApiTest : public testing::Test {
 protected:
  DeskApiTest() {
    WebConfig options = TestOptions();
    options.token_file = tokens_.path();
    server_ = std::make_unique<WebServer>(options, *fixture_.zone, fixture_.catalogue);
  }

  std::string Add(double north_deg = 0, const std::string& class_name = "pothole") {
    const geo::GeoPoint place{kDeskPlace.latitude_deg + north_deg, kDeskPlace.longitude_deg};
    return fixture_.zone->Handle(fixture_.MakeReport(class_name, place)).hazard_uuid.ToString();
  }
  HttpResult Post(const std::string& id, const std::string& what, const std::string& body,
                  bool with_token = true) {
    Headers headers{{"Content-Type", "application/json"}};
    if (with_token) headers.emplace_back("Authorization", "Bearer " + TokenFile::token());
    return Request(port(), "POST", "/api/v1/hazards/" + id + "/" + what, headers, body);
  }
  std::uint64_t Decide(const std::string& id, const std::string& what, const std::string& body) {
    const HttpResult answer = Post(id, what, body);
    EXPECT_EQ(answer.status, 200) << answer.body;
    return answer.status == 200 ? answer.Json()["properties"]["decision_id"].get<std::uint64_t>()
                                : 0;
  }
  HttpResult Undo(const std::string& id, std::uint64_t decision) {
    return Post(id, "undo", R"({"decision_id": )" + std::to_string(decision) + "}");
  }
  int port() const { return server_->port(); }

  TokenFile tokens_;
  ZoneFixture fixture_;
  std::unique_ptr<WebServer> server_;
};

TEST_F(DeskApiTest, EveryDecisionNeedsAnOfficial) {
  const std::string id = Add();
  const std::pair<const char*, const char*> decisions[] = {
      {"comment", R"({"text": "a"})"},
      {"assign", R"({"team": "Roads"})"},
      {"close", "{}"},
      {"class", R"({"class": "deer"})"},
      {"move", R"({"position": [-79.9436, 40.4434]})"},
      {"merge", R"({"other": "00000000-0000-4000-8000-000000000001"})"}};
  for (const auto& [what, body] : decisions) {
    EXPECT_EQ(Post(id, what, body, false).status, 401) << what;
    EXPECT_EQ(Get(port(), "/api/v1/hazards/" + id + "/" + what).status, 405) << what;
  }
  EXPECT_TRUE(Get(port(), "/api/v1/decisions").Json()["decisions"].empty());
}

TEST_F(DeskApiTest, AWholeFrameIsAskedForOnceAndWhatBecameOfItIsTold) {
  const std::string id = Add();
  EXPECT_EQ(Post(id, "frame", "", false).status, 401);
  EXPECT_EQ(Post(id, "frame", R"({"text": "a"})").status, 400);
  auto frame = Get(port(), "/api/v1/hazards/" + id + "/frame").Json();
  EXPECT_EQ(frame["state"], "none");
  EXPECT_TRUE(frame["asked"].is_null());
  const std::uint64_t decision = Decide(id, "frame", "{}");
  frame = Get(port(), "/api/v1/hazards/" + id + "/frame").Json();
  EXPECT_EQ(frame["state"], "waiting");
  EXPECT_EQ(frame["official"], TokenFile::official());
  EXPECT_EQ(frame["decision_id"], decision);
  EXPECT_EQ(frame["asked"], "2026-01-01T00:00:00.000Z");
  EXPECT_EQ(frame["until"], "2026-01-01T04:00:00.000Z");
  EXPECT_TRUE(frame["picture"].is_null());
  EXPECT_EQ(Post(id, "frame", "{}").status, 409) << "one at a time";
  const auto trail = Get(port(), "/api/v1/decisions?hazard=" + id).Json()["decisions"];
  ASSERT_EQ(trail.size(), 1U);
  EXPECT_EQ(trail[0]["decision"], "frame");
  EXPECT_EQ(trail[0]["about"], "hazard");

  // A vehicle comes from the south, is asked, and brings it.
  constexpr double kMetres = 1 / 111'050.0;
  for (const double metres : {60.0, 45.0, 30.0}) {
    fixture_.now_ns += 1'000'000'000;
    fixture_.zone->UpdateVehicle(
        {"car-9",
         "",
         {kDeskPlace.latitude_deg - metres * kMetres, kDeskPlace.longitude_deg},
         0,
         15,
         fixture_.now_ns});
  }
  const auto polls = fixture_.zone->TakeDuePolls();
  ASSERT_EQ(polls.size(), 1U);
  protocol::PollAnswer answer;
  answer.poll = polls[0].poll;
  answer.hazard = polls[0].hazard;
  answer.vehicle_id = "car-9";
  answer.stamp_ns = fixture_.now_ns;
  answer.answer = protocol::PollAnswer::Answer::kNo;
  answer.confidence = 0.8F;
  answer.vehicle_position = {kDeskPlace.latitude_deg - 30 * kMetres, kDeskPlace.longitude_deg};
  answer.image_format = "png";
  answer.image = OnePixelPng();
  ASSERT_TRUE(fixture_.zone->HandleAnswer(answer));
  frame = Get(port(), "/api/v1/hazards/" + id + "/frame").Json();
  EXPECT_EQ(frame["state"], "taken");
  EXPECT_EQ(frame["picture"]["answer"], "no");
  EXPECT_EQ(Get(port(), frame["picture"]["image"].get<std::string>()).status, 200);
  const auto answers = Get(port(), "/api/v1/hazards/" + id + "/sightings").Json()["answers"];
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(answers[0]["whole_frame"], true);
  EXPECT_EQ(answers[0]["decision_id"], decision);
  EXPECT_EQ(answers[0]["image"], frame["picture"]["image"]);
  EXPECT_EQ(Undo(id, decision).status, 409) << "it has come";
}

TEST_F(DeskApiTest, TooManyRequestsForFramesAreAnswered429) {
  int status = 200;
  int asked = 0;
  for (; asked < 100 && status == 200; ++asked) {
    status = Post(Add(0.001 * asked), "frame", "").status;
  }
  EXPECT_EQ(status, 429);
  EXPECT_EQ(asked, 31) << "30 an hour by default";
  fixture_.now_ns += 3'600'000'000'000;
  EXPECT_EQ(Post(Add(0.5), "frame", "").status, 200);
}

TEST_F(DeskApiTest, TheAddressOfAFrameIsReadAndPosted) {
  const std::string address = "/api/v1/hazards/" + Add() + "/frame";
  const HttpResult put = Request(port(), "PUT", address, {}, "");
  EXPECT_EQ(put.status, 405);
  EXPECT_THAT(put.body, HasSubstr("GET, HEAD, POST"));
  EXPECT_EQ(Get(port(), address + "?a=1").status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/00000000-0000-4000-8000-000000000001/frame").status, 404);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/me/frame").status, 400);
}

TEST_F(DeskApiTest, ACommentStandsInTheTrailOfItsHazard) {
  const std::string id = Add();
  const std::string other = Add(0.01);
  Decide(id, "comment", R"({"text": "<script>alert(1)</script>"})");
  Decide(other, "comment", R"({"text": "another"})");
  const auto trail = Get(port(), "/api/v1/decisions?hazard=" + id).Json()["decisions"];
  ASSERT_EQ(trail.size(), 1U);
  EXPECT_EQ(trail[0]["decision"], "comment");
  EXPECT_EQ(trail[0]["about"], "hazard");
  EXPECT_EQ(trail[0]["reason"], "<script>alert(1)</script>");
  EXPECT_EQ(trail[0]["official"], TokenFile::official());
  EXPECT_EQ(Get(port(), "/api/v1/decisions?hazard=me").status, 400);
  EXPECT_EQ(Get(port(), "/api/v1/decisions?before=5&hazard=" + id).status, 400);
}

TEST_F(DeskApiTest, AnAssignmentIsOverdueOnceItsDayIsOver) {
  const std::string id = Add();
  Decide(id, "assign", R"({"team": "Roads north", "due": "2026-01-01"})");
  auto assigned = Get(port(), "/api/v1/assignments").Json()["assignments"];
  ASSERT_EQ(assigned.size(), 1U);
  EXPECT_EQ(assigned[0]["hazard"], id);
  EXPECT_EQ(assigned[0]["team"], "Roads north");
  EXPECT_EQ(assigned[0]["due"], "2026-01-01");
  EXPECT_EQ(assigned[0]["overdue"], false);
  fixture_.now_ns += 86'400'000'000'000;
  EXPECT_EQ(Get(port(), "/api/v1/assignments").Json()["assignments"][0]["overdue"], true);
  const std::uint64_t taken_off = Decide(id, "assign", R"({"team": null})");
  EXPECT_TRUE(Get(port(), "/api/v1/assignments").Json()["assignments"].empty());
  EXPECT_EQ(Undo(id, taken_off).status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/assignments").Json()["assignments"].size(), 1U);
}

TEST_F(DeskApiTest, WhatDoesNotFitIsToldAndNothingIsDone) {
  const std::string id = Add();
  EXPECT_EQ(Post(id, "class", R"({"class": "unicorn"})").status, 400);
  const HttpResult far = Post(id, "move", R"({"position": [-79.9, 40.5]})");
  EXPECT_EQ(far.status, 409);
  EXPECT_THAT(far.Json()["error"].get<std::string>(), HasSubstr("at most 200 m"));
  EXPECT_EQ(Post(id, "merge", R"({"other": ")" + id + R"("})").status, 409);
  EXPECT_EQ(Post("00000000-0000-4000-8000-000000000001", "comment", R"({"text": "a"})").status,
            404);
  EXPECT_TRUE(Get(port(), "/api/v1/decisions").Json()["decisions"].empty());
}

TEST_F(DeskApiTest, AHazardIsMovedMergedAndSplitAgain) {
  const std::string id = Add();
  const std::string other = Add(0.0003);
  Decide(id, "move", R"({"position": [-79.9436, 40.4434]})");
  const std::uint64_t merge = Decide(id, "merge", R"({"other": ")" + other + R"("})");
  auto sightings = Get(port(), "/api/v1/hazards/" + id + "/sightings").Json()["sightings"];
  ASSERT_EQ(sightings.size(), 2U);
  EXPECT_EQ(sightings[0]["image"], nullptr);
  EXPECT_EQ(sightings[0]["why_no_image"], "no picture came with this report");
  EXPECT_EQ(Get(port(), "/api/v1/hazards").Json()["features"].size(), 1U);
  EXPECT_EQ(Undo(id, merge).status, 200);
  EXPECT_EQ(Get(port(), "/api/v1/hazards").Json()["features"].size(), 2U);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + id).Json()["geometry"]["coordinates"][1], 40.4434);
}

TEST_F(DeskApiTest, StatisticsCountPerClassWithNullAndWhyWhereNothingWasMeasured) {
  const std::string first = Add();
  const std::string second = Add(0.001);
  const std::string third = Add(0.002);
  Decide(first, "confirm", "{}");
  EXPECT_EQ(Post(second, "reject", R"({"reason": "a shadow"})").status, 200);
  fixture_.now_ns += 3'600'000'000'000;
  Decide(third, "close", "{}");
  Add(0.003, "deer");
  const auto told = Get(port(), "/api/v1/statistics?weeks=4").Json();
  ASSERT_EQ(told["classes"].size(), 2U);
  const auto& deer = told["classes"][0];
  EXPECT_EQ(deer["precision"], nullptr);
  EXPECT_EQ(deer["why_no_precision"], "no official has judged one in this time");
  const auto& potholes = told["classes"][1];
  EXPECT_EQ(potholes["opened"], 3);
  EXPECT_EQ(potholes["confirmed"], 1);
  EXPECT_EQ(potholes["rejected"], 1);
  EXPECT_EQ(potholes["repaired"], 1);
  EXPECT_EQ(potholes["precision"], 0.5);
  EXPECT_NEAR(potholes["median_repair_s"].get<double>(), 3600, 60);
  EXPECT_EQ(told["streets"][0]["street"], nullptr);
  EXPECT_EQ(told["weeks"][0]["week"], "2025-12-29");
  EXPECT_EQ(Get(port(), "/api/v1/statistics?weeks=0").status, 400);
}

}  // namespace
}  // namespace livemap::web
