#include "odometry/edge/aligner.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

#include "odometry/edge/edge_extractor.h"
#include "test/odometry/synthetic_scene.h"

namespace livemap::odometry {
namespace {

const cv::Mat kExact;  // No uncertainty of the depths.

EdgePoints PointsOf(const RgbdFrame& frame) {
  EdgeExtractor extractor({});
  PointSelector selector;
  EdgePoints points;
  selector.Select({frame.grey, frame.depth, kExact}, extractor.Extract(frame.grey), kWallCamera, {},
                  points);
  return points;
}

TEST(EdgePoints, JacobianIsTheDerivativeOfTheGreyValueByTheTwist) {
  // An image whose grey value is linear in u and v: its gradient is exact everywhere.
  const double slope_u = 0.7, slope_v = -0.4;
  const Eigen::Vector3d point(0.31, -0.22, 1.7);
  const auto grey_of = [&](const Eigen::Vector3d& p) {
    return slope_u * (kWallCamera.fx * p.x() / p.z() + kWallCamera.cx) +
           slope_v * (kWallCamera.fy * p.y() / p.z() + kWallCamera.cy);
  };
  EdgePoints points;
  points.Add(static_cast<float>(kWallCamera.fx * point.x() / point.z() + kWallCamera.cx),
             static_cast<float>(kWallCamera.fy * point.y() / point.z() + kWallCamera.cy),
             static_cast<float>(point.z()), 0, static_cast<float>(slope_u),
             static_cast<float>(slope_v), kWallCamera);
  for (int i = 0; i < 6; ++i) {
    const double step = 1e-5;
    Vector6d twist = Vector6d::Zero();
    twist[i] = step;
    const double numeric =
        (grey_of(Se3Exp(twist) * point) - grey_of(Se3Exp(-twist) * point)) / (2 * step);
    EXPECT_NEAR(points.jacobian[static_cast<std::size_t>(i)][0], numeric,
                1e-4 * std::abs(numeric) + 1e-3)
        << "component " << i;
  }
}

TEST(PointSelector, AStepInDepthGivesItsEdgeToTheNearerSide) {
  cv::Mat grey(240, 320, CV_8UC1, cv::Scalar(60));
  grey.colRange(160, 320).setTo(200);
  cv::GaussianBlur(grey, grey, {3, 3}, 0);
  cv::Mat depth(240, 320, CV_32FC1, cv::Scalar(1));
  depth.colRange(160, 320).setTo(3);
  cv::Mat mask = cv::Mat::zeros(240, 320, CV_8UC1);
  mask.colRange(158, 162).setTo(255);
  PointSelector selector;
  EdgePoints points;
  selector.Select({grey, depth, kExact}, mask, kWallCamera, {}, points);
  ASSERT_GT(points.size(), 100U);
  for (const float z : points.z) EXPECT_EQ(z, 1);
}

TEST(PointSelector, PointsOfOneLineFollowEachOther) {
  cv::Mat grey(240, 320, CV_8UC1, cv::Scalar(60));
  cv::Mat mask = cv::Mat::zeros(240, 320, CV_8UC1);
  for (const int column : {40, 120, 200, 280}) {
    cv::line(grey, {column, 0}, {column, 239}, cv::Scalar(200), 3);
    mask.col(column - 2).setTo(255);
  }
  const cv::Mat depth(240, 320, CV_32FC1, cv::Scalar(1));
  PointSelector selector;
  EdgePoints points;
  selector.Select({grey, depth, kExact}, mask, kWallCamera, {}, points);
  ASSERT_GT(points.size(), 800U);
  int changes = 0;
  for (std::size_t i = 1; i < points.size(); ++i) changes += points.x[i] != points.x[i - 1] ? 1 : 0;
  EXPECT_EQ(changes, 3) << "of a line to the next";
}

TEST(PointSelector, ThinsEvenlyToTheAllowedNumber) {
  const RgbdFrame frame = SyntheticWall(kWallCamera).See(1, Eigen::Isometry3d::Identity());
  const cv::Mat all(frame.grey.size(), CV_8UC1, cv::Scalar(255));
  PointSelection selection;
  selection.max_points = 1000;
  selection.min_gradient = 0;
  PointSelector selector;
  EdgePoints points;
  selector.Select({frame.grey, frame.depth, kExact}, all, kWallCamera, selection, points);
  ASSERT_EQ(points.size(), 1000U);
  std::size_t upper = 0;
  for (const float y : points.y) upper += y < 0 ? 1U : 0U;
  EXPECT_NEAR(static_cast<double>(upper), 500, 60);
}

TEST(PointSelector, AFewEdgesAcrossManyStripesAreAllKept) {
  cv::Mat grey(240, 320, CV_8UC1);
  for (int x = 0; x < grey.cols; ++x) grey.col(x).setTo(x / 8 % 2 == 0 ? 60 : 190);
  grey.rowRange(120, 160).colRange(100, 160).setTo(20);
  const cv::Mat depth(grey.size(), CV_32FC1, cv::Scalar(2)),
      all(grey.size(), CV_8UC1, cv::Scalar(1));
  PointSelection selection;
  selection.max_points = 2000;
  const auto count_across = [&](std::size_t most) {
    selection.max_points = most;
    PointSelector selector;
    EdgePoints points;
    selector.Select({grey, depth, kExact}, all, kWallCamera, selection, points);
    EXPECT_LE(points.size(), most);
    std::size_t across = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      across += std::abs(points.jacobian[1][i]) > 3 * std::abs(points.jacobian[0][i]) ? 1U : 0U;
    }
    return across;
  };
  const std::size_t there = count_across(1000000);
  ASSERT_GT(there, 50U);
  EXPECT_EQ(count_across(20000), there);
}

/// The wall under its edges, chosen as asked.
EdgePoints PointsChosen(PixelChoice choice, double share, std::uint32_t seed,
                        std::size_t max_points = 100000) {
  const RgbdFrame frame = SyntheticWall(kWallCamera).See(1, Eigen::Isometry3d::Identity());
  EdgeExtractor extractor({});
  PointSelection selection;
  selection.max_points = max_points;
  selection.choice = choice;
  selection.share = share;
  PointSelector selector(seed);
  EdgePoints points;
  selector.Select({frame.grey, frame.depth, kExact}, extractor.Extract(frame.grey), kWallCamera,
                  selection, points);
  return points;
}

double MeanGradient(const EdgePoints& points) {
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    sum += std::hypot(points.jacobian[0][i], points.jacobian[1][i]) * points.z[i] / kWallCamera.fx;
  }
  return sum / static_cast<double>(points.size());
}

TEST(PointSelector, RandomPixelsAreAsManyAsRandomEdgesButFlatter) {
  const EdgePoints all = PointsChosen(PixelChoice::kEdges, 1, 1);
  for (const double share : {0.05, 0.5, 1.0}) {
    const EdgePoints edges = PointsChosen(PixelChoice::kRandomEdges, share, 1);
    const EdgePoints pixels = PointsChosen(PixelChoice::kRandomPixels, share, 1);
    EXPECT_NEAR(static_cast<double>(edges.size()), share * static_cast<double>(all.size()), 1);
    EXPECT_EQ(edges.size(), pixels.size());
    EXPECT_GT(MeanGradient(edges), 1.5 * MeanGradient(pixels)) << share;
  }
}

TEST(PointSelector, TheSeedDecidesWhichPixelsAreDrawn) {
  const EdgePoints first = PointsChosen(PixelChoice::kRandomPixels, 0.2, 7);
  EXPECT_EQ(first.x, PointsChosen(PixelChoice::kRandomPixels, 0.2, 7).x);
  EXPECT_NE(first.x, PointsChosen(PixelChoice::kRandomPixels, 0.2, 8).x);
}

TEST(PointSelector, NoPixelIsDrawnTwiceAndNoMoreThanThereAre) {
  const EdgePoints all = PointsChosen(PixelChoice::kRandomPixels, 1000, 1);
  EXPECT_EQ(all.size(), (320U - 4) * (240U - 4)) << "but for the border, the wall is everywhere";
  EdgePoints most = PointsChosen(PixelChoice::kRandomPixels, 1000, 1, 60000);
  ASSERT_EQ(most.size(), 60000U);
  std::set<std::pair<float, float>> places;
  for (std::size_t i = 0; i < most.size(); ++i) places.emplace(most.x[i], most.y[i]);
  EXPECT_EQ(places.size(), most.size());
}

class AlignerMotion : public ::testing::TestWithParam<Eigen::Isometry3d> {};

TEST_P(AlignerMotion, IsFoundFromStandstill) {
  const SyntheticWall wall(kWallCamera);
  const RgbdFrame reference = wall.See(1, Eigen::Isometry3d::Identity());
  const RgbdFrame moved = wall.See(2, GetParam());
  Aligner aligner({});
  const AlignmentResult result = aligner.Align(PointsOf(reference), moved.grey, kWallCamera, {});
  const Vector6d error = Se3Log(result.state.new_from_reference * GetParam());
  EXPECT_LT(error.head<3>().norm(), 1e-3) << "m";
  EXPECT_LT(error.tail<3>().norm(), 5e-4) << "rad";
  EXPECT_GT(result.Overlap(), 0.9);
}

INSTANTIATE_TEST_SUITE_P(Small, AlignerMotion,
                         ::testing::Values(Pose(0.01, 0, 0, 0, 0, 0), Pose(0, -0.01, 0, 0, 0, 0),
                                           Pose(0, 0, 0.03, 0, 0, 0), Pose(0, 0, 0, 0.005, 0, 0),
                                           Pose(0, 0, 0, 0, -0.005, 0), Pose(0, 0, 0, 0, 0, 0.02),
                                           Pose(0.006, -0.004, 0.01, 0.002, 0.003, -0.01)));

TEST(Aligner, GainAndBiasAreFoundAndDoNotMoveThePose) {
  const SyntheticWall wall(kWallCamera);
  const Eigen::Isometry3d motion = Pose(0.008, 0.003, -0.01, 0.002, -0.002, 0.004);
  const RgbdFrame reference = wall.See(1, Eigen::Isometry3d::Identity());
  const RgbdFrame moved = wall.See(2, motion, 0.7, 25);
  Aligner aligner({});
  const AlignmentResult result = aligner.Align(PointsOf(reference), moved.grey, kWallCamera, {});
  EXPECT_NEAR(result.state.gain, 0.7, 0.01);
  EXPECT_NEAR(result.state.bias, 25, 1.5);
  EXPECT_LT(Se3Log(result.state.new_from_reference * motion).norm(), 1e-3);
}

TEST(Aligner, LightThatFadesMakesNoNoiseOfAnEdge) {
  const SyntheticWall wall(kWallCamera);
  const EdgePoints points = PointsOf(wall.See(1, Eigen::Isometry3d::Identity()));
  const RgbdFrame elsewhere = wall.See(2, Pose(0.2, 0.1, 0, 0, 0, 0));
  Aligner aligner({});
  const auto explained = [&](double gain) {
    AlignmentState state;
    state.gain = gain;
    state.bias = (1 - gain) * 128;
    return static_cast<double>(
               aligner.ExplainedAt(points, elsewhere.grey, kWallCamera, state, kNoiseGrey)) /
           static_cast<double>(points.size());
  };
  // With the noise of full light four times as much of a false motion would be explained.
  EXPECT_LT(explained(0.3), 2.5 * explained(1));
}

/// A tenth of the rows are steep stripes that lie half a pixel beside where the gentle rest has
/// moved to, as rounded edges do: the turn's error, rad.
double ErrorBySteepEdges(double place_sigma_px, float inverse_depth_sigma) {
  const geo::CameraIntrinsics camera = {100, 100, 79.5, 59.5, 160, 120};
  const double turn = 0.02;  // 2 px.
  const auto picture = [](double gentle_px, double steep_px) {
    cv::Mat grey(120, 160, CV_8UC1);
    for (int v = 0; v < grey.rows; ++v) {
      for (int u = 0; u < grey.cols; ++u) {
        const bool steep = v % 10 == 0;
        const double phase = steep ? 2 * (u - steep_px) : 0.3 * (u - gentle_px) + 0.1 * v;
        grey.at<std::uint8_t>(v, u) =
            cv::saturate_cast<std::uint8_t>(128 + (steep ? 60 : 25) * std::sin(phase / 2));
      }
    }
    return grey;
  };
  EdgePoints points;
  PointSelector().SelectAll(picture(0, 0), camera, points);
  if (inverse_depth_sigma > 0)
    points.inverse_depth_sigma.assign(points.size(), inverse_depth_sigma);
  AlignmentConfig config;
  config.rotation_only = true;
  config.place_sigma_px = place_sigma_px;
  const AlignmentResult result = Aligner(config).Align(points, picture(2, 2.5), camera, {});
  return std::abs(Se3Log(result.state.new_from_reference)[4] - turn);
}

TEST(Aligner, SteepEdgesOfEstimatedDepthCountInFull) {
  EXPECT_EQ(ErrorBySteepEdges(0.3, 0.1F), ErrorBySteepEdges(0, 0.1F));
}

TEST(Aligner, AThirdOfForeignPixelsDoesNotMoveThePose) {
  const SyntheticWall wall(kWallCamera);
  const Eigen::Isometry3d motion = Pose(0.006, 0.002, 0, 0, 0, 0.004);
  const RgbdFrame reference = wall.See(1, Eigen::Isometry3d::Identity());
  RgbdFrame moved = wall.See(2, motion);
  moved.grey(cv::Rect(100, 60, 130, 130)).setTo(20);
  Aligner aligner({});
  const AlignmentResult result = aligner.Align(PointsOf(reference), moved.grey, kWallCamera, {});
  EXPECT_LT(Se3Log(result.state.new_from_reference * motion).norm(), 2e-3);
}

TEST(Aligner, NeverEndsWithAHigherCostThanItBeganWith) {
  const SyntheticWall wall(kWallCamera);
  const EdgePoints points = PointsOf(wall.See(1, Eigen::Isometry3d::Identity()));
  AlignmentConfig config;
  Aligner aligner(config);
  for (int i = 0; i < 12; ++i) {
    const double far = 0.02 * i;
    const cv::Mat grey = wall.See(2, Pose(far, -far, 0, 0, far, 0)).grey;
    const AlignmentResult result = aligner.Align(points, grey, kWallCamera, {});
    const double sigma = result.sigma;
    EXPECT_LE(aligner.CostAt(points, grey, kWallCamera, result.state, sigma),
              aligner.CostAt(points, grey, kWallCamera, {}, sigma) * 1.0001)
        << far;
  }
}

TEST(Aligner, InformationIsTheInverseOfTheScatterOverManyNoisyImages) {
  const SyntheticWall wall(kWallCamera);
  const Eigen::Isometry3d motion = Pose(0.004, 0.002, 0.003, 0.001, -0.001, 0.002);
  RgbdFrame reference = wall.See(1, Eigen::Isometry3d::Identity());
  const cv::Mat clean = wall.See(2, motion).grey;
  const EdgePoints points = PointsOf(reference);
  cv::RNG random(7);
  AlignmentConfig config;
  config.place_sigma_px = 0;  // Only grey values err.
  Aligner aligner(config);
  double normalised = 0;
  const int images = 60;
  Vector6d mean = Vector6d::Zero();
  std::vector<Vector6d> errors;
  Matrix6d information;
  for (int i = 0; i < images; ++i) {
    cv::Mat noise(clean.size(), CV_16SC1), noisy;
    random.fill(noise, cv::RNG::NORMAL, 0, 8);
    cv::add(clean, noise, noisy, cv::noArray(), CV_8U);
    const AlignmentResult result = aligner.Align(points, noisy, kWallCamera, {});
    errors.push_back(Se3Log(motion * result.state.new_from_reference));
    mean += errors.back() / images;
    information = result.information / (result.sigma * result.sigma);
  }
  for (const Vector6d& error : errors) {
    normalised += (error - mean).dot(information * (error - mean)) / images;
  }
  // Six for honest covariances; bilinear interpolation halves the noise that the residuals show.
  EXPECT_GT(normalised, 2);
  EXPECT_LT(normalised, 12);
}

TEST(Aligner, StripesLeaveAMovementUnseenAndTheCovarianceSaysSo) {
  RgbdFrame stripes;
  stripes.grey.create(240, 320, CV_8UC1);
  for (int x = 0; x < 320; ++x) stripes.grey.col(x).setTo(x / 16 % 2 == 0 ? 60 : 190);
  cv::GaussianBlur(stripes.grey, stripes.grey, {3, 3}, 0);
  stripes.depth = cv::Mat(240, 320, CV_32FC1, cv::Scalar(2));
  cv::Mat noise(stripes.grey.size(), CV_16SC1), noisy;
  cv::RNG random(3);
  for (int i = 0; i < 20; ++i) {
    random.fill(noise, cv::RNG::NORMAL, 0, 4);
    cv::add(stripes.grey, noise, noisy, cv::noArray(), CV_8U);
    ASSERT_GT(PointsOf(stripes).size(), 100U);
    const AlignmentResult result = Aligner({}).Align(PointsOf(stripes), noisy, kWallCamera, {});
    const Eigen::SelfAdjointEigenSolver<Matrix6d> parts(result.covariance);
    EXPECT_GT(parts.eigenvalues().minCoeff(), 0) << result.covariance;
    // Up and down along the stripes by a hand's breadth at the least.
    EXPECT_GT(result.covariance(1, 1), 0.1 * 0.1);
  }
}

/// Stripes up and down in the image, wherever they are in space.
RgbdFrame StripesOnCorner(const Eigen::Isometry3d& world_from_camera) {
  const std::array<int, 3> greys = {60, 190, 110};
  RgbdFrame stripes;
  stripes.grey.create(240, 320, CV_8UC1);
  for (int x = 0; x < 320; ++x) {
    stripes.grey.col(x).setTo(greys[static_cast<std::size_t>(x / 16 % 3)]);
  }
  cv::GaussianBlur(stripes.grey, stripes.grey, {3, 3}, 0);
  stripes.depth = DepthOfCorner(world_from_camera);
  return stripes;
}

TEST(Aligner, SurfacesTellTheMovementThatStripesLeaveUnseen) {
  const RgbdFrame stripes = StripesOnCorner(Eigen::Isometry3d::Identity());
  SurfacePoints corner;
  corner.Take(stripes.depth, kWallCamera);
  for (const double gain : {1.0, 0.6}) {
    RgbdFrame lower = StripesOnCorner(Pose(0, 0.03, 0, 0, 0, 0));
    lower.grey *= gain;
    EdgePoints points = PointsOf(stripes);
    points.gradient_noise = 0.1;
    Aligner aligner({});
    const AlignmentResult by_edges = aligner.Align(points, lower.grey, kWallCamera, {});
    EXPECT_NEAR(by_edges.state.new_from_reference.translation().y(), 0, 1e-3);
    EXPECT_EQ(by_edges.surface_sigma, std::numeric_limits<double>::infinity());
    for (const std::size_t every : {std::size_t{1}, std::size_t{4}}) {
      const AlignmentResult result = aligner.Align(points, lower.grey, kWallCamera, {},
                                                   {&corner, {&lower, &kWallCamera, {}}}, every);
      const Eigen::Vector3d moved = result.state.new_from_reference.translation();
      EXPECT_LT((moved - Eigen::Vector3d(0, -0.03, 0)).norm(), 2e-3) << moved.transpose();
      EXPECT_LT(result.covariance(1, 1), 0.005 * 0.005);
      EXPECT_LT(result.surface_sigma, 0.02);
    }
  }
}

TEST(Aligner, AFewMeasurementsOfDepthDoNotMoveThePose) {
  const RgbdFrame frame = SyntheticWall(kWallCamera).See(1, Eigen::Isometry3d::Identity());
  SurfacePoints wall;
  wall.Take(frame.depth, kWallCamera);
  RgbdFrame sparse = frame;
  sparse.depth = cv::Mat::zeros(frame.depth.size(), CV_32FC1);
  cv::Mat few = sparse.depth(cv::Rect(150, 110, 12, 12));
  cv::Mat(frame.depth(cv::Rect(150, 110, 12, 12)) * 0.98).copyTo(few);
  const AlignmentResult result = Aligner({}).Align(PointsOf(frame), frame.grey, kWallCamera, {},
                                                   {&wall, {&sparse, &kWallCamera, {}}});
  EXPECT_LT(result.state.new_from_reference.translation().norm(), 1e-4);
  EXPECT_EQ(result.surface_sigma, std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace livemap::odometry
