#include "odometry/monocular/inverse_depth_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "odometry/edge/edge_extractor.h"
#include "odometry/monocular/epipolar_search.h"
#include "test/odometry/synthetic_scene.h"

namespace livemap::odometry {
namespace {

struct TwoViews {
  RgbdFrame keyframe, other;
  Eigen::Isometry3d other_from_keyframe;
};

/// The patterned wall, two metres away, from two places.
TwoViews SeeWall(const Eigen::Isometry3d& keyframe_from_other, double gain = 1, double bias = 0) {
  const SyntheticWall wall(kWallCamera);
  return {wall.See(0, Eigen::Isometry3d::Identity()), wall.See(1, keyframe_from_other, gain, bias),
          keyframe_from_other.inverse()};
}

TEST(EpipolarSearch, FindsTheDepthsOfAWallSidewaysAndForward) {
  for (const Eigen::Isometry3d& motion :
       {Pose(0.08, 0, 0, 0, 0, 0), Pose(0.03, 0.05, 0.1, 0.01, -0.02, 0.03)}) {
    const TwoViews views = SeeWall(motion);
    const EpipolarSearch search(views.keyframe.grey, views.other.grey, kWallCamera,
                                views.other_from_keyframe, {});
    int found = 0, right = 0, within_sigmas = 0;
    for (int v = 10; v < 230; v += 4) {
      for (int u = 10; u < 310; u += 4) {
        const auto match = search.Find(u, v, 0.3F, 0.8F, true);
        if (!match) continue;
        ++found;
        const float error = match->inverse_depth - 1 / views.keyframe.depth.at<float>(v, u);
        right += std::abs(error) < 0.02F ? 1 : 0;
        within_sigmas += error * error < 9 * match->variance ? 1 : 0;
      }
    }
    EXPECT_GT(found, 500);
    EXPECT_GT(right, 0.97 * found);
    EXPECT_GT(within_sigmas, 0.95 * found);
  }
}

TEST(EpipolarSearch, DoesNotMindADifferenceOfBrightness) {
  const TwoViews views = SeeWall(Pose(0.08, 0, 0, 0, 0, 0), 1, 20);
  const EpipolarSearch search(views.keyframe.grey, views.other.grey, kWallCamera,
                              views.other_from_keyframe, {});
  int found = 0;
  for (int u = 20; u < 300; u += 5) found += search.Find(u, 120, 0.3F, 0.8F, true) ? 1 : 0;
  EXPECT_GT(found, 10);
}

/// Bars of a period, seen again a little to the left.
cv::Mat Bars(double period_px, double shift_px, bool vertical) {
  cv::Mat image(kWallCamera.height, kWallCamera.width, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const double at = vertical ? u + shift_px : v;
      image.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(128 + 100 * std::sin(2 * M_PI * at / period_px));
    }
  }
  return image;
}

TEST(EpipolarSearch, RefusesWhatLooksAlikeInTwoPlaces) {
  const cv::Mat bars = Bars(12, 0, true), moved = Bars(12, 3, true);
  const EpipolarSearch search(bars, moved, kWallCamera, Pose(-0.1, 0, 0, 0, 0, 0), {});
  // 26 px long: two periods.
  EXPECT_FALSE(search.Find(160, 120, 0.1F, 1.1F, true));
  // Among known depths within half a period there is one.
  EXPECT_TRUE(search.Find(160, 120, 0.05F, 0.2F, false));
}

TEST(EpipolarSearch, RefusesEdgesAlongTheLineAndMotionWithoutTranslation) {
  const cv::Mat level = Bars(12, 0, false), upright = Bars(12, 0, true);
  const Eigen::Isometry3d sideways = Pose(-0.1, 0, 0, 0, 0, 0);
  const Eigen::Isometry3d standing = Eigen::Isometry3d::Identity();
  EXPECT_FALSE(
      EpipolarSearch(level, level, kWallCamera, sideways, {}).Find(160, 120, 0.1F, 1, false));
  EXPECT_FALSE(
      EpipolarSearch(upright, upright, kWallCamera, standing, {}).Find(160, 120, 0.1F, 1, false));
}

InverseDepthMap::Config NearRange() {
  InverseDepthMap::Config config;
  config.min_depth_m = 0.5F;
  config.max_depth_m = 10.0F;
  return config;
}

struct Quality {
  std::size_t known = 0;
  double share_right = 0;  // Within 3 %.
};

Quality Compare(const InverseDepthMap& map, const cv::Mat& depth_m) {
  Quality quality;
  std::size_t right = 0;
  for (const EdgeDepth& edge : map.edges()) {
    if (!edge.known) continue;
    ++quality.known;
    right += std::abs(edge.inverse_depth * depth_m.at<float>(edge.v, edge.u) - 1) < 0.03F ? 1U : 0U;
  }
  quality.share_right = static_cast<double>(right) / static_cast<double>(quality.known);
  return quality;
}

TEST(InverseDepthMap, LearnsDepthsAndTakesThemAlongToTheNextKeyframe) {
  const TwoViews views = SeeWall(Pose(0.06, 0.02, 0.03, 0, 0, 0));
  EdgeExtractor extractor({});
  InverseDepthMap map(NearRange(), kWallCamera);
  map.MoveTo(extractor.Extract(views.keyframe.grey), Eigen::Isometry3d::Identity());
  EXPECT_EQ(map.CountKnown(), 0U);
  map.Measure(views.keyframe.grey, views.other.grey, views.other_from_keyframe, true);
  map.Regularise();
  const Quality here = Compare(map, views.keyframe.depth);
  EXPECT_GT(here.known, 500U);
  EXPECT_GT(here.share_right, 0.95);

  map.MoveTo(extractor.Extract(views.other.grey), views.other_from_keyframe);
  const Quality there = Compare(map, views.other.depth);
  EXPECT_GT(there.known, here.known / 2);
  EXPECT_GT(there.share_right, 0.95);
}

TEST(InverseDepthMap, MoreViewsMakeDepthsMoreCertain) {
  const TwoViews views = SeeWall(Pose(0.04, 0, 0, 0, 0, 0));
  const TwoViews farther = SeeWall(Pose(0.12, 0, 0, 0, 0, 0));
  EdgeExtractor extractor({});
  InverseDepthMap map(NearRange(), kWallCamera);
  map.MoveTo(extractor.Extract(views.keyframe.grey), Eigen::Isometry3d::Identity());
  map.Measure(views.keyframe.grey, views.other.grey, views.other_from_keyframe, true);
  const auto mean_sigma = [&] {
    double sum = 0;
    for (const EdgeDepth& edge : map.edges()) {
      if (edge.known) sum += std::sqrt(static_cast<double>(edge.variance));
    }
    return sum / static_cast<double>(map.CountKnown());
  };
  const double before = mean_sigma();
  map.Measure(views.keyframe.grey, farther.other.grey, farther.other_from_keyframe, false);
  EXPECT_LT(mean_sigma(), 0.6 * before);
}

TEST(InverseDepthMap, ForgetsDepthsThatTheNextViewsContradict) {
  const TwoViews views = SeeWall(Pose(0.08, 0, 0, 0, 0, 0));
  EdgeExtractor extractor({});
  InverseDepthMap map(NearRange(), kWallCamera);
  map.MoveTo(extractor.Extract(views.keyframe.grey), Eigen::Isometry3d::Identity());
  // The wrong baseline: depths three quarters of the true ones.
  map.Measure(views.keyframe.grey, views.other.grey, Pose(-0.06, 0, 0, 0, 0, 0), true);
  const std::size_t wrong = map.CountKnown();
  for (int i = 0; i < 3; ++i) {
    map.Measure(views.keyframe.grey, views.other.grey, views.other_from_keyframe, false);
  }
  EXPECT_LT(map.CountKnown(), wrong);
  const cv::Mat& depth_m = map.DepthImage();
  const cv::Mat& sigma = map.SigmaImage();
  for (const EdgeDepth& edge : map.edges()) {
    const float depth = depth_m.at<float>(edge.v, edge.u);
    EXPECT_EQ(depth > 0, sigma.at<float>(edge.v, edge.u) > 0);
  }
}

}  // namespace
}  // namespace livemap::odometry
