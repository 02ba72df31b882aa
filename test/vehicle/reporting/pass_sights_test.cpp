#include "vehicle/reporting/pass_sights.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "placement/road_ground_contact.h"
#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

/// What a vehicle sees that drives straight on.
class PassSightsTest : public ::testing::Test {
 protected:
  protocol::HazardCatalogue catalogue_;
  PassSights::Config config_;
};

TEST_F(PassSightsTest, TwoThingsOfAClassKeepTheirSightsApart) {
  PassSights passes(config_, catalogue_);
  const auto first = passes.Add({SeenAt(3, 20, 2), SeenAt(3, 20, -2)});
  ASSERT_EQ(first.size(), 2u);
  EXPECT_NE(first[0], first[1]);
  for (double time_s = 3.1; time_s < 3.95; time_s += 0.1) {
    // In the other order.
    const auto again = passes.Add({SeenAt(time_s, 20, -2), SeenAt(time_s, 20, 2)});
    EXPECT_EQ(again[0], first[1]);
    EXPECT_EQ(again[1], first[0]);
  }
  EXPECT_EQ(passes.size(), 2u);
  EXPECT_NEAR(geo::GeodesicDistanceM(passes.Place(first[0])->place.position,
                                     passes.Place(first[1])->place.position),
              4, 0.1);
}

TEST_F(PassSightsTest, TwoBoxesInOneImageAreTwoThings) {
  PassSights passes(config_, catalogue_);
  const auto first = passes.Add({SeenAt(3, 12, 0)});
  const auto again = passes.Add({SeenAt(3.1, 12, 0), SeenAt(3.1, 12.2, 0)});
  EXPECT_EQ(again[0], first[0]);
  EXPECT_NE(again[1], first[0]);
}

TEST_F(PassSightsTest, ALoneThingIsTheSameEvenWhereThePosesSayTooLittleOfTheirError) {
  // Aside within a tenth of a second by more than the poses and the box explain.
  PassSights passes(config_, catalogue_);
  const auto first = passes.Add({SeenAt(3, 8, 0)});
  EXPECT_EQ(passes.Add({SeenAt(3.1, 8, 0.3)})[0], first[0]);
  PassSights two(config_, catalogue_);
  const auto both = two.Add({SeenAt(3, 8, 0), SeenAt(3, 8, 3)});
  const auto again = two.Add({SeenAt(3.1, 8, -0.3), SeenAt(3.1, 8, 3)});
  EXPECT_EQ(again[1], both[1]);
  EXPECT_NE(again[0], both[0]) << "it may be a third one";
}

TEST_F(PassSightsTest, AnotherClassIsAnotherThing) {
  PassSights passes(config_, catalogue_);
  const auto first = passes.Add({SeenAt(3, 12, 0)});
  EXPECT_NE(passes.Add({SeenAt(3.1, 12, 0, "pothole")})[0], first[0]);
}

TEST_F(PassSightsTest, WhatIsKnownStaysKnownUntilItIsPassed) {
  PassSights passes(config_, catalogue_);
  const auto first = passes.Add({SeenAt(3, 12, 0)});
  EXPECT_FALSE(passes.IsKnown(first[0]));
  passes.MarkKnown(first[0]);
  EXPECT_TRUE(passes.IsKnown(first[0]));
  passes.Add({SeenAt(3.1 + config_.keep_s, 100, 0)});
  EXPECT_FALSE(passes.IsKnown(first[0]));
  EXPECT_FALSE(passes.Place(first[0]));
  EXPECT_EQ(passes.size(), 1u);
}

TEST_F(PassSightsTest, MemoryIsBounded) {
  config_.max_hazards = 3;
  PassSights passes(config_, catalogue_);
  for (int i = 0; i < 10; ++i) passes.Add({SeenAt(3 + 0.01 * i, 12, 3.0 * (i - 5))});
  EXPECT_EQ(passes.size(), 3u);
}

TEST_F(PassSightsTest, WhatIsNoNumberIsNoSight) {
  PassSights passes(config_, catalogue_);
  PassSights::Seen broken = SeenAt(3, 12, 0);
  broken.sight.pixel.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(passes.Add({broken})[0], 0u);
  EXPECT_EQ(passes.size(), 0u);
  EXPECT_TRUE(passes.Add({}).empty());
}

}  // namespace
}  // namespace livemap::vehicle
