#include "streets/street_place.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace livemap::streets {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr double kNorth = 0;
constexpr double kEast = M_PI / 2;
constexpr double kSouth = M_PI;
constexpr double kWest = -M_PI / 2;

/// Forbes Ave runs east-west with two-way traffic; S Craig St crosses it at 0, S Bellefield Ave at
/// 300 m to the east. Boulevard, 500 m to the north, has two carriageways 14 m apart, the southern
/// one eastwards. A lane without a name leads north from (700, 0).
StreetMap PlaceTown(const geo::LocalFrame& frame) {
  StreetMapBuilder builder;
  std::int64_t id = 0;
  const auto add = [&](const std::string& name, std::vector<std::int64_t> nodes, bool one_way) {
    Street street;
    street.id = ++id;
    street.backward = !one_way;
    builder.AddStreet(street, name, nodes);
  };
  add("Forbes Ave", {1, 2, 3, 4, 5}, false);
  add("S Craig St", {6, 2, 7}, false);
  add("S Bellefield Ave", {8, 3, 9}, false);
  add("Boulevard", {10, 11}, true);
  add("Boulevard", {12, 13}, true);
  add("", {5, 14}, false);
  const auto put = [&](int node, double east_m, double north_m) {
    builder.SetPlace(node, frame.ToGeo({east_m, north_m}));
  };
  put(1, -1500, 0);
  put(2, 0, 0);
  put(3, 300, 0);
  put(4, 500, 0);
  put(5, 700, 0);
  put(6, 0, -100);
  put(7, 0, 100);
  put(8, 300, -100);
  put(9, 300, 100);
  put(10, -500, 500);
  put(11, 500, 500);
  put(12, 500, 514);
  put(13, -500, 514);
  put(14, 700, 200);
  return builder.Build();
}

class StreetPlaceTest : public testing::Test {
 protected:
  Spot At(double east_m, double north_m, double course_rad, double sigma_m = 2) const {
    return {frame_.ToGeo({east_m, north_m}), sigma_m, course_rad};
  }
  StreetWords Describe(double east_m, double north_m, double course_rad, double sigma_m = 2) const {
    return DescribeSpot(map_, At(east_m, north_m, course_rad, sigma_m));
  }

  geo::LocalFrame frame_{{40.44, -79.95}};
  StreetMap map_ = PlaceTown(frame_);
};

TEST_F(StreetPlaceTest, SaysStreetNearestCrossingAndDirection) {
  const StreetWords east = Describe(60, 2, kEast);
  EXPECT_EQ(east.street, "Forbes Ave");
  EXPECT_EQ(east.near, "S Craig St");
  EXPECT_EQ(east.direction, "eastbound");
  EXPECT_EQ(east.note, "");
  EXPECT_EQ(Describe(240, -2, kWest).near, "S Bellefield Ave");
  EXPECT_EQ(Describe(240, -2, kWest).direction, "westbound");
  EXPECT_EQ(Describe(2, 60, kNorth + 0.1).direction, "northbound");
  EXPECT_EQ(Describe(2, 60, kSouth).direction, "southbound");
}

TEST_F(StreetPlaceTest, NamesNoCrossingThatIsFarAlongTheStreet) {
  EXPECT_EQ(Describe(-300, 0, kEast).near, "S Craig St");
  const StreetWords far = Describe(-600, 0, kEast);
  EXPECT_EQ(far.street, "Forbes Ave");
  EXPECT_EQ(far.near, "");
}

TEST_F(StreetPlaceTest, NamesAHouseWhereNoCrossingIsAtHand) {
  AddressMapBuilder builder;
  builder.SetPlace(1, frame_.ToGeo({150, 15}), "Forbes Ave", "4200");
  builder.SetPlace(2, frame_.ToGeo({145, 5}), "S Craig St", "7");
  builder.SetPlace(3, frame_.ToGeo({20, 15}), "Forbes Ave", "4000");
  const AddressMap houses = builder.Build();
  EXPECT_EQ(DescribeSpot(map_, At(148, 2, kEast), &houses).near, "no. 4200");
  EXPECT_EQ(DescribeSpot(map_, At(20, 2, kEast), &houses).near, "S Craig St");
  EXPECT_EQ(DescribeSpot(map_, At(240, 2, kEast), &houses).near, "S Bellefield Ave");
}

TEST_F(StreetPlaceTest, SaysWhyADirectionIsNotKnown) {
  const StreetWords unknown = Describe(60, 2, kUnknown);
  EXPECT_EQ(unknown.street, "Forbes Ave");
  EXPECT_EQ(unknown.direction, "");
  EXPECT_EQ(unknown.note, "the course of the vehicle that reported it is not known");
  EXPECT_EQ(Describe(150, 2, kNorth).note,
            "the vehicle that reported it did not drive along the street");
}

TEST_F(StreetPlaceTest, SaysWhyAStreetIsNotKnown) {
  const StreetWords none = Describe(150, 250, kEast);
  EXPECT_EQ(none.street, "");
  EXPECT_EQ(none.note, "no street of the street file is near");
  const StreetWords nameless = Describe(702, 100, kNorth);
  EXPECT_EQ(nameless.street, "");
  EXPECT_EQ(nameless.near, "Forbes Ave");
  EXPECT_EQ(nameless.direction, "northbound");
  EXPECT_EQ(nameless.note, "the street has no name in the street file");
}

TEST_F(StreetPlaceTest, TheCourseChoosesBetweenCarriageways) {
  // Nearer to the other one, by errors of the position.
  EXPECT_EQ(Describe(0, 509, kEast, 5).direction, "eastbound");
  EXPECT_EQ(Describe(0, 505, kWest, 5).direction, "westbound");
  // A one-way street says it alone.
  EXPECT_EQ(Describe(0, 500, kUnknown).direction, "eastbound");
  const StreetWords between = Describe(0, 507, kUnknown, 5);
  EXPECT_EQ(between.street, "Boulevard");
  EXPECT_EQ(between.direction, "");
  EXPECT_EQ(between.note, "carriageways of both directions lie equally near");
}

TEST_F(StreetPlaceTest, OnlyCertainCarriagewaysAreOpposite) {
  const auto opposite = [&](const Spot& a, const Spot& b) {
    const auto on_a = FindCarriageway(map_, a);
    const auto on_b = FindCarriageway(map_, b);
    return on_a && on_b && LieOnOppositeCarriageways(map_, *on_a, *on_b);
  };
  EXPECT_TRUE(opposite(At(0, 506, kEast), At(0, 508, kWest)));
  EXPECT_FALSE(opposite(At(0, 506, kEast), At(5, 508, kEast)));
  EXPECT_FALSE(opposite(At(0, 506, kEast), At(0, 507, kUnknown, 5)));
  // One street with two lanes: one and the same hazard is seen from both.
  EXPECT_FALSE(opposite(At(60, 1, kEast), At(60, -1, kWest)));
}

TEST_F(StreetPlaceTest, FindsNothingForNoPlace) {
  EXPECT_FALSE(FindCarriageway(map_, {{kUnknown, 0}, 2, kEast}));
  EXPECT_FALSE(FindCarriageway(map_, {{90, 0}, 2, kEast}));
}

}  // namespace
}  // namespace livemap::streets
