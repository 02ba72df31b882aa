#include "odometry/monocular/metric_scale.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "odometry/monocular/road_height.h"

namespace livemap::odometry {
namespace {

TEST(MetricScale, IsUnknownBeforeAndMeasuredAfterTheFirstMeasurement) {
  MetricScale scale({});
  EXPECT_FALSE(scale.log_sigma());
  EXPECT_EQ(scale.metres_per_unit(), 1);
  scale.Measure(3, 0.03, 2);
  EXPECT_DOUBLE_EQ(scale.metres_per_unit(), 1.5);
  ASSERT_TRUE(scale.log_sigma());
}

TEST(MetricScale, AveragesNoiseAndFollowsAMapThatDrifts) {
  MetricScale scale({});
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.03);
  double truth = 2;
  double worst = 0;
  for (int i = 0; i < 300; ++i) {
    truth *= 1.002;
    scale.Drift();
    scale.Measure(truth * (1 + noise(random)), 0.03 * truth, 1);
    if (i > 20) worst = std::max(worst, std::abs(scale.metres_per_unit() / truth - 1));
  }
  EXPECT_LT(worst, 0.05);
}

TEST(MetricScale, RefusesAnOutlierButNotAChangeThatStays) {
  MetricScale scale({});
  for (int i = 0; i < 20; ++i) scale.Measure(1, 0.01, 1);
  scale.Measure(3, 0.03, 1);
  EXPECT_NEAR(scale.metres_per_unit(), 1, 1e-9);
  for (int i = 0; i < 10; ++i) scale.Measure(3, 0.03, 1);
  EXPECT_NEAR(scale.metres_per_unit(), 3, 0.1);
}

TEST(MetricScale, IgnoresWhatIsNotANumberOrNotPositive) {
  MetricScale scale({});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {nan, 0.0, -1.0, std::numeric_limits<double>::infinity()}) {
    scale.Measure(bad, 0.1, 1);
    scale.Measure(1, 0.1, bad);
  }
  scale.Measure(1, nan, 1);
  EXPECT_FALSE(scale.log_sigma());
}

constexpr geo::CameraIntrinsics kRoadCamera{500, 500, 319.5, 239.5, 640, 480};

/// Edges of a road under a camera that looks down a little, and as many of other things.
std::vector<EdgeDepth> RoadAndOtherThings(double height, double pitch_rad) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> u(100, 540), v(290, 470);
  std::uniform_real_distribution<float> other(0.02F, 0.5F);
  std::normal_distribution<double> noise(0, 0.01);
  std::vector<EdgeDepth> edges;
  for (int i = 0; i < 600; ++i) {
    EdgeDepth edge;
    edge.u = static_cast<std::int16_t>(u(random));
    edge.v = static_cast<std::int16_t>(v(random));
    edge.known = true;
    const double slope =
        (edge.v - kRoadCamera.cy) / kRoadCamera.fy * std::cos(pitch_rad) + std::sin(pitch_rad);
    edge.inverse_depth =
        i % 2 == 0 ? static_cast<float>(slope / height * (1 + noise(random))) : other(random);
    edge.variance = 1e-4F * edge.inverse_depth * edge.inverse_depth;
    edges.push_back(edge);
  }
  return edges;
}

TEST(RoadHeight, IsThatOfTheRoadAmongOtherThings) {
  for (const double pitch_rad : {0.0, 0.1}) {
    const auto height = RoadHeight(RoadAndOtherThings(1.5, pitch_rad), kRoadCamera, pitch_rad);
    ASSERT_TRUE(height);
    EXPECT_NEAR(*height, 1.5, 0.03);
  }
}

TEST(RoadHeight, IsNotKnownWithoutARoad) {
  std::vector<EdgeDepth> edges = RoadAndOtherThings(1.5, 0);
  for (std::size_t i = 0; i < edges.size(); i += 2) edges[i].known = false;
  EXPECT_FALSE(RoadHeight(edges, kRoadCamera, 0));
  EXPECT_FALSE(RoadHeight({}, kRoadCamera, 0));
}

TEST(MetricScale, StretchesWhatHasMeasuredItWrongly) {
  MetricScale scale({});
  scale.Measure(3, 0.03, 2);
  const double sigma = *scale.log_sigma();
  scale.Stretch(1.1);
  EXPECT_NEAR(scale.metres_per_unit(), 1.65, 1e-12);
  EXPECT_EQ(*scale.log_sigma(), sigma);
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) scale.Stretch(bad);
  EXPECT_NEAR(scale.metres_per_unit(), 1.65, 1e-12);
}

}  // namespace
}  // namespace livemap::odometry
