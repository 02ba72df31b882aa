#include "simulation/datasets/change_dataset_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "common/error.h"
#include "datasets/text_parsing.h"

namespace livemap::simulation {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> Lines(const fs::path& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

class ChangeDataset : public ::testing::Test {
 protected:
  ChangeDataset() {
    folder_ = fs::temp_directory_path() / ("livemap_change_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    camera_.intrinsics = geo::CameraIntrinsics{10, 10, 7.5, 5.5, 16, 12};
    first_.frame.bgr = cv::Mat(12, 16, CV_8UC3, cv::Scalar(10, 20, 30));
    second_.frame.bgr = cv::Mat(12, 16, CV_8UC3, cv::Scalar(40, 50, 60));
    first_.along_m = 12.25;
    second_.along_m = 12.5;
    second_.frame.world_from_optical =
        Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ());
    view_.mask = cv::Mat::zeros(12, 16, CV_8UC1);
    view_.direction = view_.mask.clone();
    for (int i = 0; i < protocol::kChangeClasses; ++i) {
      view_.mask.at<std::uint8_t>(1, i) = static_cast<std::uint8_t>(i);
      view_.direction.at<std::uint8_t>(1, i) = protocol::kVanishedPixel;
    }
    view_.pixels = {{kCone, 30}, {kCar, 3}};
  }
  ~ChangeDataset() override { fs::remove_all(folder_); }

  static constexpr std::uint32_t kCone =
      (77U << 5U) | static_cast<std::uint32_t>(ObjectClass::kTrafficCone);
  static constexpr std::uint32_t kCar =
      (78U << 5U) | static_cast<std::uint32_t>(ObjectClass::kVehicle);
  const Street street_{WorldDescription(), 3, 300, true};
  fs::path folder_;
  SimulatedCamera camera_;
  PassPicture first_;
  PassPicture second_;
  ChangeView view_;
};

TEST_F(ChangeDataset, PairsAreReadBackFromThePublishedLayout) {
  ChangeDatasetWriter writer(folder_.string(), camera_);
  for (std::size_t i = 0; i < ChangeDatasetWriter::kPairsPerSequence + 2; ++i) {
    writer.Add(first_, second_, view_);
  }
  writer.Finish(street_, {48, 9}, {});
  for (const std::string place : {"000/*00", "000/*99", "001/*01"}) {
    const std::string sequence = (folder_ / "raw" / place.substr(0, 3)).string();
    const std::string number = place.substr(5);
    const cv::Mat first = cv::imread(sequence + "/RGB/1_" + number + ".png");
    const cv::Mat second = cv::imread(sequence + "/RGB/2_" + number + ".png");
    const cv::Mat mask = cv::imread(sequence + "/GT/gt" + number + ".png", cv::IMREAD_UNCHANGED);
    const cv::Mat colours = cv::imread(sequence + "/GT_colours/gt" + number + ".png");
    ASSERT_EQ(first.size(), cv::Size(16, 12)) << place;
    EXPECT_EQ(first.at<cv::Vec3b>(5, 5), cv::Vec3b(10, 20, 30));
    EXPECT_EQ(second.at<cv::Vec3b>(5, 5), cv::Vec3b(40, 50, 60));
    ASSERT_EQ(mask.type(), CV_8UC1);
    EXPECT_EQ(cv::countNonZero(mask != view_.mask), 0);
    const cv::Mat direction =
        cv::imread(sequence + "/GT_direction/gt" + number + ".png", cv::IMREAD_UNCHANGED);
    ASSERT_EQ(direction.type(), CV_8UC1);
    EXPECT_EQ(cv::countNonZero(direction != view_.direction), 0);
    double greatest = 0;
    cv::minMaxLoc(mask, nullptr, &greatest);
    EXPECT_LT(greatest, protocol::kChangeClasses);
    EXPECT_EQ(colours.at<cv::Vec3b>(5, 5), cv::Vec3b(255, 255, 255));
    EXPECT_EQ(colours.at<cv::Vec3b>(1, 9), cv::Vec3b(29, 230, 181)) << "vehicle, BGR";
  }
  EXPECT_FALSE(fs::exists(folder_ / "raw" / "001" / "RGB" / "1_02.png"));
}

TEST_F(ChangeDataset, ListsClassesByIndexAndBothPosesOfEveryPair) {
  ChangeDatasetWriter writer(folder_.string(), camera_);
  writer.Add(first_, second_, view_);
  writer.Add(first_, second_, view_);
  writer.Finish(street_, {48, 9}, {});
  const std::vector<std::string> classes = Lines(folder_ / "classes.txt");
  ASSERT_EQ(classes.size(), static_cast<std::size_t>(protocol::kChangeClasses));
  EXPECT_EQ(classes[0], "no_change");
  EXPECT_EQ(classes[8], "traffic_cone");
  const std::vector<std::string> poses = Lines(folder_ / "poses.csv");
  ASSERT_EQ(poses.size(), 3U);
  const std::vector<std::string> names = datasets::Split(poses[0], ',');
  const std::vector<std::string> values = datasets::Split(poses[2], ',');
  ASSERT_EQ(names.size(), values.size());
  std::map<std::string, std::string> row;
  for (std::size_t i = 0; i < names.size(); ++i) row[names[i]] = values[i];
  EXPECT_EQ(row["frame"], "1");
  EXPECT_EQ(row["pair"], "000/01");
  EXPECT_EQ(row["first_along_m"], "12.250");
  EXPECT_EQ(row["second_tz"], "3.000000000");
  EXPECT_NEAR(std::stod(row["second_qz"]), std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(std::stod(row["second_qw"]), std::sqrt(0.5), 1e-9);
}

TEST_F(ChangeDataset, NamesEachChangeWhereItIsAndHowOftenItWasSeen) {
  ChangeDatasetWriter writer(folder_.string(), camera_);
  writer.Add(first_, second_, view_);
  writer.Add(first_, second_, view_);
  writer.Finish(street_, {48, 9}, {{kCone, {kCone, true, 40, -3}}, {kCar, {kCar, false, 55, 4}}});
  EXPECT_EQ(writer.seen(), 1U);
  std::ifstream file(folder_ / "changes.geojson");
  const nlohmann::json features = nlohmann::json::parse(file).at("features");
  ASSERT_EQ(features.size(), 2U);
  const nlohmann::json& cone = features[0].at("properties");
  EXPECT_EQ(cone.at("instance"), kCone);
  EXPECT_EQ(cone.at("class"), "traffic_cone");
  EXPECT_EQ(cone.at("change_class"), "traffic_cone");
  EXPECT_EQ(cone.at("change"), "appeared");
  EXPECT_EQ(cone.at("frames_seen"), 2);
  EXPECT_EQ(cone.at("left_m"), -3);
  const nlohmann::json& car = features[1].at("properties");
  EXPECT_EQ(car.at("change"), "vanished");
  EXPECT_EQ(car.at("frames_seen"), 0) << "three pixels are not seen";
  const Eigen::Vector3d place = street_.line().At(40, -3, 0);
  const geo::GeoPoint position = geo::LocalFrame({48, 9}).ToGeo(place.head<2>());
  EXPECT_NEAR(features[0]["geometry"]["coordinates"][0].get<double>(), position.longitude_deg,
              1e-12);
  EXPECT_NEAR(features[0]["geometry"]["coordinates"][1].get<double>(), position.latitude_deg,
              1e-12);
}

TEST_F(ChangeDataset, RefusesAFolderThatIsNotEmpty) {
  fs::create_directories(folder_ / "other");
  EXPECT_THROW(ChangeDatasetWriter(folder_.string(), camera_), Error);
}

TEST_F(ChangeDataset, OverlayIsGreyButWhereSomethingChanged) {
  const cv::Mat overlay = OverlayChanges(second_.frame.bgr, view_.mask);
  const auto& calm = overlay.at<cv::Vec3b>(5, 5);
  EXPECT_TRUE(calm[0] == calm[1] && calm[1] == calm[2]);
  const auto& vehicle = overlay.at<cv::Vec3b>(1, 9);
  EXPECT_GT(vehicle[1], vehicle[0] + 80);
}

}  // namespace
}  // namespace livemap::simulation
