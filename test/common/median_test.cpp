#include "common/median.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace livemap {
namespace {

TEST(Median, IsTheMiddleOneAndOfTwoTheUpper) {
  EXPECT_EQ(MedianOf(std::vector<int>{7}), 7);
  EXPECT_EQ(MedianOf(std::vector<double>{3, 1, 2}), 2);
  EXPECT_EQ(MedianOf(std::vector<double>{4, 1, 3, 2}), 3);
}

TEST(Median, OfTheMagnitudesOfNormalErrorsTellsTheirStandardDeviationInSpiteOfOutliers) {
  std::mt19937 random(5);
  std::normal_distribution<double> errors(0, 2);
  std::vector<double> magnitudes;
  for (int i = 0; i < 20000; ++i) magnitudes.push_back(std::abs(errors(random)));
  for (int i = 0; i < 200; ++i) magnitudes.push_back(1e6);
  EXPECT_NEAR(kMedianToSigma * TakeMedian(magnitudes), 2, 0.1);
}

}  // namespace
}  // namespace livemap
