#include "evaluation/trajectory/trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string ErrorOf(const std::string& text) {
  try {
    ParseTrajectory(text, "t.txt", 10);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Trajectory, TumLinesAreReadWithoutLosingDigitsOfTheStamp) {
  const auto poses = ParseTrajectory(
      "# comment\n\n1305031102.160407 1 2 3 0 0 0.70710678 0.70710678\r\n"
      "1305031102.194330 4 5 6 0 0 0 1",
      "t.txt", 10);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[0].stamp_ns, 1305031102160407000);
  const Eigen::Vector3d ahead = poses[0].world_from_camera * Eigen::Vector3d::UnitX();
  EXPECT_NEAR((ahead - Eigen::Vector3d(1, 3, 3)).norm(), 0, 1e-7);
  EXPECT_EQ(poses[1].world_from_camera.translation(), Eigen::Vector3d(4, 5, 6));
}

TEST(Trajectory, StampsInScientificNotationAreReadToTheMicrosecond) {
  const auto poses = ParseTrajectory(
      "1.305031102160407066e+09 0 0 0 0 0 0 1\n1.305031102194330e+09 0 0 0 0 0 0 1\n", "t.txt", 10);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_NEAR(static_cast<double>(poses[0].stamp_ns - 1305031102160407000), 0, 1000);
}

TEST(Trajectory, KittiRowsGetTheStampsOfTheirRate) {
  const auto poses =
      ParseTrajectory("1 0 0 1 0 1 0 2 0 0 1 3\n1 0 0 4 0 1 0 5 0 0 1 6\n", "t.txt", 4);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[1].stamp_ns, 250'000'000);
  EXPECT_EQ(poses[1].world_from_camera.translation(), Eigen::Vector3d(4, 5, 6));
}

TEST(Trajectory, BadLinesAreNamedInOneSentence) {
  const std::string good = "1 0 0 0 0 0 0 1\n";
  const std::string kitti = "1 0 0 1 0 1 0 2 0 0 1 3\n";
  for (const char* bad :
       {"2 0 0 0 0 0 0\n", "2 nan 0 0 0 0 0 1\n", "2 inf 0 0 0 0 0 1\n", "2 0 0 0 0 0 0 2\n",
        "2 0 0 0 0 0 0 0\n", "2 1e300 0 0 0 0 0 1\n", "0.5 0 0 0 0 0 0 1\n", "-1 0 0 0 0 0 0 1\n",
        "nan 0 0 0 0 0 0 1\n", "1e99 0 0 0 0 0 0 1\n", "2 x 0 0 0 0 0 1\n",
        "1 0 0 1 0 1 0 2 0 0 1 3\n"}) {
    EXPECT_THAT(ErrorOf(good + bad), AllOf(HasSubstr("line 2 of 't.txt'"), HasSubstr("accepted")));
  }
  for (const char* bad : {"1 0 0 1 0 1 0 2 0 0 1\n", "1 0 0 nan 0 1 0 2 0 0 1 3\n",
                          "2 0 0 1 0 1 0 2 0 0 1 3\n", "1 0 0 0 0 0 0 1\n", "# comment\n"}) {
    EXPECT_THAT(ErrorOf(kitti + bad), AllOf(HasSubstr("line 2 of 't.txt'"), HasSubstr("accepted")));
  }
}

TEST(Trajectory, OtherFilesAreRefused) {
  EXPECT_THAT(ErrorOf(""), HasSubstr("'t.txt' has no pose"));
  EXPECT_THAT(ErrorOf("# only\n\n \r\n"), HasSubstr("'t.txt' has no pose"));
  EXPECT_THAT(ErrorOf("#\n1,2,3\n"), HasSubstr("line 2 of 't.txt' has 1 columns, accepted are 8"));
  EXPECT_THAT(ErrorOf(std::string(1'000'001, '\n')), HasSubstr("more than 1000000 lines"));
  EXPECT_THROW(ReadTrajectory("/nowhere.txt", 10), Error);
  EXPECT_THROW(ReadTrajectory(::testing::TempDir(), 10), Error);
}

}  // namespace
}  // namespace livemap::evaluation
