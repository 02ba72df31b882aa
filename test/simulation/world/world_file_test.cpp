#include "simulation/world/world_file.h"

#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::simulation {
namespace {

std::string Refusal(const std::string& yaml) {
  try {
    ParseWorldFile(yaml, "town.yaml");
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(WorldFile, ReadsWhatItSays) {
  const WorldDescription world = ParseWorldFile(
      "road:\n"
      "  bearing_deg: 45\n"
      "  lane_width_m: 3.5\n"
      "  pieces:\n"
      "    - {length_m: 100}\n"
      "    - {length_m: 80, turn_deg: -40, climb_m: 2}\n"
      "  crossings_m: [60]\n"
      "scene: {parked_cars: false}\n"
      "hazards:\n"
      "  - {class: pothole, at_m: 30, left_m: -1.5, radius_m: 0.4, water: true}\n"
      "  - {class: deer, at_m: 50, left_m: 2}\n",
      "town.yaml");
  EXPECT_EQ(world.bearing_deg, 45);
  EXPECT_EQ(world.lane_width_m, 3.5);
  ASSERT_EQ(world.pieces.size(), 2U);
  EXPECT_EQ(world.pieces[1].turn_deg, -40);
  ASSERT_TRUE(world.crossings_m);
  EXPECT_EQ(world.crossings_m->at(0), 60);
  EXPECT_FALSE(world.parked_cars);
  EXPECT_TRUE(world.trees);
  ASSERT_TRUE(world.hazards);
  EXPECT_EQ(world.hazards->at(0).object_class, ObjectClass::kPothole);
  EXPECT_EQ(world.hazards->at(0).water, true);
  EXPECT_EQ(world.hazards->at(1).object_class, ObjectClass::kDeer);
}

TEST(WorldFile, RefusesMistakesByNameAndLine) {
  EXPECT_EQ(Refusal("road:\n  lane_width_m: wide\n"),
            "the world file 'town.yaml', line 2: 'lane_width_m' is 'wide', accepted is a number "
            "from 2.5 to 4.5");
  EXPECT_EQ(Refusal("road: {}\nweather: rain\n"),
            "the world file 'town.yaml', line 2: the file has no key 'weather', accepted are: "
            "hazards, road, scene");
  EXPECT_EQ(Refusal("hazards:\n  - {class: pothole, at_m: 3, left_m: 0}\n  - {class: cow, at_m: 3, "
                    "left_m: 0}\n"),
            "the world file 'town.yaml', line 3: 'class' is 'cow', accepted are: pothole, "
            "traffic_cone, road_work_sign, barrier, debris, deer, construction_machine, "
            "stopped_accident");
  EXPECT_EQ(Refusal("hazards:\n  - class: deer\n    left_m: 0\n"),
            "the world file 'town.yaml', line 2: 'at_m' is missing");
  EXPECT_EQ(Refusal("scene:\n  trees: maybe\n"),
            "the world file 'town.yaml', line 2: 'trees' is 'maybe', accepted is true or false");
  EXPECT_EQ(Refusal("hazards:\n  - {class: deer, at_m: 1, left_m: 0, radius_m: 1}\n"),
            "the world file 'town.yaml', line 2: 'radius_m' belongs to potholes only");
}

TEST(WorldFile, RefusesRoadsThatNoGroundCanFollow) {
  EXPECT_NE(Refusal("road:\n  pieces:\n    - {length_m: 20, turn_deg: 90}\n").find("line 3"),
            std::string::npos);
  EXPECT_NE(Refusal("road:\n  pieces:\n    - {length_m: 20, climb_m: 9}\n").find("steeper"),
            std::string::npos);
  EXPECT_NE(Refusal("road:\n  crossings_m: [50, 60]\n").find("40 m apart"), std::string::npos);
  std::string endless = "road:\n  pieces:\n";
  for (int i = 0; i < 11; ++i) endless += "    - {length_m: 100000}\n";
  EXPECT_EQ(Refusal(endless),
            "the world file 'town.yaml', line 13: the road is longer than 1000 km here");
}

TEST(WorldFile, RefusesWhatIsNoWorldAtAll) {
  EXPECT_EQ(Refusal("[1, 2]"), "the world file 'town.yaml', line 1: must be a map");
  EXPECT_NE(Refusal("road: [").find("'town.yaml', line "), std::string::npos);
  EXPECT_NE(Refusal("").find("must be a map"), std::string::npos);
  EXPECT_NE(Refusal("road: 5").find("must be a map"), std::string::npos);
  EXPECT_NE(Refusal("road: {bearing_deg: .nan}").find("accepted is a number"), std::string::npos);
  EXPECT_THROW(ReadWorldFile("/nonexistent/town.yaml"), Error);
}

TEST(WorldFile, LeavesTheRoadsLineToARoute) {
  const std::string rest = "road: {lane_width_m: 3, crossings_m: [60]}";
  EXPECT_EQ(ParseWorldFile(rest, "w", RoadSource::kRoute).lane_width_m, 3);
  for (const std::string key : {"bearing_deg: 10", "pieces: []"}) {
    const std::string yaml = "road:\n  " + key;
    EXPECT_NO_THROW(ParseWorldFile(yaml, "w"));
    EXPECT_THROW(ParseWorldFile(yaml, "w", RoadSource::kRoute), Error);
  }
}

}  // namespace
}  // namespace livemap::simulation
