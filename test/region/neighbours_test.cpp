#include "region/neighbours.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "test/directory/test_authority.h"
#include "test/web/http/http_client.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::region {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// The border is at 40.45 degrees north. A ten-thousandth of a degree is 11 m.
constexpr double kBorderDeg = 40.45;
constexpr double kLongitudeDeg = -79.95;

geo::GeoPoint NorthOfBorder(double metres) {
  return {kBorderDeg + metres / 111'000, kLongitudeDeg};
}
geo::GeoPoint SouthOfBorder(double metres) { return NorthOfBorder(-metres); }

/// Bounds a hang.
bool ComesTrue(const std::function<bool()>& is_done) {
  for (int i = 0; i < 3000 && !is_done(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return is_done();
}

std::string ZoneText(const std::string& id, double from_deg, double to_deg,
                     const std::string& map) {
  const std::string from = std::to_string(from_deg);
  const std::string to = std::to_string(to_deg);
  return R"({"type": "Feature", "id": ")" + id + R"(", "geometry": {"type": "Polygon",
    "coordinates": [[[-80, )" +
         from + "], [-79.9, " + from + "], [-79.9, " + to + "], [-80, " + to + "], [-80, " + from +
         R"(]]]}, "properties": {"name": "The )" + id + R"(", )" +
         (map.empty() ? "" : R"("map": ")" + map + R"(", )") +
         R"("brokers": [{"host": "127.0.0.1", "port": 1883}]}})";
}

/// Two real zones with their servers, on both sides of a border; the northern one follows the
/// other.
class NeighboursTest : public testing::Test {
 protected:
  NeighboursTest() {
    std::ofstream(folder_.path() + "/ca.pem") << authority_.Pem();
    south_server_ =
        std::make_unique<web::WebServer>(south_options_, *south_.zone, south_.catalogue);
    south_options_.port = south_server_->port();
  }

  std::string SouthUrl() const { return "http://127.0.0.1:" + std::to_string(south_options_.port); }
  /// A zone far away is in it, too. A file of a later version is a later one.
  void PutDirectory(std::uint64_t version, const std::string& map) {
    const std::string path = folder_.path() + "/zones.cms";
    std::ofstream(path, std::ios::binary | std::ios::trunc) << authority_.Sign(
        R"({"type": "FeatureCollection", "livemap_zone_directory": 1, "authority": "town",
            "version": )" +
        std::to_string(version) +
        R"(, "issued": "2026-02-01T00:00:00Z", "expires": "2026-05-01T00:00:00Z", "features": [)" +
        ZoneText("north", kBorderDeg, 40.55, "http://127.0.0.1:1") + "," +
        ZoneText("south", 40.35, kBorderDeg, map) + "," +
        ZoneText("far", 30, 30.1, "http://127.0.0.1:2") + "]}");
    std::filesystem::last_write_time(path, std::filesystem::last_write_time(path) +
                                               std::chrono::seconds(static_cast<int>(version)));
  }
  void Follow(double margin_m = 500) {
    Neighbours::Config config;
    config.margin_m = margin_m;
    config.zone = "north";
    config.directory = folder_.path() + "/zones.cms";
    config.authority = folder_.path() + "/ca.pem";
    config.store = folder_.path() + "/neighbours";
    config.ask_every_s = 0.1;
    neighbours_ = std::make_unique<Neighbours>(
        config, *north_.zone, north_.catalogue, [] { return directory::kMarchNs; },
        [this](const std::string& line) {
          const MutexLock lock(mutex_);
          log_ += line + '\n';
        });
  }
  std::string log() {
    const MutexLock lock(mutex_);
    return log_;
  }
  static Uuid Add(web::ZoneFixture& zone, const geo::GeoPoint& position,
                  const std::string& class_name = "pothole") {
    const auto receipt = zone.zone->Handle(zone.MakeReport(class_name, position));
    EXPECT_TRUE(zone.zone->Confirm(receipt.hazard_uuid, "miller"));
    return receipt.hazard_uuid;
  }
  bool ComeToBe(std::size_t count) {
    return ComesTrue([this, count] { return neighbours_->Hazards().size() == count; });
  }

  const directory::TestAuthority authority_;
  web::TemporaryFolder folder_;
  web::ZoneFixture north_;
  web::ZoneFixture south_;
  web::WebConfig south_options_ = web::TestOptions();
  std::unique_ptr<web::WebServer> south_server_;
  Mutex mutex_;
  std::string log_;
  std::unique_ptr<Neighbours> neighbours_;
};

TEST_F(NeighboursTest, WhatLiesRightBehindTheBorderIsKnownUntilItIsGone) {
  PutDirectory(1, SouthUrl());
  const Uuid near = Add(south_, SouthOfBorder(200));
  Add(south_, SouthOfBorder(2000));
  Follow();
  EXPECT_THAT(neighbours_->zones(), ElementsAre("south"));
  ASSERT_TRUE(ComeToBe(1));
  const web::NeighbourHazard hazard = neighbours_->Hazards()[0];
  EXPECT_EQ(hazard.hazard.uuid, near) << "by its own zone's id";
  EXPECT_EQ(hazard.zone, "south");
  EXPECT_EQ(hazard.zone_name, "The south");
  EXPECT_EQ(hazard.map_url, SouthUrl());

  ASSERT_TRUE(south_.zone->Close(near, "miller"));
  EXPECT_TRUE(ComeToBe(0));
}

TEST_F(NeighboursTest, OneThatBothHoldIsOwnAndOneOfAnotherClassIsNot) {
  PutDirectory(1, SouthUrl());
  Add(north_, NorthOfBorder(1));
  const Uuid other = Add(south_, SouthOfBorder(1), "debris");
  Add(south_, SouthOfBorder(1));
  Follow();
  ASSERT_TRUE(ComeToBe(1));
  EXPECT_EQ(neighbours_->Hazards()[0].hazard.uuid, other);
}

TEST_F(NeighboursTest, AnOwnOneOnAnySideOfTheOthersIsTheSame) {
  PutDirectory(1, SouthUrl());
  // The distances of two potholes, 20 m apart, from an own one each: 3 m west and 3 m east.
  const auto on_border = [](double east_m) {
    return geo::GeoPoint{kBorderDeg, kLongitudeDeg + east_m / 84'500};
  };
  Add(south_, on_border(0));
  Add(south_, on_border(20));
  const Uuid alone = Add(south_, SouthOfBorder(100));
  Add(north_, on_border(-3));
  Add(north_, on_border(23));
  Follow();
  ASSERT_TRUE(ComeToBe(1));
  EXPECT_EQ(neighbours_->Hazards()[0].hazard.uuid, alone);
}

TEST_F(NeighboursTest, AfterTheOwnOneIsGoneTheOthersIsShown) {
  PutDirectory(1, SouthUrl());
  const Uuid own = Add(north_, NorthOfBorder(1));
  Add(south_, SouthOfBorder(1));
  const Uuid beside = Add(south_, SouthOfBorder(100));
  Follow();
  ASSERT_TRUE(ComeToBe(1));
  EXPECT_EQ(neighbours_->Hazards()[0].hazard.uuid, beside);
  ASSERT_TRUE(north_.zone->Close(own, "miller"));
  EXPECT_TRUE(ComeToBe(2));
}

TEST_F(NeighboursTest, OneThatMovesAwayFromTheBorderLeaves) {
  PutDirectory(1, SouthUrl());
  const Uuid hazard = Add(south_, SouthOfBorder(400));
  Follow();
  ASSERT_TRUE(ComeToBe(1));
  zone::DeskAction away;
  away.kind = zone::DecisionKind::kMoveHazard;
  away.position = SouthOfBorder(580);
  ASSERT_TRUE(south_.zone->Act(hazard, "miller", away));
  EXPECT_TRUE(ComeToBe(0));
}

TEST_F(NeighboursTest, AZoneThatIsDownKeepsItsLastStateAlsoAfterARestart) {
  PutDirectory(1, SouthUrl());
  Add(south_, SouthOfBorder(200));
  Follow();
  ASSERT_TRUE(ComeToBe(1));
  south_server_.reset();
  neighbours_.reset();
  Follow();
  EXPECT_THAT(neighbours_->Hazards(), SizeIs(1));
}

TEST_F(NeighboursTest, ADirectoryThatComesLaterAndNewerOnesCount) {
  Add(south_, SouthOfBorder(200));
  Follow();
  EXPECT_THAT(log(), HasSubstr("nobody is followed until there is"));
  EXPECT_THAT(neighbours_->zones(), IsEmpty());
  PutDirectory(1, "");
  neighbours_->Renew();
  EXPECT_THAT(neighbours_->zones(), IsEmpty());
  EXPECT_THAT(log(),
              HasSubstr("zone 'south' is not followed: the zone directory has no 'map' of it"));
  PutDirectory(2, SouthUrl());
  neighbours_->Renew();
  EXPECT_TRUE(ComeToBe(1));
  PutDirectory(3, "");
  neighbours_->Renew();
  EXPECT_TRUE(ComeToBe(0));
}

TEST_F(NeighboursTest, WhatLaySomewhatFurtherIsThereWhenTheMarginGrows) {
  PutDirectory(1, SouthUrl());
  Add(south_, SouthOfBorder(200));
  Add(south_, SouthOfBorder(900));
  Follow();
  ASSERT_TRUE(ComeToBe(1));
  neighbours_.reset();
  Follow(1000);
  EXPECT_TRUE(ComeToBe(2));
}

TEST_F(NeighboursTest, AZoneServesThemToWhoMaySeeHazards) {
  PutDirectory(1, SouthUrl());
  Add(south_, SouthOfBorder(200));
  Follow();
  ASSERT_TRUE(ComeToBe(1));
  const web::WebServer server(web::TestOptions(), *north_.zone, north_.catalogue, nullptr,
                              neighbours_.get());
  EXPECT_EQ(web::Get(server.port(), "/api/v1/config").Json()["neighbours"], true);
  const web::Json answer = web::Get(server.port(), "/api/v1/neighbours").Json();
  ASSERT_THAT(answer["features"], SizeIs(1));
  const web::Json& properties = answer["features"][0]["properties"];
  EXPECT_EQ(properties["zone"], "south");
  EXPECT_EQ(properties["zone_name"], "The south");
  EXPECT_EQ(properties["map"], SouthUrl() + "/");
  EXPECT_EQ(properties["image"], nullptr) << "pictures stay in the other zone";
  EXPECT_EQ(web::Get(server.port(), "/api/v1/hazards").Json()["features"].size(), 0U)
      << "the zone's own list and feeds do not have them";
  EXPECT_EQ(web::Get(south_server_->port(), "/api/v1/neighbours").status, 404);
}

TEST(NeighboursConfigTest, AMarginThatIsNoneIsRefused) {
  const web::ZoneFixture zone;
  Neighbours::Config config;
  config.margin_m = std::nan("");
  EXPECT_THROW(Neighbours(config, *zone.zone, zone.catalogue, SystemNs, [](const auto&) {}), Error);
}

}  // namespace
}  // namespace livemap::region
