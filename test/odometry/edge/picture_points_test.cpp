#include "odometry/edge/picture_points.h"

#include <gtest/gtest.h>

#include <cmath>

#include "test/odometry/chequered_wall.h"

namespace livemap::odometry {
namespace {

constexpr double kUnlikeness = 8;

PicturePoints PixelsOf(const RgbdFrame& frame) {
  PicturePoints points;
  points.Take(frame.grey, frame.depth, kWallCamera);
  return points;
}

double ShareWithin(double bound, const PicturePoints& points, const RgbdFrame& frame,
                   const Eigen::Isometry3d& new_from_reference) {
  PicturePoints::Differences differences;
  points.Compare(frame.grey, kWallCamera, new_from_reference, 1, differences);
  EXPECT_GT(differences.count, 0U);
  return differences.ShareWithin(bound);
}

TEST(PicturePoints, TellTheTrueMotionFromOneThatIsAPeriodOff) {
  const ChequeredWall wall(kUnlikeness);
  const PicturePoints points = PixelsOf(wall.See(0, Pose(0, 0, 0, 0, 0, 0)));
  const RgbdFrame moved = wall.See(1, Pose(0.2, 0, 0, 0, 0, 0));
  EXPECT_GT(ShareWithin(2, points, moved, Pose(-0.2, 0, 0, 0, 0, 0)), 0.95);
  const double period_m = 2 * ChequeredWall::kSideM;
  EXPECT_LT(ShareWithin(2, points, moved, Pose(-0.2 + period_m, 0, 0, 0, 0, 0)), 0.6);
}

TEST(PicturePoints, SayNothingOfPeriodsThatAreAlike) {
  const ChequeredWall wall(0);
  const PicturePoints points = PixelsOf(wall.See(0, Pose(0, 0, 0, 0, 0, 0)));
  const RgbdFrame moved = wall.See(1, Pose(0.2, 0, 0, 0, 0, 0));
  const double period_m = 2 * ChequeredWall::kSideM;
  EXPECT_GT(ShareWithin(2, points, moved, Pose(-0.2 + period_m, 0, 0, 0, 0, 0)), 0.95);
}

TEST(PicturePoints, AgreeInOtherLight) {
  const ChequeredWall wall(kUnlikeness);
  const PicturePoints points = PixelsOf(wall.See(0, Pose(0, 0, 0, 0, 0, 0)));
  const RgbdFrame darker = wall.See(1, Pose(0.2, 0, 0, 0, 0, 0), 0.6, 25);
  EXPECT_GT(ShareWithin(2, points, darker, Pose(-0.2, 0, 0, 0, 0, 0)), 0.95);
}

TEST(PicturePoints, AreTakenBesideTheEdges) {
  const RgbdFrame frame = ChequeredWall(0).See(0, Pose(0, 0, 0, 0, 0, 0));
  // A pixel off in both directions changes nothing but at edges.
  const double pixel_m = 2 / kWallCamera.fx;
  EXPECT_GT(ShareWithin(2, PixelsOf(frame), frame, Pose(pixel_m, pixel_m, 0, 0, 0, 0)), 0.97);
}

TEST(PicturePoints, SayNothingWhereTooFewAreInView) {
  const RgbdFrame frame = ChequeredWall(0).See(0, Pose(0, 0, 0, 0, 0, 0));
  PicturePoints::Differences differences;
  PixelsOf(frame).Compare(frame.grey, kWallCamera, Pose(0, 0, 0, 0, 3, 0), 1, differences);
  EXPECT_EQ(differences.count, 0U);
  EXPECT_TRUE(std::isinf(differences.Sigma()));
  EXPECT_EQ(differences.ShareWithin(2), 0);
}

TEST(PicturePoints, AreNoneWhereNoDepthIsKnown) {
  RgbdFrame frame = ChequeredWall(0).See(0, Pose(0, 0, 0, 0, 0, 0));
  frame.depth.setTo(0);
  EXPECT_EQ(PixelsOf(frame).size(), 0U);
}

}  // namespace
}  // namespace livemap::odometry
