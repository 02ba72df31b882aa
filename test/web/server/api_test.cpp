#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "common/sha256.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/json/json.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

const geo::GeoPoint kPittsburgh{40.4433, -79.9436};

class ApiTest : public testing::Test {
 protected:
  nlohmann::json Hazards(const std::string& parameters = "") {
    const HttpResult answer = Get(port(), "/api/v1/hazards?" + parameters);
    EXPECT_EQ(answer.status, 200) << answer.body;
    return answer.Json();
  }
  int port() const { return server_.port(); }

  ZoneFixture fixture_;
  WebServer server_{TestOptions(), *fixture_.zone, fixture_.catalogue};
};

TEST_F(ApiTest, AnswersAHazardAsGeoJsonFeature) {
  protocol::Report report = fixture_.MakeReport("pothole", kPittsburgh);
  report.stamp_ns += 250'000'000;
  report.image_format = "png";
  report.image = OnePixelPng();
  const protocol::Receipt receipt = fixture_.zone->Handle(report);
  ASSERT_EQ(receipt.status, protocol::Receipt::Status::kCommitted) << receipt.reason;

  const HttpResult answer = Get(port(), "/api/v1/hazards");
  EXPECT_EQ(answer.Field("Content-Type"), "application/geo+json");
  const nlohmann::json collection = answer.Json();
  EXPECT_EQ(collection["type"], "FeatureCollection");
  EXPECT_EQ(collection["sequence"], fixture_.zone->Sequence());
  EXPECT_EQ(collection["truncated"], false);
  ASSERT_EQ(collection["features"].size(), 1U);

  const nlohmann::json& feature = collection["features"][0];
  EXPECT_EQ(feature["geometry"]["type"], "Point");
  EXPECT_EQ(feature["geometry"]["coordinates"], nlohmann::json::array({-79.9436, 40.4433}));
  const nlohmann::json& properties = feature["properties"];
  EXPECT_EQ(properties["id"], receipt.hazard_uuid.ToString());
  EXPECT_EQ(properties["class"], "pothole");
  EXPECT_EQ(properties["label"], "Pothole");
  EXPECT_EQ(properties["confidence"], 0.87);
  EXPECT_EQ(properties["sightings"], 1);
  EXPECT_EQ(properties["state"], "candidate");
  EXPECT_EQ(properties["vehicles"], 1);
  EXPECT_GT(properties["presence"], 0.1);
  EXPECT_LE(properties["presence"], 1.0);
  EXPECT_EQ(properties["first_seen"], "2026-01-01T00:00:00.250Z");
  EXPECT_EQ(properties["last_seen"], "2026-01-01T00:00:00.250Z");
  EXPECT_EQ(properties["position_sigma_m"], 2.0);
  EXPECT_EQ(properties["image"], "/images/" + Sha256Hex(report.image.data(), report.image.size()));
  EXPECT_FALSE(properties.contains("action"));
}

TEST_F(ApiTest, FindsOneHazardById) {
  const protocol::Receipt receipt =
      fixture_.zone->Handle(fixture_.MakeReport("pothole", kPittsburgh));
  const std::string id = receipt.hazard_uuid.ToString();
  EXPECT_EQ(Get(port(), "/api/v1/hazards/" + id).Json()["properties"]["active"], true);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/00000000-0000-4000-8000-000000000000").status, 404);
  EXPECT_EQ(Get(port(), "/api/v1/hazards/1%27or%271").status, 400);
}

TEST_F(ApiTest, BoxSelectsByPositionAlsoAcrossTheAntimeridian) {
  fixture_.AddRow("pothole", kPittsburgh, 3);
  fixture_.AddRow("debris", {-16.5, 179.9}, 1);
  fixture_.AddRow("debris", {-16.5, -179.9}, 1);
  EXPECT_EQ(Hazards("bbox=-80,40,-79,41")["features"].size(), 3U);
  EXPECT_EQ(Hazards("bbox=-80,40,-79,40.44335")["features"].size(), 1U);
  EXPECT_EQ(Hazards("bbox=179,-17,-179,-16")["features"].size(), 2U);
  EXPECT_EQ(Hazards("bbox=-179,-17,179,-16")["features"].size(), 0U);
}

TEST_F(ApiTest, SinceAnswersOnlyWhatChangedWithItsAction) {
  fixture_.AddRow("pothole", kPittsburgh, 2);
  const std::uint64_t before = fixture_.zone->Sequence();
  const nlohmann::json all = Hazards();
  fixture_.zone->Handle(fixture_.MakeReport("pothole", kPittsburgh));
  const Uuid other = *Uuid::Parse(all["features"][1]["properties"]["id"]);
  fixture_.zone->Remove(other, "test");
  fixture_.zone->Handle(fixture_.MakeReport("deer", {40.5, -79.9}));

  const nlohmann::json changes = Hazards("since=" + std::to_string(before));
  ASSERT_EQ(changes["features"].size(), 3U);
  EXPECT_EQ(changes["features"][0]["properties"]["action"], "updated");
  EXPECT_EQ(changes["features"][0]["properties"]["sightings"], 2);
  EXPECT_EQ(changes["features"][1]["properties"]["action"], "removed");
  EXPECT_EQ(changes["features"][2]["properties"]["action"], "added");
  EXPECT_EQ(Hazards()["features"].size(), 2U);
}

TEST_F(ApiTest, StateSelectsAndTellsWhatLeavesTheSelection) {
  const std::string first =
      fixture_.zone->Handle(fixture_.MakeReport("pothole", kPittsburgh)).hazard_uuid.ToString();
  fixture_.zone->Handle(fixture_.MakeReport("deer", {40.5, -79.9}));
  EXPECT_EQ(Hazards("state=candidate")["features"].size(), 1U);
  EXPECT_EQ(Hazards("state=active,verifying")["features"].size(), 1U);
  EXPECT_EQ(Hazards("state=candidate,active,verifying")["features"].size(), 2U);

  const std::uint64_t before = fixture_.zone->Sequence();
  ASSERT_TRUE(fixture_.zone->Confirm(*Uuid::Parse(first), "miller"));
  const auto left = Hazards("state=candidate&since=" + std::to_string(before))["features"];
  ASSERT_EQ(left.size(), 1U);
  EXPECT_EQ(left[0]["properties"]["action"], "removed");
  EXPECT_EQ(left[0]["properties"]["state"], "active");
  const auto joined = Hazards("state=active&since=" + std::to_string(before))["features"];
  ASSERT_EQ(joined.size(), 1U);
  EXPECT_NE(joined[0]["properties"]["action"], "removed");
}

TEST_F(ApiTest, WhatIsOffTheMapIsListedWhereItsStateIsAskedFor) {
  fixture_.AddRow("pothole", kPittsburgh, 3);
  const nlohmann::json all = Hazards();
  const std::string rejected = all["features"][0]["id"];
  const std::string gone = all["features"][1]["id"];
  ASSERT_TRUE(fixture_.zone->Reject(*Uuid::Parse(rejected), "miller", "a shadow"));
  ASSERT_TRUE(fixture_.zone->Remove(*Uuid::Parse(gone), "test"));
  EXPECT_EQ(Hazards()["features"].size(), 1U);
  const nlohmann::json listed = Hazards("state=rejected");
  ASSERT_EQ(listed["features"].size(), 1U);
  EXPECT_EQ(listed["features"][0]["id"], rejected);
  EXPECT_EQ(listed["features"][0]["properties"]["state"], "rejected");
  EXPECT_EQ(Hazards("state=gone")["features"][0]["id"], gone);
  EXPECT_EQ(Hazards("state=gone,rejected&limit=1")["truncated"], true);
  EXPECT_EQ(Hazards("state=candidate,active,verifying,gone,rejected")["features"].size(), 3U);

  const std::string since = listed["sequence"].dump();
  ASSERT_TRUE(fixture_.zone->Confirm(*Uuid::Parse(rejected), "miller"));
  const auto left = Hazards("state=rejected&since=" + since)["features"];
  ASSERT_EQ(left.size(), 1U);
  EXPECT_EQ(left[0]["properties"]["action"], "removed");
}

TEST_F(ApiTest, LimitCutsAndTheSequenceLeadsToTheRest) {
  fixture_.AddRow("pothole", kPittsburgh, 25);
  nlohmann::json page = Hazards("limit=10");
  std::set<std::string> ids;
  int pages = 1;
  for (;; ++pages) {
    for (const auto& feature : page["features"]) ids.insert(feature["id"]);
    if (!page["truncated"]) break;
    page = Hazards("limit=10&since=" + page["sequence"].dump());
  }
  EXPECT_EQ(ids.size(), 25U);
  EXPECT_EQ(pages, 3);
}

TEST_F(ApiTest, TellsWhatIsWrongWithAParameter) {
  for (const char* parameters : {"bbox=1,2,3", "since=x", "limit=0", "colour=red",
                                 "state=", "state=lost", "state=active,active"}) {
    const HttpResult answer = Get(port(), std::string("/api/v1/hazards?") + parameters);
    EXPECT_EQ(answer.status, 400);
    EXPECT_THAT(answer.Json()["error"].get<std::string>(), testing::HasSubstr("accepted"));
  }
  EXPECT_EQ(Get(port(), "/api/v1/classes?x=1").status, 400);
}

TEST_F(ApiTest, TextThatIsNoUtf8NeverBreaksAnAnswer) {
  const HttpResult answer = Get(port(), "/api/v1/hazards?bbox=%ff%fe");
  EXPECT_EQ(answer.status, 400);
  EXPECT_TRUE(answer.Json().contains("error"));
}

TEST_F(ApiTest, AnswersClassesVehiclesConfigAndHealth) {
  zone::VehicleState vehicle;
  vehicle.vehicle_id = "car-1";
  vehicle.position = kPittsburgh;
  vehicle.course_rad = std::nan("");
  vehicle.stamp_ns = ZoneFixture::kStartNs;
  ASSERT_TRUE(fixture_.zone->UpdateVehicle(vehicle));
  vehicle.position.latitude_deg += 0.001;
  vehicle.course_rad = 1.5;
  vehicle.stamp_ns += 1'000'000'000;
  fixture_.now_ns += 1'000'000'000;
  ASSERT_TRUE(fixture_.zone->UpdateVehicle(vehicle));

  const nlohmann::json vehicles = Get(port(), "/api/v1/vehicles").Json();
  ASSERT_EQ(vehicles["features"].size(), 1U);
  EXPECT_EQ(vehicles["features"][0]["properties"]["course_rad"], 1.5);
  EXPECT_EQ(vehicles["features"][0]["properties"]["trail"].size(), 2U);
  EXPECT_EQ(Get(port(), "/api/v1/classes").Json()["classes"].size(),
            fixture_.catalogue.classes().size());
  EXPECT_EQ(Get(port(), "/api/v1/config").Json()["tile_url"], nullptr);
  EXPECT_EQ(Get(port(), "/healthz").Json()["status"], "ok");
}

TEST_F(ApiTest, TheConfigurationSaysWhereThePageOpens) {
  EXPECT_EQ(Get(port(), "/api/v1/config").Json()["view"], nullptr);
  fixture_.zone->Handle(fixture_.MakeReport("pothole", {-17.8, 179.9999}));
  const auto view = Get(port(), "/api/v1/config").Json()["view"];
  EXPECT_GT(view["west"].get<double>(), view["east"].get<double>());
  EXPECT_LT(view["south"].get<double>(), -17.8);
  EXPECT_GT(view["north"].get<double>(), -17.8);
}

TEST_F(ApiTest, ServesAPictureForEverAndHarmlessly) {
  protocol::Report report = fixture_.MakeReport("pothole", kPittsburgh);
  report.image_format = "png";
  report.image = OnePixelPng();
  fixture_.zone->Handle(report);
  const std::string url = Hazards()["features"][0]["properties"]["image"];
  const HttpResult picture = Get(port(), url);
  EXPECT_EQ(picture.status, 200);
  EXPECT_EQ(picture.Field("Content-Type"), "image/jpeg");
  EXPECT_THAT(picture.Field("Cache-Control"), testing::HasSubstr("immutable"));
  EXPECT_THAT(picture.Field("Content-Security-Policy"), testing::HasSubstr("sandbox"));
  const HttpResult again = Get(port(), url, {{"If-None-Match", picture.Field("ETag")}});
  EXPECT_EQ(again.status, 304);
  EXPECT_EQ(again.body, "");
  for (const std::string other :
       {"/images/", "/images/abc", "/images/../zone.sqlite3", "/images/%2e%2e%2fzone.sqlite3"}) {
    EXPECT_EQ(Get(port(), other).status, 404) << other;
  }
  EXPECT_EQ(Get(port(), "/images/" + std::string(64, 'a')).status, 404);
}

TEST_F(ApiTest, NoByteOfAVehiclesFileIsServed) {
  cv::Mat scene(48, 64, CV_8UC3, cv::Scalar(90, 120, 150));
  protocol::Report report = fixture_.MakeReport("pothole", kPittsburgh);
  report.image_format = "png";  // It is none: nobody believes the name.
  cv::imencode(".jpg", scene, report.image);
  const std::string markup = "<script>alert(1)</script>";
  report.image.insert(report.image.end(), markup.begin(), markup.end());
  ASSERT_EQ(fixture_.zone->Handle(report).status, protocol::Receipt::Status::kCommitted);
  const HttpResult picture = Get(port(), Hazards()["features"][0]["properties"]["image"]);
  ASSERT_EQ(picture.status, 200);
  EXPECT_EQ(picture.body.substr(0, 3), "\xff\xd8\xff");
  EXPECT_EQ(picture.body.find("script"), std::string::npos);
  const std::vector<std::uint8_t> bytes(picture.body.begin(), picture.body.end());
  EXPECT_EQ(cv::imdecode(bytes, cv::IMREAD_COLOR).size(), scene.size());
}

TEST_F(ApiTest, APictureThatCannotBeDecodedIsNotServed) {
  protocol::Report report = fixture_.MakeReport("pothole", kPittsburgh);
  report.image_format = "png";
  report.image = OnePixelPng();
  report.image.resize(report.image.size() - 20);
  ASSERT_EQ(fixture_.zone->Handle(report).status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(Get(port(), Hazards()["features"][0]["properties"]["image"]).status, 404);
}

TEST_F(ApiTest, ServesThePageWithHeadersThatForbidForeignScript) {
  const HttpResult page = Get(port(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_THAT(page.body, testing::HasSubstr("<!doctype html>"));
  const std::string policy = page.Field("Content-Security-Policy");
  EXPECT_THAT(policy, testing::HasSubstr("default-src 'none'; script-src 'self';"));
  EXPECT_THAT(policy, testing::HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(policy, testing::Not(testing::HasSubstr("unsafe")));
  EXPECT_EQ(page.Field("X-Content-Type-Options"), "nosniff");
  EXPECT_EQ(Get(port(), "/map.js").Field("Content-Type"), "text/javascript; charset=utf-8");
  EXPECT_EQ(Get(port(), "/vendor/leaflet/leaflet.min.js").status, 200);
  EXPECT_EQ(Get(port(), "/worker/zone_worker.js").Field("Content-Type"),
            "text/javascript; charset=utf-8");
  EXPECT_EQ(Get(port(), "/", {{"If-None-Match", page.Field("ETag")}}).status, 304);
}

TEST_F(ApiTest, ServesNothingOutsideItsFolders) {
  for (const char* target :
       {"/../package.xml", "/%2e%2e/package.xml", "/icons/../../package.xml", "/..%2fpackage.xml",
        "/vendor/leaflet/../jquery/jquery.js", "/vendor/jquery/jquery.js", "//etc/passwd",
        "/.git/config", "/icons/..%5c..%5cpackage.xml", "/vendor/leaflet/", "/absent"}) {
    EXPECT_EQ(Get(port(), target).status, 404) << target;
  }
}

TEST_F(ApiTest, AnswersHeadWithoutContent) {
  const HttpResult head = Request(port(), "HEAD", "/");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.body, "");
  EXPECT_EQ(head.Field("Content-Length"), std::to_string(Get(port(), "/").body.size()));
}

TEST_F(ApiTest, RefusesOtherMethodsBodiesAndOversizedHeaders) {
  const HttpResult post = Request(port(), "POST", "/api/v1/hazards", {}, "{}");
  EXPECT_EQ(post.status, 405);
  EXPECT_EQ(post.Field("Allow"), "GET, HEAD");
  EXPECT_EQ(Request(port(), "DELETE", "/").status, 405);
  EXPECT_EQ(Request(port(), "GET", "/", {}, "body").status, 413);
  EXPECT_EQ(Get(port(), "/", {{"X-Long", std::string(9000, 'a')}}).status, 431);
  EXPECT_EQ(Get(port(), "/ws").status, 426);
}

TEST_F(ApiTest, ConnectionsBeyondTheLimitAreAnswered503) {
  WebConfig options = TestOptions();
  options.max_connections = 1;
  const WebServer small(options, *fixture_.zone, fixture_.catalogue);
  const StreamClient holds_the_only_one(small.port());
  EXPECT_EQ(Get(small.port(), "/").status, 503);
}

TEST_F(ApiTest, SilentConnectionsAreClosed) {
  WebConfig options = TestOptions();
  options.request_timeout_s = 0.05;
  const WebServer hasty(options, *fixture_.zone, fixture_.catalogue);
  boost::asio::io_context io;
  boost::asio::ip::tcp::socket socket(io);
  socket.connect(
      {boost::asio::ip::make_address("127.0.0.1"), static_cast<unsigned short>(hasty.port())});
  char byte = 0;
  boost::system::error_code end;
  socket.read_some(boost::asio::buffer(&byte, 1), end);
  EXPECT_TRUE(end);
}

TEST_F(ApiTest, ATakenPortIsAClearError) {
  WebConfig options = TestOptions();
  options.port = port();
  try {
    const WebServer second(options, *fixture_.zone, fixture_.catalogue);
    FAIL() << "two servers listen on one port";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("port " + std::to_string(port())));
  }
}

}  // namespace
}  // namespace livemap::web
