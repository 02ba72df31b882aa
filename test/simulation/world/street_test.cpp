#include "simulation/world/street.h"

#include <gtest/gtest.h>

#include <set>

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {
namespace {

constexpr double kStreetLengthM = 400;

TEST(CounterRandom, DependsOnKeyAndCounterOnly) {
  CounterRandom a(7, 1, 2);
  CounterRandom b(7, 1, 2);
  CounterRandom other_item(7, 1, 3);
  CounterRandom other_stream(7, 2, 2);
  const std::uint64_t first = a.Bits();
  EXPECT_EQ(first, b.Bits());
  EXPECT_NE(first, a.Bits());
  EXPECT_NE(first, other_item.Bits());
  EXPECT_NE(first, other_stream.Bits());
}

TEST(CounterRandom, IsUniform) {
  CounterRandom random(1, 1);
  double sum = 0;
  double squares = 0;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    const double value = random.Uniform(0.0, 1.0);
    ASSERT_GE(value, 0);
    ASSERT_LT(value, 1);
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 0.004);
  EXPECT_NEAR(squares / kCount - 0.25, 1.0 / 12, 0.004);
}

TEST(RoadLine, IsSmoothAndAsLongAsItsPieces) {
  const RoadLine line(90, {{100, 0, 0}, {80, 40, 3}, {60, -20, -2}});
  EXPECT_EQ(line.length_m(), 240);
  EXPECT_NEAR(line.HeadingRad(0), 0, 1e-12);
  EXPECT_NEAR(line.HeadingRad(240), 20 * M_PI / 180, 1e-9);
  EXPECT_NEAR(line.At(240, 0, 0).z(), 1, 1e-9);
  for (double along = -20; along < 260; along += 0.25) {
    const Eigen::Vector3d step = line.At(along + 0.25, 0, 0) - line.At(along, 0, 0);
    ASSERT_NEAR(step.head<2>().norm(), 0.25, 1e-4) << along;
    ASSERT_LT(std::abs(line.HeadingRad(along + 0.25) - line.HeadingRad(along)), 0.006) << along;
  }
}

TEST(RoadLine, BearingIsClockwiseFromNorthAndLeftIsLeft) {
  const RoadLine north(0, {{100, 0, 0}});
  EXPECT_LT((north.At(50, 0, 0) - Eigen::Vector3d(0, 50, 0)).norm(), 1e-9);
  EXPECT_LT((north.At(50, 2, 1) - Eigen::Vector3d(-2, 50, 1)).norm(), 1e-9);
}

TEST(Street, SameSeedGivesTheSameBlocksAndAnotherSeedOthers) {
  const Street street(WorldDescription(), 3, kStreetLengthM, true);
  const Street again(WorldDescription(), 3, kStreetLengthM, true);
  const Street other(WorldDescription(), 4, kStreetLengthM, true);
  const StreetBlock a = street.Build(2);
  const StreetBlock b = again.Build(2);
  const StreetBlock c = other.Build(2);
  ASSERT_EQ(a.mesh.positions.size(), b.mesh.positions.size());
  for (std::size_t i = 0; i < a.mesh.positions.size(); ++i) {
    ASSERT_EQ(a.mesh.positions[i], b.mesh.positions[i]);
  }
  EXPECT_NE(a.mesh.positions.size(), c.mesh.positions.size());
}

TEST(Street, HazardsHaveInstancesOfTheirOwnThatCarryTheirClass) {
  const Street street(WorldDescription(), 5, kStreetLengthM, true);
  std::set<std::uint32_t> instances;
  std::set<ObjectClass> classes;
  for (int index = 0; index < 60; ++index) {
    for (const StreetHazard& hazard : street.Hazards(index)) {
      EXPECT_TRUE(instances.insert(hazard.instance).second);
      EXPECT_EQ(ClassOfInstance(hazard.instance), hazard.object_class);
      EXPECT_GE(hazard.along_m, index * kBlockM);
      EXPECT_LT(hazard.along_m, (index + 1) * kBlockM);
      classes.insert(hazard.object_class);
    }
  }
  EXPECT_EQ(classes.size(), HazardClasses().size()) << "every class appears within 2.4 km";
}

TEST(Street, PotholeIsDentedAndItsBorderMeetsTheRoad) {
  Pothole hole;
  hole.along_m = 10;
  hole.left_m = -1.5F;
  hole.radius_m = 0.4F;
  hole.depth_m = 0.08F;
  hole.seed = 5;
  EXPECT_LT(hole.Dent(10, -1.5F), -0.05F);
  for (float angle = 0; angle < 6.28F; angle += 0.1F) {
    const float x = 10 + 1.7F * 0.4F * std::cos(angle);
    const float y = -1.5F + 1.7F * 0.4F * std::sin(angle);
    EXPECT_EQ(hole.Dent(x, y), 0) << "the mesh is refined to 1.7 radii";
  }
}

TEST(Street, PlacesTheHazardsOfItsFileAndNoOthers) {
  WorldDescription world;
  world.hazards.emplace();
  PlacedHazard deer;
  deer.object_class = ObjectClass::kDeer;
  deer.at_m = 55;
  deer.left_m = 2;
  world.hazards->push_back(deer);
  const Street street(world, 5, kStreetLengthM, true);
  for (int index = 0; index < 8; ++index) {
    const std::vector<StreetHazard> hazards = street.Hazards(index);
    ASSERT_EQ(hazards.size(), index == 1 ? 1U : 0U);
  }
  EXPECT_EQ(street.Hazards(1)[0].along_m, 55);
}

}  // namespace
}  // namespace livemap::simulation
