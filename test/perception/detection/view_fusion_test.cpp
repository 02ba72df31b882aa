#include "perception/detection/view_fusion.h"

#include <gtest/gtest.h>

namespace livemap::perception {
namespace {

constexpr float kIou = 0.5F;

HazardDetection Of(int class_index, float confidence, const cv::Rect2f& box) {
  return {class_index == 0 ? "pothole" : "traffic_cone", class_index, confidence, box};
}

TEST(FuseViews, TheBoxIsTheMeanByConfidenceAndTheConfidenceTheMean) {
  const auto fused =
      FuseViews({{Of(0, 0.8F, {10, 10, 20, 10})}, {Of(0, 0.2F, {15, 10, 20, 10})}}, kIou);
  ASSERT_EQ(fused.size(), 1U);
  EXPECT_FLOAT_EQ(fused[0].confidence, 0.5F);
  EXPECT_FLOAT_EQ(fused[0].box.x, 11);
  EXPECT_FLOAT_EQ(fused[0].box.width, 20);
}

TEST(FuseViews, WhatOneViewAloneShowsIsDoubted) {
  const auto fused = FuseViews({{Of(0, 0.8F, {10, 10, 20, 10})}, {}}, kIou);
  ASSERT_EQ(fused.size(), 1U);
  EXPECT_FLOAT_EQ(fused[0].confidence, 0.4F);
  EXPECT_EQ(fused[0].box, cv::Rect2f(10, 10, 20, 10));
}

TEST(FuseViews, OtherClassesAndOtherPlacesStayApartInTheOrderOfConfidence) {
  const cv::Rect2f here(10, 10, 20, 10);
  const cv::Rect2f there(60, 10, 20, 10);
  const auto fused =
      FuseViews({{Of(0, 0.8F, here), Of(0, 0.6F, there)}, {Of(1, 0.9F, here)}}, kIou);
  ASSERT_EQ(fused.size(), 3U);
  EXPECT_EQ(fused[0].class_name, "traffic_cone");
  EXPECT_EQ(fused[1].box, here);
  EXPECT_EQ(fused[2].box, there);
}

TEST(FuseViews, TheWeakerOfTwoBoxesOfAViewOnOneThingAddsNothing) {
  const auto fused = FuseViews({{Of(0, 0.9F, {10, 10, 20, 20})},
                                {Of(0, 0.7F, {10, 10, 20, 14}), Of(0, 0.6F, {10, 18, 20, 12})}},
                               kIou);
  ASSERT_EQ(fused.size(), 1U);
  EXPECT_FLOAT_EQ(fused[0].confidence, 0.8F);
}

TEST(FuseViews, OfCountlessBoxesTheMostConfidentAreFused) {
  std::vector<HazardDetection> many;
  for (int i = 0; i < 2000; ++i) {
    many.push_back(
        Of(0, 1 - 0.0004F * static_cast<float>(i),
           {static_cast<float>(20 * (i % 50)), static_cast<float>(20 * (i / 50)), 9, 9}));
  }
  const auto fused = FuseViews({many, many}, kIou);
  ASSERT_EQ(fused.size(), kMaxFused);
  EXPECT_FLOAT_EQ(fused[0].confidence, 1);
}

}  // namespace
}  // namespace livemap::perception
