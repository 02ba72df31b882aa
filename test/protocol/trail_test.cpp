#include "protocol/trail.h"

#include <gtest/gtest.h>

#include <limits>

#include "common/error.h"

namespace livemap::protocol {
namespace {

const geo::GeoPoint kHazard{49.2, 7.0};

Trail TrailOf(const std::vector<Eigen::Vector2d>& places_m) {
  const geo::LocalFrame frame(kHazard);
  Trail trail;
  for (const Eigen::Vector2d& place_m : places_m) trail.push_back(frame.ToGeo(place_m));
  return trail;
}

double FurthestApartM(const Trail& a, const Trail& b) {
  double furthest_m = a.size() == b.size() ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    furthest_m = std::max(furthest_m, geo::GeodesicDistanceM(a[i], b[i]));
  }
  return furthest_m;
}

TEST(TrailTest, OffsetsOfAMessageAreTheSameTrailToADecimetre) {
  const Trail trail = TrailOf({{-250, 3}, {0.4, 1.2}, {120, -300}});
  const Trail read = FromTrailOffsets(ToTrailOffsets(trail, kHazard), kHazard);
  EXPECT_LT(FurthestApartM(trail, read), 0.08);
}

TEST(TrailTest, OffsetsOfNoTrailAreRefused) {
  for (const std::vector<std::int16_t>& offsets :
       {std::vector<std::int16_t>{}, std::vector<std::int16_t>{1, 2},
        std::vector<std::int16_t>{1, 2, 3}, std::vector<std::int16_t>(42, 7)}) {
    EXPECT_THROW(FromTrailOffsets(offsets, kHazard), Error) << offsets.size() << " offsets";
  }
  EXPECT_THROW(FromTrailOffsets({0, 0, 1, 1}, {91, 0}), Error);
}

TEST(TrailTest, WhatCannotBeATrailOfTheHazardIsLeftOut) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Trail trail = TrailOf({{-100, 0}, {100, 0}});
  EXPECT_EQ(ValidTrails({trail}, kHazard).size(), 1U);
  EXPECT_TRUE(ValidTrails({TrailOf({{0, 0}})}, kHazard).empty()) << "one place is no way";
  EXPECT_TRUE(ValidTrails({TrailOf({{-700, 0}, {0, 0}})}, kHazard).empty()) << "too far away";
  EXPECT_TRUE(ValidTrails({{{nan, 7}, kHazard}}, kHazard).empty());
  EXPECT_TRUE(ValidTrails({Trail(21, kHazard)}, kHazard).empty()) << "too many places";
  EXPECT_EQ(ValidTrails({trail, trail, trail}, kHazard).size(), kMaxTrails);
  EXPECT_TRUE(ValidTrails({trail}, {nan, 0}).empty());
}

TEST(TrailTest, TheTextOfAStoreIsReadAgainToACentimetre) {
  const std::vector<Trail> trails{TrailOf({{-100, 0}, {100, 0}}),
                                  TrailOf({{0, -50}, {1, 0}, {2, 80}})};
  const std::vector<Trail> read = ParseTrails(TrailsText(trails));
  ASSERT_EQ(read.size(), 2U);
  EXPECT_LT(FurthestApartM(read[0], trails[0]), 0.02);
  EXPECT_LT(FurthestApartM(read[1], trails[1]), 0.02);
  EXPECT_TRUE(AreSame(ParseTrails(TrailsText(read)), read));
  EXPECT_EQ(TrailsText({}), "");
  EXPECT_TRUE(ParseTrails("").empty());
}

TEST(TrailTest, AnyOtherTextIsRefused) {
  const std::string one = "2 492000000 70000000 492000100 70000000";
  EXPECT_EQ(ParseTrails(one).size(), 1U);
  for (const std::string& text :
       {std::string("x"), std::string("1 492000000 70000000"), std::string("2 492000000 70000000"),
        std::string("21"), std::string("2 992000000 70000000 492000100 70000000"), one + " 7",
        one + " ", one + " " + one + " " + one,
        std::string("2 492000000.5 70000000 492000100 70000000"), "0" + one}) {
    EXPECT_THROW(ParseTrails(text), Error) << "'" << text << "'";
  }
}

TEST(TrailTest, ASimplifiedTrailKeepsTheBendsAndHasFewPlaces) {
  std::vector<Eigen::Vector2d> places_m;
  for (int i = 0; i <= 50; ++i) places_m.emplace_back(5 * i - 250, i % 2);  // A metre of scatter.
  for (int i = 1; i <= 50; ++i) places_m.emplace_back(0, 5 * i);
  const Trail trail = TrailOf(places_m);
  EXPECT_LT(FurthestApartM(SimplifiedTrail(trail), TrailOf({{-250, 0}, {0, 0}, {0, 250}})), 1.5);
  // A way that winds everywhere is drawn more coarsely.
  places_m.clear();
  for (int i = 0; i <= 60; ++i) places_m.emplace_back(5 * i, i % 2 == 0 ? 0 : 40);
  EXPECT_LE(SimplifiedTrail(TrailOf(places_m)).size(), kMaxTrailPlaces);
}

}  // namespace
}  // namespace livemap::protocol
