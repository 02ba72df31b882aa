#include "odometry/edge/point_loops.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "odometry/bilinear.h"

namespace livemap::odometry {
namespace {

constexpr int kWidth = 64, kHeight = 48;

PointProjection LoopProjection() {
  PointProjection projection;
  projection.rotation =
      Eigen::AngleAxisf(0.1F, Eigen::Vector3f(0.3F, 0.9F, -0.2F).normalized()).matrix();
  projection.translation = {0.05F, -0.02F, 0.1F};
  projection.fx = 60, projection.fy = 62, projection.cx = 31.5F, projection.cy = 23.5F;
  projection.gain = 1.1F, projection.bias = -3;
  return projection;
}

cv::Mat LoopPicture() {
  cv::Mat grey(kHeight, kWidth, CV_8UC1);
  cv::RNG random(5);
  random.fill(grey, cv::RNG::UNIFORM, 0, 256);
  return grey;
}

/// Some of them fall beside the picture, some lie behind the camera.
EdgePoints LoopPoints(std::size_t count) {
  std::mt19937 random(static_cast<std::uint32_t>(count));
  std::uniform_real_distribution<float> side(-1.2F, 1.2F), depth(-0.5F, 3), level(0, 255);
  EdgePoints points;
  for (std::size_t i = 0; i < count; ++i) {
    points.z.push_back(depth(random));
    points.x.push_back(0.6F * side(random) * points.z.back());
    points.y.push_back(0.6F * side(random) * points.z.back());
    points.intensity.push_back(level(random));
    points.slope.push_back(10);
    for (std::vector<float>& derivative : points.jacobian) derivative.push_back(side(random));
  }
  return points;
}

std::vector<float> LoopFactors(std::size_t count) {
  std::vector<float> factors;
  for (std::size_t i = 0; i < count; ++i) {
    factors.push_back(0.3F + 0.1F * static_cast<float>(i % 7));
  }
  return factors;
}

/// Full vectors and blocks, and what is left over beside them.
class PointLoops : public ::testing::TestWithParam<std::size_t> {};

TEST_P(PointLoops, ResidualsAreThoseOfTheFormula) {
  const std::size_t count = GetParam();
  const EdgePoints points = LoopPoints(count);
  const std::vector<float> factors = LoopFactors(count);
  const cv::Mat grey = LoopPicture();
  const PointProjection p = LoopProjection();
  PointResiduals residuals;
  EvaluateResiduals(points, factors, grey, p, residuals);
  ASSERT_EQ(residuals.value.size(), count);
  ASSERT_EQ(residuals.visible.size(), count);
  std::size_t visible = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f moved =
        p.rotation * Eigen::Vector3f(points.x[i], points.y[i], points.z[i]) + p.translation;
    const float u = moved.x() / moved.z() * p.fx + p.cx, v = moved.y() / moved.z() * p.fy + p.cy;
    const bool is_visible =
        moved.z() > 0.01F && u >= 0 && v >= 0 && u < kWidth - 1 && v < kHeight - 1;
    ASSERT_EQ(residuals.visible[i], is_visible ? 1 : 0) << i << ": " << u << ", " << v;
    const float expected =
        is_visible ? factors[i] * (Interpolate(grey, u, v) - p.gain * points.intensity[i] - p.bias)
                   : 0;
    EXPECT_NEAR(residuals.value[i], expected, 0.02) << i;
    visible += is_visible ? 1 : 0;
  }
  EXPECT_EQ(residuals.count, visible);
}

TEST_P(PointLoops, SumsAreThoseOfTheFormula) {
  const std::size_t count = GetParam(), part_size = 16;
  const float huber = 20;
  const EdgePoints points = LoopPoints(count);
  const std::vector<float> factors = LoopFactors(count);
  PointResiduals residuals;
  EvaluateResiduals(points, factors, LoopPicture(), LoopProjection(), residuals);
  const NormalSums sums = SumNormalEquations(points, factors, residuals, huber, part_size);
  NormalSums expected;
  NormalSums::Step part = NormalSums::Step::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    NormalSums::Step row;
    for (int k = 0; k < 6; ++k) row[k] = points.jacobian[static_cast<std::size_t>(k)][i];
    row[6] = points.intensity[i];
    row[7] = 1;
    const double value = residuals.value[i], factor = factors[i];
    const double weight =
        residuals.visible[i] * factor * factor * huber / std::max<double>(std::abs(value), huber);
    expected.normal += weight * row * row.transpose();
    part += weight * value / factor * row;
    if ((i + 1) % part_size == 0 || i + 1 == count) {
      expected.gradient += part;
      expected.scatter += part * part.transpose();
      part.setZero();
    }
  }
  const auto is_near = [](double one, double other, double scale) {
    return std::abs(one - other) <= 1e-5 * scale + 1e-9;
  };
  // Sums cancel: their terms' size is that of the diagonal.
  for (int i = 0; i < kAlignmentUnknowns; ++i) {
    EXPECT_TRUE(is_near(sums.gradient[i], expected.gradient[i],
                        std::sqrt(expected.scatter(i, i) * static_cast<double>(count))))
        << i << ": " << sums.gradient[i] << ", expected " << expected.gradient[i];
    for (int j = 0; j <= i; ++j) {
      const double normal_scale = std::sqrt(expected.normal(i, i) * expected.normal(j, j));
      const double scatter_scale = std::sqrt(expected.scatter(i, i) * expected.scatter(j, j));
      EXPECT_TRUE(is_near(sums.normal(i, j), expected.normal(i, j), normal_scale))
          << i << ", " << j << ": " << sums.normal(i, j) << ", expected " << expected.normal(i, j);
      EXPECT_TRUE(is_near(sums.scatter(i, j), expected.scatter(i, j), scatter_scale))
          << i << ", " << j;
      EXPECT_EQ(sums.scatter(i, j), sums.scatter(j, i));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AnyNumber, PointLoops,
                         ::testing::Values(0U, 1U, 7U, 8U, 9U, 255U, 256U, 257U, 263U, 1000U));

TEST(PointLoopsAtTheEdge, NothingBeyondThePictureIsReadAndWhatLiesThereIsNotVisible) {
  // Of exactly so many bytes, so that a sanitizer sees a read beyond them.
  std::vector<std::uint8_t> bytes(2 * 3, 100);
  const cv::Mat grey(2, 3, CV_8UC1, bytes.data());
  PointProjection still;
  still.fx = still.fy = 1;
  constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
  EdgePoints points;
  const std::vector<std::pair<float, float>> places = {
      {0, 0}, {1.999F, 0.999F}, {2, 0}, {0, 1}, {-0.001F, 0}, {0, -0.001F}, {kNothing, 0}};
  for (const auto& [u, v] : places) {
    points.x.push_back(u);
    points.y.push_back(v);
    points.z.push_back(1);
    points.intensity.push_back(90);
  }
  PointResiduals residuals;
  EvaluateResiduals(points, std::vector<float>(places.size(), 1), grey, still, residuals);
  EXPECT_EQ(residuals.visible, (std::vector<float>{1, 1, 0, 0, 0, 0, 0}));
  EXPECT_EQ(residuals.value, (std::vector<float>{10, 10, 0, 0, 0, 0, 0}));
  EXPECT_EQ(residuals.count, 2U);
}

TEST(PointLoopsAtTheEdge, APictureOfOneRowShowsNothing) {
  const EdgePoints points = LoopPoints(20);
  PointResiduals residuals;
  EvaluateResiduals(points, LoopFactors(20), cv::Mat(1, kWidth, CV_8UC1, cv::Scalar(9)),
                    LoopProjection(), residuals);
  EXPECT_EQ(residuals.count, 0U);
  EXPECT_EQ(residuals.value, std::vector<float>(20, 0));
}

}  // namespace
}  // namespace livemap::odometry
