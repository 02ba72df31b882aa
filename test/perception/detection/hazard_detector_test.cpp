#include "perception/detection/hazard_detector.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/error.h"
#include "perception/inference/processor.h"

namespace livemap::perception {
namespace {

const cv::Scalar kRed(0, 0, 255);
const cv::Scalar kGreen(0, 255, 0);

/// The model of test/perception/inference/make_tiny_model.py: red blocks are potholes, green ones
/// cones.
HazardDetector TinyDetector() {
  return HazardDetector(
      ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny.yaml"));
}

TEST(HazardDetector, FindsWhatTheModelFindsInPixelsOfTheImage) {
  HazardDetector detector = TinyDetector();
  // Twice the input: an 8 x 8 cell is 16 x 16 px here.
  cv::Mat image(96, 128, CV_8UC3, cv::Scalar(0, 0, 0));
  image(cv::Rect(32, 16, 16, 16)) = kRed;
  image(cv::Rect(96, 64, 16, 16)) = kGreen;
  const std::vector<HazardDetection> found = detector.Detect(image);
  ASSERT_EQ(found.size(), 2U);
  const HazardDetection& pothole = found[found[0].class_index == 0 ? 0 : 1];
  const HazardDetection& cone = found[found[0].class_index == 0 ? 1 : 0];
  EXPECT_EQ(pothole.class_name, "pothole");
  EXPECT_GT(pothole.confidence, 0.99F);
  // Two cells wide and one high around the cell's centre (40, 24).
  EXPECT_NEAR(pothole.box.x, 24, 0.1);
  EXPECT_NEAR(pothole.box.y, 16, 0.1);
  EXPECT_NEAR(pothole.box.width, 32, 0.1);
  EXPECT_NEAR(pothole.box.height, 16, 0.1);
  EXPECT_EQ(cone.class_name, "traffic_cone");
  EXPECT_NEAR(cone.box.x, 96, 0.1);
  EXPECT_NEAR(cone.box.y, 64, 0.1);
}

TEST(HazardDetector, InEightBitsItFindsTheSameInTheSamePlaces) {
  const ModelManifest manifest =
      ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny_int8.yaml");
  HazardDetector detector(manifest, 1);
  if (!HasTorchEngine() || !HasInt8Instructions()) {
    EXPECT_EQ(detector.ComputesIn(), Precision::kFp32);
    GTEST_SKIP() << "skipped, no libtorch or no VNNI";
  }
  ASSERT_EQ(detector.ComputesIn(), Precision::kInt8);
  cv::Mat image(96, 128, CV_8UC3, cv::Scalar(0, 0, 0));
  image(cv::Rect(32, 16, 16, 16)) = kRed;
  image(cv::Rect(96, 64, 16, 16)) = kGreen;
  const std::vector<HazardDetection> expected = TinyDetector().Detect(image);
  const std::vector<HazardDetection> found = detector.Detect(image);
  ASSERT_EQ(found.size(), expected.size());
  for (const HazardDetection& each : expected) {
    const auto same = std::find_if(found.begin(), found.end(), [&](const HazardDetection& other) {
      return other.class_index == each.class_index;
    });
    ASSERT_NE(same, found.end()) << each.class_name;
    EXPECT_NEAR(same->confidence, each.confidence, 0.015);
    EXPECT_NEAR(same->box.x, each.box.x, 0.2);
    EXPECT_NEAR(same->box.y, each.box.y, 0.2);
    EXPECT_NEAR(same->box.width, each.box.width, 0.4);
    EXPECT_NEAR(same->box.height, each.box.height, 0.4);
  }
}

TEST(HazardDetector, WhatTheMirroredImageShowsIsAtTheSamePlace) {
  ModelManifest manifest =
      ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny.yaml");
  manifest.head.mirrored = true;
  HazardDetector detector(manifest);
  cv::Mat image(96, 128, CV_8UC3, cv::Scalar(0, 0, 0));
  image(cv::Rect(32, 16, 16, 16)) = kRed;
  const std::vector<HazardDetection> found = detector.Detect(image);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_GT(found[0].confidence, 0.99F) << "both views are sure, so is their mean";
  EXPECT_NEAR(found[0].box.x, 24, 0.1);
  EXPECT_NEAR(found[0].box.y, 16, 0.1);
  EXPECT_NEAR(found[0].box.width, 32, 0.1);
}

TEST(HazardDetector, WhatOnlyOneOfTheTwoImagesShowsIsDoubted) {
  ModelManifest manifest =
      ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny.yaml");
  manifest.head.mirrored = true;
  HazardDetector detector(manifest);
  // The input is 64 px wide, this image 60: mirrored, its red block lies across two cells.
  cv::Mat image(48, 60, CV_8UC3, cv::Scalar(0, 0, 0));
  image(cv::Rect(16, 8, 8, 8)) = kRed;
  const std::vector<HazardDetection> found = detector.Detect(image);
  manifest.head.mirrored = false;
  const std::vector<HazardDetection> alone = HazardDetector(manifest).Detect(image);
  ASSERT_EQ(alone.size(), 1U);
  EXPECT_GT(alone[0].confidence, 0.99F);
  for (const HazardDetection& detection : found) EXPECT_LT(detection.confidence, 0.9F);
}

TEST(HazardDetector, AnEmptyRoadGivesNothing) {
  HazardDetector detector = TinyDetector();
  EXPECT_TRUE(detector.Detect(cv::Mat(96, 128, CV_8UC3, cv::Scalar(90, 90, 90))).empty());
}

TEST(HazardDetector, ImagesOfDifferentSizesFollowEachOther) {
  HazardDetector detector = TinyDetector();
  for (const cv::Size size : {cv::Size(64, 48), cv::Size(640, 480), cv::Size(200, 48),
                              cv::Size(48, 200), cv::Size(1, 1), cv::Size(64, 48)}) {
    for (const HazardDetection& detection : detector.Detect(cv::Mat(size, CV_8UC3, kRed))) {
      const cv::Rect2f image({0, 0}, cv::Size2f(size));
      EXPECT_EQ(detection.box & image, detection.box) << size;
      EXPECT_FALSE(detection.box.empty()) << size;
    }
  }
}

TEST(HazardDetector, AnImageThatItCannotUseIsRefusedAndTheNextOneWorks) {
  HazardDetector detector = TinyDetector();
  EXPECT_THROW(detector.Detect(cv::Mat()), Error);
  EXPECT_THROW(detector.Detect(cv::Mat(48, 64, CV_16UC1, cv::Scalar(0))), Error);
  EXPECT_FALSE(detector.Detect(cv::Mat(48, 64, CV_8UC3, kRed)).empty());
}

}  // namespace
}  // namespace livemap::perception
