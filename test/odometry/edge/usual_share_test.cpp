#include "odometry/edge/usual_share.h"

#include <gtest/gtest.h>

namespace livemap::odometry {
namespace {

constexpr double kLeastDrop = 0.04;

TEST(UsualShare, FollowsTheLastFramesFromTheFirstOneOn) {
  UsualShare usual;
  EXPECT_EQ(usual.value(), 0);
  usual.Add(0.8);
  EXPECT_DOUBLE_EQ(usual.value(), 0.8);
  for (int i = 0; i < 30; ++i) usual.Add(0.9);
  EXPECT_NEAR(usual.value(), 0.9, 1e-3);
}

TEST(UsualShare, ExpectsOfTheFirstFrameWhatItWasTold) {
  UsualShare usual(0.95);
  usual.Add(0.5);
  EXPECT_NEAR(usual.value(), 0.86, 1e-12);
  usual.Forget();
  EXPECT_EQ(usual.value(), 0.95);
}

TEST(UsualShare, FramesThatFellShortExcuseOthersThatDo) {
  UsualShare usual;
  for (int i = 0; i < 40; ++i) usual.Add(i % 2 == 0 ? 0.9 : 0.7);
  EXPECT_GT(usual.Drop(kLeastDrop), 0.2);
  EXPECT_LT(usual.Drop(kLeastDrop), 0.5);
}

TEST(UsualShare, FramesWithMoreThanUsualExcuseNobody) {
  UsualShare usual;
  for (int i = 0; i < 10; ++i) usual.Add(0.83);
  for (int i = 0; i < 6; ++i) usual.Add(0.98);
  EXPECT_DOUBLE_EQ(usual.Drop(kLeastDrop), kLeastDrop);
}

}  // namespace
}  // namespace livemap::odometry
