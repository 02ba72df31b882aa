#include "evaluation/trajectory/trajectory_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "common/error.h"
#include "evaluation/nothing_measured.h"
#include "evaluation/trajectory/trajectory.h"
#include "evaluation/trajectory/trajectory_report.h"

namespace livemap::evaluation {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kPi = 3.14159265358979323846;

Eigen::Isometry3d Turned(double angle_rad, const Eigen::Vector3d& axis,
                         const Eigen::Vector3d& translation = Eigen::Vector3d::Zero()) {
  return Eigen::Translation3d(translation) * Eigen::AngleAxisd(angle_rad, axis.normalized());
}

std::int64_t Ns(double seconds) { return std::llround(seconds * 1e9); }

/// A winding drive, 10 poses per second at `speed_m_per_s`.
std::vector<datasets::StampedPose> Drive(std::size_t poses, double speed_m_per_s = 1) {
  std::vector<datasets::StampedPose> drive;
  for (std::size_t i = 0; i < poses; ++i) {
    const double s = 0.1 * static_cast<double>(i);
    const Eigen::Vector3d place(speed_m_per_s * s, 2 * std::sin(s), std::cos(0.3 * s));
    drive.push_back({Ns(100 + s), Turned(0.2 * std::sin(s), {0.2, 0.1, 1}, place)});
  }
  return drive;
}

std::vector<datasets::StampedPose> Moved(std::vector<datasets::StampedPose> poses,
                                         const Eigen::Isometry3d& motion) {
  for (datasets::StampedPose& pose : poses)
    pose.world_from_camera = motion * pose.world_from_camera;
  return poses;
}

std::vector<datasets::StampedPose> Resized(std::vector<datasets::StampedPose> poses,
                                           double factor) {
  for (datasets::StampedPose& pose : poses) pose.world_from_camera.translation() *= factor;
  return poses;
}

/// Straight on at 1 m/s, `poses` per second apart by 0.1 s; `speed` and `turn` of an estimate.
std::vector<datasets::StampedPose> Straight(std::size_t poses, double speed_m_per_s,
                                            double turn_rad_per_s = 0) {
  std::vector<datasets::StampedPose> drive;
  for (std::size_t i = 0; i < poses; ++i) {
    const double s = 0.1 * static_cast<double>(i);
    drive.push_back(
        {Ns(s), Turned(turn_rad_per_s * s, Eigen::Vector3d::UnitX(), {speed_m_per_s * s, 0, 0})});
  }
  return drive;
}

std::vector<datasets::StampedPose> AtStamps(const std::vector<double>& stamps_s) {
  std::vector<datasets::StampedPose> poses;
  for (const double stamp_s : stamps_s) poses.push_back({Ns(stamp_s), {}});
  for (datasets::StampedPose& pose : poses) pose.world_from_camera.setIdentity();
  return poses;
}

/// "true-estimated" stamps in ms of the pairs.
std::vector<std::string> PairsOf(const std::vector<double>& truth_s,
                                 const std::vector<double>& estimate_s,
                                 const AssociationConfig& options = {}) {
  const TrajectoryPairs pairs = Associate(AtStamps(truth_s), AtStamps(estimate_s), options);
  std::vector<std::string> text;
  for (std::size_t i = 0; i < pairs.truth.size(); ++i) {
    text.push_back(std::to_string(pairs.truth[i].stamp_ns / 1000000) + "-" +
                   std::to_string(pairs.estimate[i].stamp_ns / 1000000));
  }
  return text;
}

TrajectoryFigures Evaluate(const std::vector<datasets::StampedPose>& truth,
                           const std::vector<datasets::StampedPose>& estimate,
                           AlignmentKind alignment = AlignmentKind::kSe3) {
  TrajectoryConfig options;
  options.alignment = alignment;
  options.rpe_delta_frames = 5;
  return EvaluateTrajectory(truth, estimate, options);
}

TEST(Association, TakesEachStampOnceAndTheNearestFirst) {
  using Pairs = std::vector<std::string>;
  EXPECT_EQ(PairsOf({1.000, 1.010}, {1.008}), Pairs({"1010-1008"}));
  EXPECT_EQ(PairsOf({1.000}, {0.995, 1.004}), Pairs({"1000-1004"}));
  // 1010 has taken 1009, what is left to 1000 is farther.
  EXPECT_EQ(PairsOf({1.000, 1.010}, {0.985, 1.009}), Pairs({"1000-985", "1010-1009"}));
  EXPECT_EQ(PairsOf({1.000, 1.001, 1.002}, {1.001, 1.003}), Pairs({"1001-1001", "1002-1003"}));
  // Equally near: the earlier ones.
  EXPECT_EQ(PairsOf({1.000, 1.010}, {1.005}), Pairs({"1000-1005"}));
  EXPECT_EQ(PairsOf({1.005}, {1.000, 1.010}), Pairs({"1005-1000"}));
}

TEST(Association, TakesNoPairAsFarAsTheMaximumAndAddsTheOffsetToTheEstimate) {
  using Pairs = std::vector<std::string>;
  EXPECT_EQ(PairsOf({1.000, 2.000}, {1.020, 2.019}), Pairs({"2000-2019"}));
  EXPECT_EQ(PairsOf({1.000, 2.000}, {1.020, 2.019}, {0.021, 0}), Pairs({"1000-1020", "2000-2019"}));
  EXPECT_EQ(PairsOf({5.000}, {2.000, 5.000}, {0.02, 3}), Pairs({"5000-2000"}));
  EXPECT_TRUE(PairsOf({}, {1}).empty());
  EXPECT_TRUE(PairsOf({1}, {}).empty());
}

TEST(TrajectoryFigures, AreZeroForTheTruthItself) {
  const auto drive = Drive(2000);
  for (const AlignmentKind kind :
       {AlignmentKind::kNone, AlignmentKind::kSe3, AlignmentKind::kSim3, AlignmentKind::kOrigin}) {
    const TrajectoryFigures figures = Evaluate(drive, drive, kind);
    EXPECT_EQ(figures.pairs, 2000U);
    EXPECT_NEAR(figures.duration_s, 199.9, 1e-9);
    EXPECT_NEAR(figures.scale, 1, 1e-9);
    EXPECT_LT(figures.ate_m.max, 1e-9);
    EXPECT_LT(figures.rpe_m.max, 1e-9);
    EXPECT_LT(figures.rpe_rad.max, 1e-9);
    EXPECT_LT(figures.rpe_frames_m.max, 1e-9);
    ASSERT_TRUE(figures.kitti);
    EXPECT_LT(figures.kitti->translation_percent, 1e-9);
    EXPECT_LT(figures.kitti->rotation_rad_per_m, 1e-9);
  }
}

TEST(TrajectoryFigures, DoNotDependOnWhereTheEstimatesWorldLies) {
  const auto drive = Drive(300);
  const auto moved = Moved(drive, Turned(2.5, {1, -2, 0.5}, {100, -50, 7}));
  for (const AlignmentKind kind : {AlignmentKind::kSe3, AlignmentKind::kOrigin}) {
    EXPECT_LT(Evaluate(drive, moved, kind).ate_m.max, 1e-9);
  }
  const TrajectoryFigures unaligned = Evaluate(drive, moved, AlignmentKind::kNone);
  EXPECT_GT(unaligned.ate_m.min, 10);
  EXPECT_LT(unaligned.rpe_m.max, 1e-9);
  EXPECT_LT(unaligned.rpe_rad.max, 1e-9);
}

TEST(TrajectoryFigures, AlignmentNeverMirrors) {
  const auto drive = Drive(300);
  auto mirrored = drive;
  for (datasets::StampedPose& pose : mirrored) pose.world_from_camera.translation().x() *= -1;
  EXPECT_GT(Evaluate(drive, mirrored).ate_m.rmse, 0.1);
}

TEST(TrajectoryFigures, ScaleIsFoundAndAppliedToRelativeErrors) {
  const auto drive = Drive(2000);
  const auto small = Resized(Moved(drive, Turned(1, {0, 0, 1}, {3, 0, 0})), 0.25);
  const TrajectoryFigures scaled = Evaluate(drive, small, AlignmentKind::kSim3);
  EXPECT_NEAR(scaled.scale, 4, 1e-9);
  EXPECT_LT(scaled.ate_m.max, 1e-9);
  EXPECT_LT(scaled.rpe_m.max, 1e-9);
  EXPECT_LT(scaled.kitti->translation_percent, 1e-9);
  EXPECT_GT(Evaluate(drive, small).ate_m.rmse, 1);
  EXPECT_NEAR(Evaluate(drive, small).scale, 1, 0);
}

TEST(TrajectoryFigures, OfAConstantDriftAreItsRates) {
  const TrajectoryFigures figures =
      Evaluate(Straight(3001, 1), Straight(3001, 1.03, 0.02), AlignmentKind::kNone);
  // At 0.1 s per pose the last 10 poses have no partner, nor those whose partner is the last.
  EXPECT_EQ(figures.rpe_m.n, 2990U);
  EXPECT_NEAR(figures.rpe_m.rmse, 0.03, 1e-9);
  EXPECT_NEAR(figures.rpe_m.median, 0.03, 1e-9);
  EXPECT_NEAR(figures.rpe_rad.rmse, 0.02, 1e-9);
  EXPECT_EQ(figures.rpe_frames_m.n, 2995U);
  EXPECT_NEAR(figures.rpe_frames_m.rmse, 0.015, 1e-9);
  EXPECT_NEAR(figures.rpe_frames_rad.max, 0.01, 1e-9);
  // The error grows from 0 to 0.03 * 300 m.
  EXPECT_NEAR(figures.ate_m.mean, 4.5, 1e-9);
  EXPECT_NEAR(figures.ate_m.median, 4.5, 1e-9);
  EXPECT_NEAR(figures.ate_m.max, 9, 1e-9);
  EXPECT_NEAR(figures.ate_m.rmse, 9 / std::sqrt(3), 1e-2);
  EXPECT_NEAR(figures.length_m, 300, 1e-9);
}

TEST(TrajectoryFigures, RelativeErrorsPerSecondAreThoseOfTheDeltaDividedByIt) {
  TrajectoryConfig options;
  options.rpe_delta_s = 4;
  const auto json =
      ToJson(EvaluateTrajectory(Straight(300, 1), Straight(300, 1.03, 0.02), options));
  EXPECT_NEAR(json["rpe_rmse_m_per_s"], 0.03, 1e-9);
  EXPECT_NEAR(json["rpe_median_deg_per_s"], 0.02 * 180 / kPi, 1e-9);
  EXPECT_EQ(json["rpe_delta_s"], 4.0);
}

TEST(TrajectoryFigures, KittiSegmentsAreMeasuredPerTravelledMetre) {
  const TrajectoryFigures figures = Evaluate(Straight(2501, 1), Straight(2501, 1.02, 0.001));
  ASSERT_TRUE(figures.kitti);
  // A segment ends at the first pose beyond its length: a 0.1 m longer motion.
  EXPECT_NEAR(figures.kitti->translation_percent, 2, 0.01);
  EXPECT_NEAR(figures.kitti->rotation_rad_per_m, 0.001, 1e-6);
  // From every 10th pose: 100 m from 0 .. 149 m on, 200 m from 0 .. 49 m on.
  EXPECT_EQ(figures.kitti->n, 150U + 50U);
}

TEST(TrajectoryFigures, HaveNoKittiErrorsOnAPathOfUpTo100M) {
  EXPECT_FALSE(Evaluate(Straight(990, 1), Straight(990, 1)).kitti);
  const auto json = ToJson(Evaluate(Straight(990, 1), Straight(990, 1)));
  EXPECT_TRUE(json["kitti_translation_percent"].is_null());
  EXPECT_TRUE(json["kitti_rotation_deg_per_100m"].is_null());
  EXPECT_FALSE(json.contains("scale"));
}

TEST(TrajectoryFigures, ThatAreMissingHaveTheSameKeysAndAllNull) {
  const auto measured = ToJson(EvaluateTrajectory(Drive(20), Drive(20), {}));
  const auto missing = NullFigures();
  ASSERT_EQ(missing.size(), measured.size());
  for (const auto& [key, value] : measured.items()) {
    EXPECT_TRUE(missing.contains(key) && missing[key].is_null()) << key;
  }
}

TEST(TrajectoryFigures, GapsOfTheEstimateAreToldAndOfTheTruthLeftOut) {
  const auto drive = Drive(300);
  auto with_gap = drive;
  with_gap.erase(with_gap.begin() + 100, with_gap.begin() + 150);
  const TrajectoryFigures lost = Evaluate(drive, with_gap);
  EXPECT_EQ(lost.pairs, 250U);
  EXPECT_NEAR(lost.longest_gap_s, 5.1, 1e-9);
  EXPECT_NEAR(lost.duration_s, 29.9, 1e-9);
  EXPECT_LT(lost.rpe_m.max, 1e-9);

  const TrajectoryFigures unknown = Evaluate(with_gap, drive);
  EXPECT_EQ(unknown.pairs, 250U);
  // Two true intervals from a true pose are tolerated: 102..147 have none, neither as the first of
  // two poses nor as the second.
  EXPECT_EQ(unknown.rpe_m.n, 289U - 56U);
}

TEST(TrajectoryFigures, WithoutTwoPairsAreRefusedWithTheSpansOfBoth) {
  const auto drive = Drive(20);
  auto later = drive;
  for (datasets::StampedPose& pose : later) pose.stamp_ns += Ns(1000);
  EXPECT_THAT([&] { Evaluate(drive, later); },
              ThrowsMessage<Error>(HasSubstr("0 of the 20 estimated poses have a true pose nearer "
                                             "than 0.02 s")));
  EXPECT_THAT([&] { Evaluate(drive, later); }, ThrowsMessage<Error>(HasSubstr("1100.000 to")));
  EXPECT_THROW(Evaluate({}, drive), Error);
  TrajectoryConfig options;
  options.association.offset_s = -1000;
  EXPECT_LT(EvaluateTrajectory(drive, later, options).ate_m.max, 1e-9);
}

TEST(TrajectoryFigures, ScaleOfAnEstimateThatStandsStillIsRefused) {
  const auto still = Resized(Drive(20), 0);
  EXPECT_THAT([&] { Evaluate(Drive(20), still, AlignmentKind::kSim3); },
              ThrowsMessage<Error>(HasSubstr("does not move")));
  EXPECT_GT(Evaluate(Drive(20), still).ate_m.rmse, 0);
}

TEST(TrajectoryFigures, OfPosesFartherApartThanTwiceTheDeltaHaveNoRelativeError) {
  std::vector<datasets::StampedPose> sparse;
  for (std::size_t i = 0; i < 300; i += 50) sparse.push_back(Drive(300, 2)[i]);
  const TrajectoryFigures figures = EvaluateTrajectory(Drive(300), sparse, {});
  EXPECT_EQ(figures.pairs, 6U);
  EXPECT_GT(figures.ate_m.rmse, 0);
  EXPECT_EQ(figures.rpe_m.n, 0U) << "a pose against itself is no measurement";
  EXPECT_TRUE(ToJson(figures)["rpe_rmse_m_per_s"].is_null());
}

TEST(TrajectoryFigures, HaveNoScaleAgainstATruthThatStands) {
  TrajectoryConfig options;
  options.alignment = AlignmentKind::kSim3;
  for (const double place_m : {0.0, 5.0e5}) {
    std::vector<datasets::StampedPose> still = Drive(20);
    for (datasets::StampedPose& pose : still) {
      pose.world_from_camera = Eigen::Translation3d(place_m + 0.1, -place_m, 0.3);
    }
    EXPECT_THAT([&] { EvaluateTrajectory(still, Drive(20), options); },
                ThrowsMessage<Error>(HasSubstr("the truth does not move")));
    EXPECT_THAT([&] { EvaluateTrajectory(Drive(20), still, options); },
                ThrowsMessage<Error>(HasSubstr("the estimate does not move")));
  }
}

TEST(TrajectoryFigures, HaveNoScaleFromTwoPairsOnWhichAnythingFits) {
  TrajectoryConfig options;
  options.alignment = AlignmentKind::kSim3;
  EXPECT_THAT([&] { EvaluateTrajectory(Drive(2), Straight(1500, 7), options); },
              ThrowsMessage<Error>(HasSubstr("2 pairs of poses, on which any estimate fits")));
  EXPECT_NO_THROW(EvaluateTrajectory(Drive(3), Straight(1500, 7), options));
}

TEST(TrajectoryFigures, HaveNoScaleWithoutMotionInCommon) {
  TrajectoryConfig options;
  options.alignment = AlignmentKind::kSim3;
  std::vector<datasets::StampedPose> truth = Straight(4, 0);
  std::vector<datasets::StampedPose> estimate = truth;
  for (std::size_t i = 0; i < 4; ++i) {
    truth[i].world_from_camera.translation().x() = i < 2 ? 1 : -1;
    estimate[i].world_from_camera.translation().y() = i % 2 == 0 ? 1 : -1;
  }
  EXPECT_THAT([&] { EvaluateTrajectory(truth, estimate, options); },
              ThrowsMessage<Error>(HasSubstr("no motion in common")));
}

TEST(TrajectoryFigures, OfTrajectoriesWithoutCommonTimeAreNotMeasured) {
  EXPECT_THROW(EvaluateTrajectory(Drive(20), Straight(20, 1), {}), NothingMeasured);
}

TEST(TrajectoryFigures, AreNullWhereNoTwoPosesAreADeltaApart) {
  TrajectoryConfig options;
  options.rpe_delta_s = 60;
  const TrajectoryFigures figures = EvaluateTrajectory(Drive(20), Drive(20), options);
  EXPECT_EQ(figures.rpe_m.n, 0U);
  EXPECT_TRUE(ToJson(figures)["rpe_rmse_m_per_s"].is_null());
  EXPECT_THAT(ToText(figures), HasSubstr("no two poses are that far apart"));
}

TEST(ErrorFigures, MedianOfAnEvenNumberIsTheMeanOfTheMiddleTwo) {
  const ErrorFigures figures = Summarise({4, 1, 3, 2});
  EXPECT_DOUBLE_EQ(figures.median, 2.5);
  EXPECT_DOUBLE_EQ(figures.mean, 2.5);
  EXPECT_DOUBLE_EQ(figures.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(figures.std, std::sqrt(1.25));
  EXPECT_DOUBLE_EQ(Summarise({3, 1, 2}).median, 2);
  EXPECT_EQ(Summarise({}).n, 0U);
}

/// The published trajectories, with the figures that the benchmarks' own scripts give for them.
class PublishedTrajectories : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* set = std::getenv("LIVEMAP_DATA_DIR");
    folder_ = (set != nullptr ? set : std::string(LIVEMAP_SOURCE_DIR) + "/../shared/data") +
              "/trajectories/";
    if (!std::filesystem::is_directory(folder_)) GTEST_SKIP() << "skipped, no data";
  }
  TrajectoryFigures EvaluateFiles(const std::string& truth, const std::string& estimate) const {
    return Evaluate(ReadTrajectory(folder_ + truth, 10), ReadTrajectory(folder_ + estimate, 10));
  }

  std::string folder_;
};

TEST_F(PublishedTrajectories, OfTumHaveTheFiguresOfTheBenchmarksScripts) {
  const auto figures = EvaluateFiles("freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-rgbdslam.txt");
  EXPECT_EQ(figures.pairs, 786U);
  EXPECT_NEAR(figures.ate_m.rmse, 0.013473, 5e-7);
  EXPECT_NEAR(figures.ate_m.mean, 0.012029, 5e-7);
  EXPECT_NEAR(figures.ate_m.median, 0.011176, 5e-7);
  EXPECT_NEAR(figures.ate_m.std, 0.006068, 5e-7);
  EXPECT_NEAR(figures.ate_m.min, 0.000939, 5e-7);
  EXPECT_NEAR(figures.ate_m.max, 0.034727, 5e-7);
  EXPECT_NEAR(figures.rpe_m.rmse, 0.021217, 5e-7);
  EXPECT_NEAR(figures.rpe_m.mean, 0.019524, 5e-7);
  EXPECT_NEAR(figures.rpe_m.median, 0.019309, 5e-7);
  EXPECT_NEAR(figures.rpe_m.max, 0.048152, 5e-7);
  EXPECT_NEAR(figures.rpe_rad.rmse * 180 / kPi, 0.934480, 5e-7);
  EXPECT_NEAR(figures.rpe_rad.mean * 180 / kPi, 0.841472, 5e-7);
  EXPECT_FALSE(figures.kitti);
}

TEST_F(PublishedTrajectories, OfKittiHaveTheStatedFigures) {
  const auto figures = EvaluateFiles("KITTI_00_gt.txt", "KITTI_00_ORB.txt");
  EXPECT_EQ(figures.pairs, 4541U);
  EXPECT_NEAR(figures.ate_m.rmse, 1.3034497145650266, 1e-10);
  EXPECT_NEAR(figures.ate_m.mean, 1.1569971285389768, 1e-10);
  EXPECT_NEAR(figures.ate_m.median, 1.065624769555848, 1e-10);
  EXPECT_NEAR(figures.ate_m.max, 3.587949120678954, 1e-10);
  ASSERT_TRUE(figures.kitti);
  // The devkit's definition computed on its own in double precision.
  EXPECT_EQ(figures.kitti->n, 3283U);
  EXPECT_NEAR(figures.kitti->translation_percent, 0.69973, 1e-5);
  EXPECT_NEAR(figures.kitti->rotation_rad_per_m * 100 * 180 / kPi, 0.25333, 2e-5);
}

}  // namespace
}  // namespace livemap::evaluation
