#include "drives/generated_drive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>

#include "geo/ground_projection.h"

namespace livemap {
namespace {

CameraFile Camera() {
  return ReadCameraFile(std::string(LIVEMAP_SOURCE_DIR) + "/config/cameras/generated.yaml");
}

TEST(GeneratedWorld, SameSeedSameWorldAndHazardsStandApart) {
  const GeneratedWorld world = PlanWorld(4, 500);
  const GeneratedWorld again = PlanWorld(4, 500);
  ASSERT_EQ(world.hazards.size(), again.hazards.size());
  ASSERT_GT(world.hazards.size(), 15U);
  std::set<std::string> classes;
  for (std::size_t i = 0; i < world.hazards.size(); ++i) {
    EXPECT_EQ(world.hazards[i].left_m, again.hazards[i].left_m);
    classes.insert(world.hazards[i].class_name);
    if (i == 0) continue;
    EXPECT_GE(world.hazards[i].along_m - world.hazards[i - 1].along_m, 14);
  }
  EXPECT_EQ(classes, (std::set<std::string>{"pothole", "traffic_cone"}));
  EXPECT_NE(PlanWorld(5, 500).hazards[0].left_m, world.hazards[0].left_m);
}

TEST(GeneratedDrive, PicturesAreTheSameForTheSameSeed) {
  const GeneratedWorld world = PlanWorld(1, 40);
  const cv::Mat first = GeneratedDriveRenderer(world, Camera()).Render(5);
  const cv::Mat again = GeneratedDriveRenderer(world, Camera()).Render(5);
  EXPECT_EQ(first.size(), cv::Size(640, 400));
  EXPECT_EQ(cv::norm(first, again, cv::NORM_INF), 0);
}

TEST(GeneratedDrive, BoxesStandWhereTheGroundProjectionPutsTheHazards) {
  const GeneratedWorld world = PlanWorld(2, 300);
  const CameraFile camera = Camera();
  const GeneratedDriveRenderer renderer(world, camera);
  int checked = 0;
  for (double along_m = 0; along_m < 250; along_m += 7) {
    for (const VisibleHazard& seen : renderer.Visible(along_m)) {
      const GeneratedHazard& truth = world.hazards[static_cast<std::size_t>(seen.id)];
      EXPECT_EQ(seen.class_name, truth.class_name);
      if (seen.box.br().y > 399 || seen.box.x < 1 || seen.box.br().x > 639) continue;
      const Eigen::Vector2d foot(seen.box.x + seen.box.width / 2 - 0.5, seen.box.br().y - 0.5);
      const auto ground =
          ProjectToGround(foot, camera.intrinsics, camera.mounting.BaseFromOptical(), {});
      ASSERT_TRUE(ground);
      EXPECT_NEAR(ground->position_m.x(), truth.along_m - along_m, 1.2);
      EXPECT_NEAR(ground->position_m.y(), truth.left_m, 0.4);
      ++checked;
    }
  }
  EXPECT_GT(checked, 20);
}

TEST(GeneratedDrive, ConesAreOrangeInsideTheirBoxes) {
  const GeneratedWorld world = PlanWorld(3, 200);
  GeneratedDriveRenderer renderer(world, Camera());
  const auto cone = std::find_if(
      world.hazards.begin(), world.hazards.end(),
      [](const GeneratedHazard& hazard) { return hazard.class_name == "traffic_cone"; });
  ASSERT_NE(cone, world.hazards.end());
  const double along_m = cone->along_m - 9;
  const cv::Mat picture = renderer.Render(along_m);
  for (const VisibleHazard& seen : renderer.Visible(along_m)) {
    if (seen.id != cone->id) continue;
    const cv::Scalar inside = cv::mean(picture(cv::Rect(seen.box)));
    EXPECT_GT(inside[2], inside[0] + 25);
    return;
  }
  FAIL() << "the cone is not visible";
}

TEST(GeneratedDrive, PotholesDifferFromTheRoadBesideThem) {
  const GeneratedWorld world = PlanWorld(3, 200);
  GeneratedDriveRenderer renderer(world, Camera());
  const double along_m = world.hazards[0].along_m - 7;
  ASSERT_EQ(world.hazards[0].class_name, "pothole");
  const cv::Mat picture = renderer.Render(along_m);
  for (const VisibleHazard& seen : renderer.Visible(along_m)) {
    if (seen.id != 0) continue;
    cv::Scalar mean;
    cv::Scalar inside;
    cv::Scalar beside;
    const cv::Rect box(seen.box);
    cv::meanStdDev(picture(box), mean, inside);
    cv::meanStdDev(picture(box + cv::Point(0, box.height + 8)), mean, beside);
    EXPECT_GT(inside[1], 1.5 * beside[1]);
    return;
  }
  FAIL() << "the pothole is not visible";
}

}  // namespace
}  // namespace livemap
