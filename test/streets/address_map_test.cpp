#include "streets/address_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "common/error.h"
#include "streets/address_file.h"

namespace livemap::streets {
namespace {

constexpr char kHouses[] = R"(<osm version="0.6">
  <node id="1" lat="40.4400" lon="-79.9500"><tag k="addr:street" v="Forbes Ave"/>
    <tag k="addr:housenumber" v="4200"/></node>
  <node id="2" lat="40.4400" lon="-79.9497"><tag k="addr:housenumber" v="9"/></node>
  <node id="3" lat="40.4402" lon="-79.9496"/>
  <node id="4" lat="40.4403" lon="-79.9496"/>
  <node id="5" lat="40.4401" lon="-79.9496"><tag k="addr:street" v="S Craig St"/>
    <tag k="addr:housenumber" v="1"/></node>
  <way id="7"><nd ref="3"/><nd ref="4"/><nd ref="3"/><tag k="building" v="yes"/>
    <tag k="addr:street" v="Forbes Ave"/><tag k="addr:housenumber" v="4210"/></way>
  <way id="8"><nd ref="99"/><nd ref="4"/>
    <tag k="addr:street" v="Forbes Ave"/><tag k="addr:housenumber" v="4212"/></way></osm>)";

TEST(AddressMapTest, FindsTheNearestNumberOfTheStreet) {
  const AddressMap houses = ParseAddresses(kHouses, "test");
  // A number without a street, and a building whose node the file lacks, are left out.
  EXPECT_EQ(houses.size(), 3U);
  EXPECT_GT(houses.bytes(), 0U);
  EXPECT_EQ(houses.NumberNear({40.44005, -79.9500}, "Forbes Ave", 40), "4200");
  EXPECT_EQ(houses.NumberNear({40.44015, -79.9496}, "Forbes Ave", 40), "4210");
  EXPECT_EQ(houses.NumberNear({40.44015, -79.9496}, "S Craig St", 40), "1");
  EXPECT_EQ(houses.NumberNear({40.44015, -79.9496}, "Fifth Ave", 40), "");
  EXPECT_EQ(houses.NumberNear({40.4410, -79.9500}, "Forbes Ave", 40), "");
  EXPECT_EQ(houses.NumberNear({90, 0}, "Forbes Ave", 40), "");
  EXPECT_EQ(houses.NumberNear({40.44, -79.95}, "Forbes Ave", 1e9), "");
}

TEST(AddressMapTest, FindsNumbersAcrossTheBordersOfItsCells) {
  AddressMapBuilder builder;
  builder.SetPlace(1, {40.00001, -80.00001}, "A", "1");
  const AddressMap houses = builder.Build();
  for (const double north : {-0.0001, 0.0, 0.0001}) {
    for (const double east : {-0.0001, 0.0, 0.0001}) {
      EXPECT_EQ(houses.NumberNear({40 + north, -80 + east}, "A", 40), "1");
    }
  }
}

TEST(AddressMapTest, RefusesTooManyAndWhatIsNoFile) {
  AddressMapBuilder builder(1);
  builder.AddAtNode("A", "1", 1);
  EXPECT_THROW(builder.AddAtNode("A", "2", 2), Error);
  builder.SetPlace(1, {1, 1}, "", "");
  EXPECT_THROW(builder.SetPlace(2, {1, 1}, "A", "3"), Error);
  EXPECT_THROW(ParseAddresses("<osm", "test"), Error);
  EXPECT_THROW(ReadAddresses("/nowhere.osm.pbf"), Error);
}

}  // namespace
}  // namespace livemap::streets
