#include "web/feeds/formats/work_zones.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

namespace livemap::web {
namespace {

class WorkZonesTest : public testing::Test {
 protected:
  /// `east_m` and `north_m` of a place in Pittsburgh.
  void Put(const std::string& class_name, double east_m, double north_m,
           const std::string& street = "", const std::string& direction = "") {
    zone::Hazard hazard;
    hazard.uuid = Uuid::Random(generator_);
    hazard.class_name = class_name;
    hazard.position = frame_.ToGeo({east_m, north_m});
    hazard.course_rad = course_rad_;
    streets::StreetWords words;
    words.street = street;
    words.direction = direction;
    zones_.Add(MakeFeedHazard(hazard, {}, words, 0));
  }
  std::vector<std::size_t> Sizes() {
    zones_.Close();
    std::vector<std::size_t> sizes;
    for (auto zone = zones_.Next(); !zone.empty(); zone = zones_.Next()) {
      sizes.push_back(zone.size());
    }
    return sizes;
  }

  geo::LocalFrame frame_{{40.4433, -79.9436}};
  double course_rad_ = std::numeric_limits<double>::quiet_NaN();
  WorkZones zones_;

 private:
  std::mt19937_64 generator_{5};
};

TEST_F(WorkZonesTest, JoinsDevicesThatStandTogether) {
  Put("traffic_cone", 0, 0);
  Put("road_work_sign", 500, 0);
  Put("traffic_cone", 100, 0);
  Put("barrier", 50, 0);  // Joins the first and the third.
  EXPECT_THAT(Sizes(), testing::ElementsAre(3, 1));
}

TEST_F(WorkZonesTest, ALoneConeIsNoWorkZone) {
  Put("traffic_cone", 0, 0);
  Put("barrier", 1000, 0);
  Put("pothole", 1010, 0);
  EXPECT_THAT(Sizes(), testing::ElementsAre(1));
}

TEST_F(WorkZonesTest, KeepsCarriagewaysApart) {
  Put("barrier", 0, 0, "Parkway", "eastbound");
  Put("barrier", 0, 14, "Parkway", "westbound");
  Put("barrier", 20, 0, "Parkway", "eastbound");
  Put("barrier", 20, 30, "Forbes Ave", "");
  EXPECT_THAT(Sizes(), testing::ElementsAre(2, 1, 1));
}

TEST_F(WorkZonesTest, LiesInTheOrderInWhichItIsPassed) {
  course_rad_ = 1.5 * M_PI;  // Westwards.
  Put("barrier", 0, 0);
  Put("barrier", 40, 3);
  Put("barrier", 20, -3);
  zones_.Close();
  const auto zone = zones_.Next();
  ASSERT_EQ(zone.size(), 3U);
  EXPECT_GT(zone[0].position.longitude_deg, zone[1].position.longitude_deg);
  EXPECT_GT(zone[1].position.longitude_deg, zone[2].position.longitude_deg);
}

TEST_F(WorkZonesTest, ThereMayBeNone) { EXPECT_THAT(Sizes(), testing::IsEmpty()); }

}  // namespace
}  // namespace livemap::web
