#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "common/error.h"
#include "datasets/labels.h"
#include "datasets/sequences.h"
#include "simulation/datasets/hazard_geojson.h"
#include "simulation/datasets/tum_writer.h"
#include "simulation/datasets/yolo_writer.h"

namespace livemap::simulation {
namespace {

namespace fs = std::filesystem;

class Dataset : public ::testing::Test {
 protected:
  Dataset() {
    folder_ = fs::temp_directory_path() / ("livemap_simulation_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    frame_.bgr = cv::Mat(120, 160, CV_8UC3, cv::Scalar(10, 90, 200));
    frame_.depth = cv::Mat(120, 160, CV_32FC1, cv::Scalar(4.5));
    frame_.depth.row(0) = 0;
    frame_.depth.row(1) = 50;
    frame_.instances = cv::Mat(120, 160, CV_32SC1, cv::Scalar(1));
    frame_.instances(kBox) = static_cast<int>(kCone);
    frame_.world_from_optical = Eigen::Translation3d(1, 2, 3) *
                                Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized());
    camera_.intrinsics = geo::CameraIntrinsics{100, 100, 79.5, 59.5, 160, 120};
  }
  ~Dataset() override { fs::remove_all(folder_); }

  static constexpr std::uint32_t kCone =
      (77U << 5U) | static_cast<std::uint32_t>(ObjectClass::kTrafficCone);
  const cv::Rect kBox{40, 30, 12, 20};
  fs::path folder_;
  SimulatedFrame frame_;
  SimulatedCamera camera_;
};

TEST_F(Dataset, BoxesEncloseTheirInstancesExactly) {
  frame_.instances.at<int>(70, 45) = static_cast<int>(kCone);
  frame_.instances.at<int>(10, 10) = static_cast<int>(MakeInstance(9, ObjectClass::kDeer));
  frame_.instances(cv::Rect(100, 50, 30, 30)) =
      static_cast<int>(MakeInstance(5, ObjectClass::kVehicle));
  const std::vector<HazardInView> hazards = FindHazards(frame_.instances, frame_.outlines);
  ASSERT_EQ(hazards.size(), 1U) << "one pixel of deer and a parked car are not labelled";
  EXPECT_EQ(hazards[0].box, cv::Rect(40, 30, 12, 41));
  EXPECT_EQ(hazards[0].visible_pixels, 12 * 20 + 1);
  EXPECT_EQ(hazards[0].object_class, ObjectClass::kTrafficCone);
}

TEST_F(Dataset, WhatIsTooSmallOrTooHiddenToBeNamedIsDifficult) {
  const std::uint32_t deer = MakeInstance(9, ObjectClass::kDeer);
  const std::uint32_t pothole = MakeInstance(8, ObjectClass::kPothole);
  frame_.instances(cv::Rect(100, 50, 20, 20)) = static_cast<int>(deer);
  frame_.instances(cv::Rect(60, 100, 40, 7)) = static_cast<int>(pothole);
  frame_.outlines[kCone] = 2 * 12 * 20;
  frame_.outlines[deer] = 3 * 20 * 20;
  std::map<std::uint32_t, bool> difficult;
  for (const HazardInView& hazard : FindHazards(frame_.instances, frame_.outlines)) {
    difficult[hazard.instance] = hazard.difficult;
  }
  ASSERT_EQ(difficult.size(), 3U);
  EXPECT_FALSE(difficult[kCone]) << "half of it is visible";
  EXPECT_TRUE(difficult[deer]) << "a third of it is visible";
  EXPECT_TRUE(difficult[pothole]) << "7 px high";
}

TEST_F(Dataset, YoloFolderKeepsDifficultHazardsApart) {
  frame_.outlines[kCone] = 1000;
  YoloWriter writer(folder_.string());
  writer.Add(12.5, frame_, FindHazards(frame_.instances, frame_.outlines));
  writer.Finish();
  EXPECT_EQ(ReadFile((folder_ / "labels" / "000000.txt").string(), 1000), "");
  EXPECT_EQ(ReadFile((folder_ / "difficult" / "000000.txt").string(), 1000),
            "1 0.287500 0.333333 0.075000 0.166667\n");
}

TEST_F(Dataset, TumFolderIsReadBackByTheReaderOfDrives) {
  TumWriter writer(folder_.string(), camera_);
  writer.Add(0, frame_);
  writer.Add(0.1, frame_);
  writer.Finish();
  const datasets::Sequence sequence = datasets::ReadTumSequence(folder_.string());
  ASSERT_EQ(sequence.frames.size(), 2U);
  ASSERT_EQ(sequence.poses.size(), 2U);
  EXPECT_EQ(sequence.depth_scale, 5000);
  EXPECT_EQ(sequence.baseline_m, 0) << "monocular";
  EXPECT_TRUE(sequence.frames[0].right_path.empty());
  EXPECT_EQ(sequence.intrinsics.fx, 100);
  EXPECT_EQ(sequence.frames[1].stamp_ns, 100000000);
  EXPECT_TRUE(sequence.poses[0].world_from_camera.isApprox(frame_.world_from_optical, 1e-8));
  const cv::Mat depth = cv::imread(sequence.frames[0].depth_path, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(depth.type(), CV_16UC1);
  EXPECT_EQ(depth.at<std::uint16_t>(60, 60), 22500);
  EXPECT_EQ(depth.at<std::uint16_t>(0, 5), 0) << "sky";
  EXPECT_EQ(depth.at<std::uint16_t>(1, 5), 0) << "beyond what 16 bits hold";
  EXPECT_TRUE(std::equal(frame_.bgr.datastart, frame_.bgr.dataend,
                         cv::imread(sequence.frames[0].image_path).datastart));
}

TEST_F(Dataset, TumFolderOfTwoEyesIsReadBackWithItsBaseline) {
  TumWriter writer(folder_.string(), camera_, 1000, 0.35);
  writer.Add(0, frame_, frame_.bgr);
  writer.Add(0.1, frame_, frame_.bgr);
  writer.Finish();
  const datasets::Sequence sequence = datasets::ReadTumSequence(folder_.string());
  EXPECT_EQ(sequence.baseline_m, 0.35);
  ASSERT_EQ(sequence.frames.size(), 2U);
  EXPECT_EQ(sequence.frames[1].right_path, (folder_ / "rgb_right" / "0.100000.png").string());
  fs::remove(folder_ / "rgb_right" / "0.100000.png");
  EXPECT_THROW(datasets::ReadTumSequence(folder_.string()), Error) << "a listed picture is missing";
}

TEST_F(Dataset, CoarserTumDepthReachesFurther) {
  TumWriter writer(folder_.string(), camera_, 1000);
  writer.Add(0, frame_);
  writer.Finish();
  const datasets::Sequence sequence = datasets::ReadTumSequence(folder_.string());
  EXPECT_EQ(sequence.depth_scale, 1000);
  const cv::Mat depth = cv::imread(sequence.frames[0].depth_path, cv::IMREAD_UNCHANGED);
  EXPECT_EQ(depth.at<std::uint16_t>(60, 60), 4500);
  EXPECT_EQ(depth.at<std::uint16_t>(1, 5), 50000);
}

TEST_F(Dataset, YoloFolderHasFractionsOfTheImage) {
  YoloWriter writer(folder_.string());
  writer.Add(12.5, frame_, FindHazards(frame_.instances, frame_.outlines));
  writer.Finish();
  const std::vector<datasets::LabelledBox> boxes = datasets::ParseYoloLabels(
      ReadFile((folder_ / "labels" / "000000.txt").string(), 1000), "000000.txt");
  ASSERT_EQ(boxes.size(), 1U);
  EXPECT_EQ(boxes[0].class_index, 1);
  EXPECT_NEAR(boxes[0].centre_x, 46.0 / 160, 1e-6);
  EXPECT_NEAR(boxes[0].centre_y, 40.0 / 120, 1e-6);
  EXPECT_NEAR(boxes[0].width, 12.0 / 160, 1e-6);
  EXPECT_EQ(ReadFile((folder_ / "frames.csv").string(), 1000), "frame,chainage_m\n000000,12.500\n");
  EXPECT_EQ(ReadFile((folder_ / "classes.txt").string(), 1000).substr(0, 21),
            "pothole\ntraffic_cone\n");
}

TEST_F(Dataset, RefusesAFolderThatHoldsSomething) {
  fs::create_directories(folder_ / "old");
  EXPECT_THROW(TumWriter(folder_.string(), camera_), Error);
  EXPECT_THROW(YoloWriter(folder_.string()), Error);
}

TEST_F(Dataset, AFileInPlaceOfTheFolderIsNamedAsOne) {
  std::ofstream(folder_) << "x";
  try {
    YoloWriter(folder_.string());
    FAIL() << "a file was taken for a folder";
  } catch (const Error& error) {
    EXPECT_EQ(error.what(),
              "'" + folder_.string() + "' is a file, accepted is a new or empty folder");
  }
}

TEST_F(Dataset, HazardsAreNamedWhenTheyWereSeenAndMarkedWhenTheyWerePassed) {
  WorldDescription world;
  world.pieces = {{200, 0, 0}};
  world.hazards.emplace();
  PlacedHazard placed;
  placed.object_class = ObjectClass::kBarrier;
  placed.at_m = 100;
  world.hazards->push_back(placed);
  const Street street(world, 1, 200, true);
  const std::uint32_t instance = street.Hazards(2).at(0).instance;
  const std::string text = HazardsAsGeoJson(street, {48, 9}, {{instance, 4}}, 90);
  EXPECT_NE(text.find("\"class\": \"barrier\""), std::string::npos);
  EXPECT_NE(text.find("\"frames_seen\": 4"), std::string::npos);
  EXPECT_NE(text.find("\"passed\": false"), std::string::npos);
  const std::string later = HazardsAsGeoJson(street, {48, 9}, {{instance, 4}}, 110);
  EXPECT_NE(later.find("\"passed\": true"), std::string::npos);
  EXPECT_EQ(HazardsAsGeoJson(street, {48, 9}, {}, 110).find("barrier"), std::string::npos)
      << "never in view";
}

}  // namespace
}  // namespace livemap::simulation
