#include "geo/datum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/error.h"

namespace livemap::geo {
namespace {

TEST(DatumOf, IsTheInverseOfTheFramesPose) {
  for (const GeoPoint datum : {GeoPoint{40.44, -79.94}, GeoPoint{0, 180}, GeoPoint{-89.9, 3}}) {
    const GeoPoint found = DatumOf(LocalFrame(datum).InEarth());
    EXPECT_LT(GeodesicDistanceM(found, datum), 1e-6);
  }
}

TEST(DatumOf, RefusesWhatIsNoEastNorthUpFrameOnTheEllipsoid) {
  const Eigen::Isometry3d pose = LocalFrame({48, 9}).InEarth();
  Eigen::Isometry3d high = pose;
  high.translation() += 100 * pose.linear().col(2);
  EXPECT_THROW(DatumOf(high), Error);
  EXPECT_THROW(DatumOf(pose * Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitZ())), Error);
  EXPECT_THROW(DatumOf(Eigen::Isometry3d::Identity()), Error);
  Eigen::Isometry3d nan = pose;
  nan.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(DatumOf(nan), Error);
}

TEST(MeridianConvergence, GrowsToTheEastAndWithTheLatitude) {
  const GeoPoint datum{60, 10};
  const LocalFrame frame(datum);
  EXPECT_NEAR(MeridianConvergence(frame, datum), 0, 1e-9);
  // A degree further east, north lies to the left by sin(60 degrees) of it.
  const double expected = std::sin(M_PI / 3) * M_PI / 180;
  EXPECT_NEAR(MeridianConvergence(frame, {60, 11}), expected, 1e-4);
  EXPECT_NEAR(MeridianConvergence(frame, {60, 9}), -expected, 1e-4);
}

}  // namespace
}  // namespace livemap::geo
