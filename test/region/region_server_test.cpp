#include "region/region_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>

#include "region/region_site.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::region {
namespace {

using testing::HasSubstr;

/// Bounds a hang.
void WaitUntil(const std::function<bool()>& is_done) {
  for (int i = 0; i < 3000 && !is_done(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_TRUE(is_done());
}

/// Two real zones, and a region that follows them. The zones' clock stands: they are asked by it.
class RegionServerTest : public testing::Test {
 protected:
  RegionServerTest() {
    Region::Config config;
    config.directory = folder_.path();
    config.ask_every_s = 0.1;
    config.longest_pause_s = 0.2;
    const directory::ZoneArea area({{{40.4, -80}, {40.4, -79.9}, {40.5, -79.9}, {40.5, -80}}});
    config.zones = {{"north", "The North", Url(*north_server_), "", area},
                    {"south", "", Url(*south_server_), "", std::nullopt}};
    region_ = std::make_unique<Region>(
        config, north_.catalogue, [this] { return north_.now_ns.load(); },
        [this](const std::string& line) {
          const MutexLock lock(mutex_);
          lines_ += line + '\n';
        });
    server_ = std::make_unique<RegionServer>(web::TestOptions(), *region_, north_.catalogue);
    WaitUntil([this] { return region_->HasAskedAll(); });
  }

  static std::string Url(const web::WebServer& server) {
    return "http://127.0.0.1:" + std::to_string(server.port());
  }
  static Uuid Add(web::ZoneFixture& zone, const geo::GeoPoint& position) {
    const auto receipt = zone.zone->Handle(zone.MakeReport("pothole", position));
    zone.zone->Confirm(receipt.hazard_uuid, "miller");
    return receipt.hazard_uuid;
  }
  web::HttpResult Get(const std::string& target) const { return web::Get(server_->port(), target); }
  std::size_t Listed() const { return Get("/api/v1/hazards").Json()["features"].size(); }

  web::TemporaryFolder folder_;
  web::ZoneFixture north_;
  web::ZoneFixture south_;
  std::unique_ptr<web::WebServer> north_server_ =
      std::make_unique<web::WebServer>(web::TestOptions(), *north_.zone, north_.catalogue);
  std::unique_ptr<web::WebServer> south_server_ =
      std::make_unique<web::WebServer>(web::TestOptions(), *south_.zone, south_.catalogue);
  Mutex mutex_;
  std::string lines_;
  std::unique_ptr<Region> region_;
  std::unique_ptr<RegionServer> server_;
};

TEST_F(RegionServerTest, ServesTheHazardsOfAllZonesInListFeedsAndStream) {
  web::StreamClient client(server_->port());
  client.NextOfType("live");
  const Uuid first = Add(north_, {40.4433, -79.9436});
  const Uuid second = Add(south_, {40.30, -79.95});
  EXPECT_EQ(first, second);  // Both zones make their ids alike; the region tells them apart.
  std::set<std::string> told;
  told.insert(client.NextOfType("hazard")["feature"]["id"]);
  told.insert(client.NextOfType("hazard")["feature"]["id"]);
  EXPECT_EQ(told, (std::set<std::string>{RegionHazardId("north", first).ToString(),
                                         RegionHazardId("south", second).ToString()}));
  EXPECT_EQ(Listed(), 2U);
  EXPECT_EQ(Get("/ogc/collections/hazards/items").Json()["numberReturned"], 2);
  for (const char* feed :
       {"/feeds/hazards.csv", "/feeds/hazards.atom", "/feeds/cifs.json", "/feeds/denm.ndjson"}) {
    const auto answer = Get(feed);
    EXPECT_EQ(answer.status, 200) << feed;
    for (const std::string& id : told) EXPECT_THAT(answer.body, HasSubstr(id)) << feed;
  }
  // Waypoints have no id.
  const std::string waypoints = Get("/feeds/hazards.gpx").body;
  for (const char* latitude : {"40.4433000", "40.3000000"}) {
    EXPECT_THAT(waypoints, HasSubstr(latitude));
  }
  // Neither road works nor safety-related traffic information.
  for (const char* feed : {"/feeds/srti.xml", "/feeds/wzdx.geojson"}) {
    EXPECT_EQ(Get(feed).status, 200) << feed;
  }
  EXPECT_EQ(Get("/api/v1/hazards/" + *told.begin()).Json()["properties"]["class"], "pothole");
  EXPECT_THAT(Get("/api/v1/hazards/points").body, HasSubstr(*told.begin()));
}

TEST_F(RegionServerTest, SaysWhichZoneIsDownAndShowsItsLastState) {
  Add(north_, {40.4433, -79.9436});
  WaitUntil([this] { return Listed() == 1; });
  north_server_.reset();
  WaitUntil([this] { return !region_->status(0).is_up; });
  const auto zones = Get("/api/v1/zones").Json()["features"];
  ASSERT_EQ(zones.size(), 2U);
  EXPECT_EQ(zones[0]["geometry"]["type"], "MultiLineString");
  EXPECT_EQ(zones[0]["geometry"]["coordinates"][0].size(), 5U);
  EXPECT_EQ(zones[0]["properties"], (nlohmann::json{{"zone", "north"},
                                                    {"name", "The North"},
                                                    {"state", "down"},
                                                    {"last_heard", "2026-01-01T00:00:00Z"},
                                                    {"hazards", 1}}));
  EXPECT_TRUE(zones[1]["geometry"].is_null());
  EXPECT_EQ(zones[1]["properties"]["state"], "up");
  EXPECT_EQ(Listed(), 1U);
  const std::string metrics = Get("/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("livemap_region_zone_up{zone=\"north\"} 0\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_region_zone_up{zone=\"south\"} 1\n"));
  EXPECT_THAT(metrics, HasSubstr("livemap_region_zone_age_seconds{zone=\"north\"} 0\n"));
  EXPECT_EQ(Get("/readyz").status, 200);
  const MutexLock lock(mutex_);
  EXPECT_THAT(lines_, HasSubstr("zone 'north' is down and was last heard at 2026-01-01T00:00:00Z"));
}

TEST_F(RegionServerTest, CanOnlyBeRead) {
  Add(north_, {40.4433, -79.9436});
  WaitUntil([this] { return Listed() == 1; });
  const std::string id = Get("/api/v1/hazards").Json()["features"][0]["id"];
  for (const std::string& target :
       {"/api/v1/hazards/" + id + "/confirm", std::string("/api/v1/session"),
        std::string("/api/v1/accounts")}) {
    EXPECT_EQ(web::Request(server_->port(), "POST", target, {}, "{}").status, 405) << target;
  }
  EXPECT_EQ(Get("/api/v1/hazards/" + id + "/events").status, 401);
  for (const char* target : {"/api/v1/vehicles", "/api/v1/changes", "/api/v1/decisions",
                             "/api/v1/orders", "/api/v1/accounts", "/images/abc"}) {
    EXPECT_EQ(Get(target).status, 404) << target;
  }
  EXPECT_EQ(Get("/api/v1/zones?x=1").status, 400);
  const auto sees = Get("/api/v1/session").Json()["sees"];
  EXPECT_EQ(sees, (nlohmann::json{{"told", true}, {"candidates", false}, {"vehicles", false}}));
}

TEST_F(RegionServerTest, ServesThePageWhichLooksAtTheZonesAreas) {
  EXPECT_THAT(Get("/").body, HasSubstr("<title>LiveMap</title>"));
  const auto config = Get("/api/v1/config").Json();
  EXPECT_EQ(config["region"], true);
  EXPECT_EQ(config["officials"], false);
  EXPECT_EQ(config["view"]["south"], 40.4);
  EXPECT_EQ(config["view"]["east"], -79.9);
  EXPECT_EQ(Get("/healthz").status, 200);
  EXPECT_EQ(Get("/vendor/leaflet/leaflet.min.js").status, 200);
}

TEST(BoundsOf, GoAcross180Degrees) {
  RegionZone west{"w", "", "http://w", "",
                  directory::ZoneArea({{{-17, 178}, {-17, 179}, {-18, 178}}})};
  RegionZone east{"e", "", "http://e", "",
                  directory::ZoneArea({{{-19, -179}, {-17, -178}, {-18, -178}}})};
  const auto bounds = BoundsOf({west, east});
  ASSERT_TRUE(bounds);
  EXPECT_DOUBLE_EQ(bounds->south_west.longitude_deg, 178);
  EXPECT_DOUBLE_EQ(bounds->north_east.longitude_deg, -178);
  EXPECT_DOUBLE_EQ(bounds->south_west.latitude_deg, -19);
  EXPECT_FALSE(BoundsOf({{"n", "", "http://n", "", std::nullopt}}));
}

}  // namespace
}  // namespace livemap::region
