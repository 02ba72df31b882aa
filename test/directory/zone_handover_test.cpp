#include "directory/zone_handover.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "common/error.h"

namespace livemap::directory {
namespace {

using testing::ElementsAre;

/// A zone of 0.05 degrees each way, whose west side lies at `west`.
std::string HandoverZone(const std::string& id, double west) {
  const std::string left = std::to_string(west);
  const std::string right = std::to_string(west + 0.05);
  return R"({"type": "Feature", "id": ")" + id + R"(", "geometry": {"type": "Polygon",)" +
         R"("coordinates": [[[)" + left + ", 40.40], [" + right + ", 40.40], [" + right +
         ", 40.45], [" + left + ", 40.45], [" + left + R"(, 40.40]]]}, "properties": )" +
         R"({"brokers": [{"host": ")" + id + R"(.example.org"}]}})";
}

/// Centre, and east of it east, without a gap at -79.95; far in the west "away".
ZoneDirectory TwoZonesInARow() {
  return ZoneDirectory::Parse(
      R"({"type": "FeatureCollection", "livemap_zone_directory": 1, "authority": "town",)"
      R"("version": 1, "issued": "2026-02-01T00:00:00Z", "expires": "2026-05-01T00:00:00Z",)"
      R"("features": [)" +
          HandoverZone("centre", -80.00) + "," + HandoverZone("east", -79.95) + "," +
          HandoverZone("away", -81.00) + "]}",
      "zones");
}

/// So many metres east of the border of centre and east.
geo::GeoPoint EastOfBorder(double metres) {
  return geo::GeodesicDestination({40.42, -79.95}, 1.5707963267948966, metres);
}

class ZoneHandoverTest : public testing::Test {
 protected:
  const ZoneDirectory town_ = TwoZonesInARow();
  ZoneHandover handover_{ZoneHandover::Config{}, "centre"};
};

TEST_F(ZoneHandoverTest, TheConfiguredZoneIsThePresentOneUntilAPositionComes) {
  EXPECT_EQ(handover_.present(), "centre");
  EXPECT_THAT(handover_.Wanted(0), ElementsAre("centre"));
  EXPECT_TRUE(handover_.Move(town_, EastOfBorder(1000)));
  EXPECT_THAT(handover_.Wanted(0), ElementsAre("east"));
}

TEST_F(ZoneHandoverTest, TheNextZoneIsWantedBeforeTheBorderAndTheLastOneAfterIt) {
  handover_.Move(town_, EastOfBorder(-600));
  EXPECT_THAT(handover_.Wanted(0), ElementsAre("centre"));
  EXPECT_FALSE(handover_.Move(town_, EastOfBorder(-400)));
  EXPECT_THAT(handover_.Wanted(1), ElementsAre("centre", "east"));
  EXPECT_FALSE(handover_.Move(town_, EastOfBorder(20))) << "it is not deeper in yet by 50 m";
  EXPECT_TRUE(handover_.Move(town_, EastOfBorder(30)));
  EXPECT_THAT(handover_.Wanted(2), ElementsAre("east", "centre"));
  EXPECT_THAT(handover_.near(), ElementsAre("east", "centre")) << "both hear where it is";
  EXPECT_FALSE(handover_.Move(town_, EastOfBorder(600)));
  EXPECT_THAT(handover_.Wanted(3), ElementsAre("east"));
}

TEST_F(ZoneHandoverTest, AZoneLeftBehindStaysForAWhileAfterTheLastMessageToIt) {
  handover_.Move(town_, EastOfBorder(2000));
  handover_.NoteMessage("centre", 10);
  EXPECT_THAT(handover_.Wanted(70), ElementsAre("east", "centre"));
  EXPECT_THAT(handover_.near(), ElementsAre("east")) << "it does not hear where the vehicle is";
  EXPECT_THAT(handover_.Wanted(71), ElementsAre("east"));
  EXPECT_THAT(handover_.Wanted(11), ElementsAre("east")) << "forgotten";
}

TEST_F(ZoneHandoverTest, MessagesThatWaitKeepItLongerButNotForEver) {
  handover_.Move(town_, EastOfBorder(2000));
  handover_.NoteMessage("centre", 0);
  EXPECT_THAT(handover_.Wanted(600, {"centre"}), ElementsAre("east", "centre"));
  EXPECT_THAT(handover_.Wanted(601, {"centre"}), ElementsAre("east"));
}

TEST_F(ZoneHandoverTest, BeyondTheLimitThoseWithTheOldestMessagesAreLeft) {
  ZoneHandover::Config config;
  config.max_zones = 2;
  ZoneHandover handover(config, "centre");
  handover.Move(town_, EastOfBorder(2000));
  handover.NoteMessage("centre", 0);
  handover.NoteMessage("away", 5);
  EXPECT_THAT(handover.Wanted(6), ElementsAre("east", "away"));
}

TEST_F(ZoneHandoverTest, WhereNoZoneIsNearThePresentOneStays) {
  handover_.Move(town_, EastOfBorder(2000));
  EXPECT_FALSE(handover_.Move(town_, {45, -79.95}));
  EXPECT_EQ(handover_.present(), "east");
  EXPECT_THAT(handover_.near(), ElementsAre("east"));
}

TEST_F(ZoneHandoverTest, NumbersThatAreNoneAreRefused) {
  ZoneHandover::Config config;
  config.near_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(ZoneHandover(config, "centre"), Error);
  config = {};
  config.linger_s = -1;
  EXPECT_THROW(ZoneHandover(config, "centre"), Error);
  config = {};
  config.max_zones = 0;
  EXPECT_THROW(ZoneHandover(config, "centre"), Error);
}

}  // namespace
}  // namespace livemap::directory
