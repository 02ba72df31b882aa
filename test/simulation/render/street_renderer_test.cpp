#include "simulation/render/street_renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "datasets/camera_file.h"
#include "simulation/datasets/labels_in_view.h"
#include "simulation/motion/vehicle_motion.h"
#include "test/simulation/render/same_pixels.h"

namespace livemap::simulation {
namespace {

SimulatedCamera StreetCamera() {
  SimulatedCamera camera;
  camera.intrinsics = geo::CameraIntrinsics{160, 160, 119.5, 79.5, 240, 160};
  return camera;
}

CameraExposure ViewAt(const Street& street, double time_s) {
  const VehicleMotion motion(street, DrivingStyle(), 20);
  datasets::CameraMounting mounting;
  mounting.height_m = 1.4;
  mounting.pitch_deg = 4;
  CameraExposure view;
  view.world_from_optical = motion.WorldFromBase(time_s) * mounting.BaseFromOptical();
  view.world_from_optical_end = view.world_from_optical;
  view.along_m = motion.AlongM(time_s);
  return view;
}

SimulatedFrame Picture(const Street& street, const SimulatedCamera& camera, int threads,
                       double time_s, Condition condition = Condition::kDay) {
  RenderConfig options;
  options.threads = threads;
  StreetRenderer renderer(street, camera, MakeLighting(condition, street.seed()), options);
  return renderer.Render(ViewAt(street, time_s), 3);
}

bool SameFrame(const SimulatedFrame& a, const SimulatedFrame& b) {
  return SamePixels(a.bgr, b.bgr) && SamePixels(a.depth, b.depth) &&
         SamePixels(a.instances, b.instances) && SamePixels(a.classes, b.classes);
}

class Renderer : public ::testing::Test {
 protected:
  const Street street_{WorldDescription(), 3, 400, true};
};

TEST_F(Renderer, GivesTheSameBytesForOneAndTwoThreadsInEveryWeather) {
  for (const Condition condition : {Condition::kDay, Condition::kRain, Condition::kSnow}) {
    const SimulatedFrame one = Picture(street_, StreetCamera(), 1, 1, condition);
    const SimulatedFrame two = Picture(street_, StreetCamera(), 2, 1, condition);
    EXPECT_TRUE(SameFrame(one, two)) << ConditionName(condition);
  }
}

TEST_F(Renderer, DoesNotDependOnWhatWasRenderedBefore) {
  RenderConfig options;
  StreetRenderer renderer(street_, StreetCamera(), MakeLighting(Condition::kDay, 3), options);
  renderer.Render(ViewAt(street_, 0), 0);
  renderer.Render(ViewAt(street_, 6), 60);
  const SimulatedFrame late = renderer.Render(ViewAt(street_, 12), 3);
  EXPECT_TRUE(SameFrame(late, Picture(street_, StreetCamera(), 1, 12)));
}

TEST_F(Renderer, AnotherSeedGivesAnotherPicture) {
  const Street other(WorldDescription(), 4, 400, true);
  EXPECT_FALSE(SamePixels(Picture(street_, StreetCamera(), 2, 1).bgr,
                          Picture(other, StreetCamera(), 2, 1).bgr));
}

TEST_F(Renderer, EveryInstanceHasOneClassAndTheClassImageAgrees) {
  const SimulatedFrame frame = Picture(street_, StreetCamera(), 2, 2);
  std::set<int> classes;
  for (int row = 0; row < frame.classes.rows; ++row) {
    for (int column = 0; column < frame.classes.cols; ++column) {
      const auto instance = static_cast<std::uint32_t>(frame.instances.at<int>(row, column));
      const int value = frame.classes.at<std::uint8_t>(row, column);
      ASSERT_EQ(value, static_cast<int>(ClassOfInstance(instance)));
      ASSERT_LT(value, kObjectClasses);
      ASSERT_EQ(frame.depth.at<float>(row, column) == 0, value == 0) << "only the sky has no depth";
      classes.insert(value);
    }
  }
  EXPECT_GE(classes.size(), 5U);
}

/// Inverse depth between four pixels of one surface; 0 when they are not of one surface.
double InverseDepth(const SimulatedFrame& frame, const Eigen::Vector2d& at) {
  const auto column = static_cast<int>(std::floor(at.x()));
  const auto row = static_cast<int>(std::floor(at.y()));
  if (column < 0 || row < 0 || column + 1 >= frame.depth.cols || row + 1 >= frame.depth.rows) {
    return 0;
  }
  double corners[2][2];
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) {
      if (frame.instances.at<int>(row + dy, column + dx) != static_cast<int>(ObjectClass::kRoad)) {
        return 0;
      }
      corners[dy][dx] = 1.0 / static_cast<double>(frame.depth.at<float>(row + dy, column + dx));
    }
  }
  const double u = at.x() - column;
  const double v = at.y() - row;
  return (1 - v) * ((1 - u) * corners[0][0] + u * corners[0][1]) +
         v * ((1 - u) * corners[1][0] + u * corners[1][1]);
}

/// Median and 90th percentile of how far, in pixels, points of one picture's road are from where
/// the other's depth and pose put them.
std::pair<double, double> Disagreement(const SimulatedFrame& a, const SimulatedFrame& b,
                                       const SimulatedCamera& camera) {
  const Eigen::Isometry3d b_from_a = b.world_from_optical.inverse() * a.world_from_optical;
  std::vector<double> errors;
  for (int row = 90; row < a.depth.rows; row += 3) {
    for (int column = 0; column < a.depth.cols; column += 3) {
      if (a.instances.at<int>(row, column) != static_cast<int>(ObjectClass::kRoad)) continue;
      const auto depth = static_cast<double>(a.depth.at<float>(row, column));
      const Eigen::Vector3d in_b = b_from_a * (camera.Ray(column, row) * depth);
      if (in_b.z() < 1) continue;
      const Eigen::Vector2d pixel = camera.Project(in_b);
      const double inverse = InverseDepth(b, pixel);
      if (inverse <= 0) continue;
      const Eigen::Vector3d seen_by_b = camera.Ray(pixel.x(), pixel.y()) / inverse;
      const Eigen::Vector2d back = camera.Project(b_from_a.inverse() * seen_by_b);
      errors.push_back((back - Eigen::Vector2d(column, row)).norm());
    }
  }
  std::sort(errors.begin(), errors.end());
  if (errors.size() < 200) return {1e9, 1e9};
  return {errors[errors.size() / 2], errors[errors.size() * 9 / 10]};
}

TEST(Truth, DepthPoseAndProjectionAgreeToAHundredthOfAPixel) {
  WorldDescription world;
  world.pieces = {{400, 0, 0}};
  world.hazards.emplace();
  const Street street(world, 3, 400, true);
  SimulatedCamera camera = StreetCamera();
  for (const double k1 : {0.0, -0.2}) {
    camera.k1 = k1;
    const SimulatedFrame a = Picture(street, camera, 2, 1.0);
    const SimulatedFrame b = Picture(street, camera, 2, 1.1);
    const auto [median, most] = Disagreement(a, b, camera);
    EXPECT_LT(median, 0.002) << "k1 " << k1;
    EXPECT_LT(most, 0.01) << "k1 " << k1;
  }
}

TEST(Truth, HazardsLieWhereTheyAreSaidToLie) {
  WorldDescription world;
  world.hazards.emplace();
  PlacedHazard placed;
  placed.object_class = ObjectClass::kTrafficCone;
  placed.at_m = 30;
  placed.left_m = -2.2;
  world.hazards->push_back(placed);
  world.parked_cars = false;
  const Street street(world, 3, 400, true);
  const SimulatedCamera camera = StreetCamera();
  const SimulatedFrame frame = Picture(street, camera, 2, 0);
  const std::vector<HazardInView> hazards = FindHazards(frame.instances, frame.outlines);
  ASSERT_EQ(hazards.size(), 1U);
  const Eigen::Vector3d foot = street.line().At(30, -2.2, -0.04);
  const Eigen::Vector2d pixel = camera.Project(frame.world_from_optical.inverse() * foot);
  const cv::Rect& box = hazards[0].box;
  EXPECT_NEAR(pixel.x(), box.x + 0.5 * (box.width - 1), 1.5);
  EXPECT_NEAR(pixel.y(), box.br().y - 1, 2.5);
}

TEST(Truth, OutlinesCountWhatIsHiddenToo) {
  WorldDescription world;
  world.hazards.emplace();
  PlacedHazard placed;
  placed.object_class = ObjectClass::kTrafficCone;
  placed.at_m = 24;
  placed.left_m = 0.8;
  world.hazards->push_back(placed);
  placed.object_class = ObjectClass::kConstructionMachine;
  placed.at_m = 25;
  placed.left_m = -2.2;
  world.hazards->push_back(placed);
  placed.object_class = ObjectClass::kTrafficCone;
  placed.at_m = 36;
  world.hazards->push_back(placed);
  world.parked_cars = false;
  const Street street(world, 3, 400, true);
  const SimulatedFrame frame = Picture(street, StreetCamera(), 2, 0);
  std::map<std::uint32_t, int> visible;
  for (const HazardInView& hazard : FindHazards(frame.instances, frame.outlines)) {
    visible[hazard.instance] = hazard.visible_pixels;
  }
  int hidden = 0;
  for (const auto& [instance, pixels] : frame.outlines) {
    const auto seen = visible.find(instance);
    if (seen == visible.end()) {
      EXPECT_EQ(ClassOfInstance(instance), ObjectClass::kTrafficCone);
      ++hidden;
    } else {
      // A ray meets a pixel's middle only, an outline counts each pixel that it touches.
      EXPECT_GE(pixels, seen->second) << ClassName(ClassOfInstance(instance));
      EXPECT_LT(pixels, 1.5 * seen->second) << ClassName(ClassOfInstance(instance));
    }
  }
  EXPECT_EQ(hidden, 1) << "the cone behind the machine";
  EXPECT_EQ(visible.size(), 2U) << "the cone beside it and the machine";
}

TEST(Camera, DistortionAndItsInverseAgree) {
  SimulatedCamera camera;
  camera.k1 = -0.25;
  camera.k2 = 0.06;
  for (double column = 0; column < 640; column += 71) {
    for (double row = 0; row < 480; row += 53) {
      const Eigen::Vector2d back = camera.Project(7 * camera.Ray(column, row));
      EXPECT_LT((back - Eigen::Vector2d(column, row)).norm(), 1e-3);
    }
  }
}

TEST(Camera, NoiseGrowsWithLight) {
  SimulatedCamera camera;
  camera.vignetting = 0;
  camera.intrinsics.width = 200;
  cv::Mat light(2, 200, CV_32FC3, cv::Scalar(0.4, 0.4, 0.4));
  light.row(1) = cv::Scalar(0.05, 0.05, 0.05);
  cv::Mat bgr(2, 200, CV_8UC3);
  DevelopRow(camera, light, 0, 1, 9, bgr);
  DevelopRow(camera, light, 1, 1, 9, bgr);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(bgr.row(0), mean, deviation);
  EXPECT_GT(deviation[0], 0.3);
  EXPECT_LT(deviation[0], 4);
  EXPECT_GT(mean[0], 100);
}

}  // namespace
}  // namespace livemap::simulation
