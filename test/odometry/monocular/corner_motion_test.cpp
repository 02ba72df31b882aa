#include "odometry/monocular/corner_motion.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgproc.hpp>

#include "odometry/se3.h"
#include "simulation/room/room_motion.h"
#include "simulation/room/simulated_room.h"

namespace livemap::odometry {
namespace {

/// Two pictures of the simulated room, from places 12 cm apart.
class CornerCheckTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    simulation::SimulatedCamera camera;
    camera.intrinsics = kEye;
    const simulation::SimulatedRoom room(1);
    const Eigen::Isometry3d start =
        RoomCameraPose(room.plan(), simulation::RoomMotion::kHand, 0, 1);
    const auto see = [&](const Eigen::Isometry3d& pose, std::uint32_t frame) {
      cv::Mat grey;
      cv::cvtColor(room.Render(camera, pose, frame, 1.3F, 1, 2).bgr, grey, cv::COLOR_BGR2GRAY);
      return grey;
    };
    before_ = see(start, 0);
    now_ = see(start * TrueMotion().inverse(), 1);
  }

  static Eigen::Isometry3d TrueMotion() {
    Vector6d twist;
    twist << 0.1, 0, -0.07, 0, 0.01, 0;
    return Se3Exp(twist);
  }
  /// The true motion with a turn to the left besides, as depths that err with it may have it.
  static Eigen::Isometry3d TurnedBy(double angle_rad) {
    Vector6d turn = Vector6d::Zero();
    turn[4] = angle_rad;
    return Se3Exp(turn) * TrueMotion();
  }
  static double TurnBetween(const Eigen::Isometry3d& one, const Eigen::Isometry3d& other) {
    return Eigen::AngleAxisd(one.linear().transpose() * other.linear()).angle();
  }

  static constexpr geo::CameraIntrinsics kEye{250, 250, 159.5, 119.5, 320, 240};
  static cv::Mat before_, now_;
  const CornerCheck check_{{}, kEye};
};

cv::Mat CornerCheckTest::before_;
cv::Mat CornerCheckTest::now_;

TEST_F(CornerCheckTest, AMotionThatIsTrueIsNotContradicted) {
  EXPECT_FALSE(check_.Contradicting(before_, now_, TrueMotion()));
}

TEST_F(CornerCheckTest, AMotionWithATurnThatIsNoneIsBroughtToTheTruth) {
  for (const double turn_rad : {-0.02, 0.02, 0.04}) {
    const auto motion = check_.Contradicting(before_, now_, TurnedBy(turn_rad));
    ASSERT_TRUE(motion) << turn_rad;
    EXPECT_LT(TurnBetween(*motion, TrueMotion()), 0.003) << turn_rad;
    EXPECT_NEAR(motion->translation().norm(), TurnedBy(turn_rad).translation().norm(), 1e-9);
  }
}

TEST_F(CornerCheckTest, WhereFewCornersAreSeenOrNothingMovesNothingIsContradicted) {
  const cv::Mat plain(before_.size(), CV_8UC1, cv::Scalar(90));
  EXPECT_FALSE(check_.Contradicting(plain, plain, TurnedBy(0.02)));
  EXPECT_FALSE(check_.Contradicting(before_, plain, TurnedBy(0.02)));
  EXPECT_FALSE(check_.Contradicting(before_, before_, Eigen::Isometry3d::Identity()));
  Eigen::Isometry3d nowhere = TrueMotion();
  nowhere.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(check_.Contradicting(before_, now_, nowhere));
}

TEST_F(CornerCheckTest, CornersThatDoNotAgreeContradictNothing) {
  cv::Mat elsewhere;
  cv::flip(now_, elsewhere, 1);
  EXPECT_FALSE(check_.Contradicting(before_, elsewhere, TurnedBy(0.02)));
}

}  // namespace
}  // namespace livemap::odometry
