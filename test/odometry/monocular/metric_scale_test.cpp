#include "odometry/monocular/metric_scale.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

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
