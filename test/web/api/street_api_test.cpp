#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "streets/street_map.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::web {
namespace {

constexpr char kScript[] = "<img src=x onerror=\"document.title='owned'\">";

/// Forbes Ave eastwards, crossed by S Craig St at -79.95 and by a street whose name is a script at
/// -79.93.
std::shared_ptr<const streets::StreetMap> ApiTown() {
  streets::StreetMapBuilder builder;
  streets::Street street;
  street.id = 1;
  street.kind = streets::StreetKind::kPrimary;
  builder.AddStreet(street, "Forbes Ave", {1, 2, 3, 4});
  street.id = 2;
  street.kind = streets::StreetKind::kResidential;
  builder.AddStreet(street, "S Craig St", {5, 2, 6});
  street.id = 3;
  builder.AddStreet(street, kScript, {7, 3, 8});
  const auto put = [&](int node, double latitude, double longitude) {
    builder.SetPlace(node, {latitude, longitude});
  };
  put(1, 40.44, -79.96);
  put(2, 40.44, -79.95);
  put(3, 40.44, -79.93);
  put(4, 40.44, -79.92);
  put(5, 40.43, -79.95);
  put(6, 40.45, -79.95);
  put(7, 40.43, -79.93);
  put(8, 40.45, -79.93);
  return std::make_shared<const streets::StreetMap>(builder.Build());
}

class StreetApiTest : public testing::Test {
 protected:
  HttpResult Ask(const std::string& parameters) {
    return Get(server_.port(), "/api/v1/streets?" + parameters);
  }

  ZoneFixture fixture_{ApiTown()};
  WebServer server_{TestOptions(), *fixture_.zone, fixture_.catalogue};
};

TEST_F(StreetApiTest, AnswersTheStreetsOfABoxAsGeoJsonLines) {
  const HttpResult answer = Ask("bbox=-79.955,40.435,-79.945,40.445&zoom=14");
  EXPECT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.Field("Content-Type"), "application/geo+json");
  const nlohmann::json collection = answer.Json();
  EXPECT_EQ(collection["truncated"], false);
  ASSERT_EQ(collection["features"].size(), 2U);
  const nlohmann::json& forbes = collection["features"][0];
  EXPECT_EQ(forbes["properties"]["name"], "Forbes Ave");
  EXPECT_EQ(forbes["properties"]["class"], "primary");
  EXPECT_EQ(forbes["properties"]["one_way"], false);
  EXPECT_EQ(forbes["geometry"]["type"], "LineString");
  EXPECT_EQ(forbes["geometry"]["coordinates"][0], nlohmann::json::array({-79.96, 40.44}));
  EXPECT_EQ(Ask("bbox=-79.955,40.435,-79.945,40.445&zoom=9").Json()["features"].size(), 1U);
}

TEST_F(StreetApiTest, ANameThatIsAScriptStaysAText) {
  const HttpResult answer = Ask("bbox=-79.935,40.435,-79.925,40.445&zoom=14");
  EXPECT_EQ(answer.Json()["features"][1]["properties"]["name"], kScript);
}

TEST_F(StreetApiTest, AClientThatHasTheStreetsIsToldSo) {
  const std::string address = "/api/v1/streets?bbox=-79.955,40.435,-79.945,40.445&zoom=14";
  const HttpResult first = Get(server_.port(), address);
  const HttpResult again = Get(server_.port(), address, {{"If-None-Match", first.Field("ETag")}});
  EXPECT_EQ(again.status, 304);
  EXPECT_TRUE(again.body.empty());
}

TEST_F(StreetApiTest, RefusesWhatIsNoQueryOrTooMuch) {
  for (const char* parameters :
       {"", "bbox=-80,40,-79.9,40.1", "zoom=14", "bbox=-80,40,-79,41&zoom=23",
        "bbox=-80,40,-79,41&zoom=-1", "bbox=-80,40,-79,41&zoom=x", "bbox=-80,40,-79,41&zoom=16",
        "bbox=179,40,-179,41&zoom=8", "bbox=1,2,3&zoom=8", "bbox=-80,40,-79,41&zoom=8&limit=3",
        "bbox=-80,40,-79,41&zoom=8&zoom=8"}) {
    EXPECT_EQ(Ask(parameters).status, 400) << parameters;
  }
  EXPECT_EQ(Ask("bbox=-180,-90,180,90&zoom=2").status, 200);
}

TEST_F(StreetApiTest, HazardsHaveTheWordsOfTheirStreet) {
  zone::VehicleState vehicle;
  vehicle.vehicle_id = "car-1";
  vehicle.position = {40.44, -79.949};
  vehicle.course_rad = M_PI / 2;
  vehicle.speed_mps = 12;
  vehicle.stamp_ns = fixture_.now_ns;
  ASSERT_TRUE(fixture_.zone->UpdateVehicle(vehicle));
  const auto id =
      fixture_.zone->Handle(fixture_.MakeReport("pothole", {40.44, -79.949})).hazard_uuid;
  const nlohmann::json words =
      Get(server_.port(), "/api/v1/hazards/" + id.ToString()).Json()["properties"];
  EXPECT_EQ(words["street"], "Forbes Ave");
  EXPECT_EQ(words["near"], "S Craig St");
  EXPECT_EQ(words["direction"], "eastbound");
  EXPECT_EQ(words["street_note"], nullptr);

  const std::string points = Get(server_.port(), "/api/v1/hazards/points").body;
  const std::size_t end = points.find('\n');
  const auto columns = nlohmann::json::parse(points.substr(0, end))["columns"];
  const auto line = nlohmann::json::parse(points.substr(end + 1));
  ASSERT_EQ(line.size(), columns.size());
  EXPECT_EQ(columns.back(), "direction");
  EXPECT_EQ(line.back(), "eastbound");
  EXPECT_EQ(line[columns.size() - 3], "Forbes Ave");
}

TEST_F(StreetApiTest, AnEmptyMapLooksAtTheStreets) {
  const nlohmann::json config = Get(server_.port(), "/api/v1/config").Json();
  EXPECT_EQ(config["streets"], true);
  EXPECT_EQ(config["view"]["west"], -79.96);
  EXPECT_EQ(config["view"]["north"], 40.45);
}

TEST(StreetApiWithoutFileTest, SaysThatThereIsNone) {
  ZoneFixture fixture;
  WebServer server(TestOptions(), *fixture.zone, fixture.catalogue);
  EXPECT_EQ(Get(server.port(), "/api/v1/streets?bbox=-80,40,-79,41&zoom=8").status, 404);
  EXPECT_EQ(Get(server.port(), "/api/v1/config").Json()["streets"], false);
  fixture.AddRow("pothole", {40.44, -79.95}, 1);
  const auto words = Get(server.port(), "/api/v1/hazards").Json()["features"][0]["properties"];
  EXPECT_EQ(words["street"], nullptr);
  EXPECT_EQ(words["street_note"], "the zone has no street file");
}

}  // namespace
}  // namespace livemap::web
