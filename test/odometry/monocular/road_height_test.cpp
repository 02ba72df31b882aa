#include "odometry/monocular/road_height.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "test/odometry/mounting/synthetic_road.h"

namespace livemap::odometry {
namespace {

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

TEST(RoadHeightOfEdges, IsThatOfTheRoadAmongOtherThings) {
  for (const double pitch_rad : {0.0, 0.1}) {
    const auto height =
        RoadHeightOfEdges(RoadAndOtherThings(1.5, pitch_rad), kRoadCamera, pitch_rad);
    ASSERT_TRUE(height);
    EXPECT_NEAR(*height, 1.5, 0.03);
  }
}

TEST(RoadHeightOfEdges, IsNotKnownWithoutARoad) {
  std::vector<EdgeDepth> edges = RoadAndOtherThings(1.5, 0);
  for (std::size_t i = 0; i < edges.size(); i += 2) edges[i].known = false;
  EXPECT_FALSE(RoadHeightOfEdges(edges, kRoadCamera, 0));
  EXPECT_FALSE(RoadHeightOfEdges({}, kRoadCamera, 0));
}

const Mounting kMeterTruth{Radians(2), Radians(4), Radians(-1.5), 1.37};
constexpr double kUnitsPerMetre = 2.5;

/// What a map in units of 0.4 m has of a drive along the synthetic road.
class RoadHeightMeterTest : public ::testing::Test {
 protected:
  PosedImage At(double way_m, double y_m = 0) const {
    PosedImage image;
    image.world_from_camera = road_.WorldFromCamera(way_m, y_m);
    ImagePyramid smooth;
    smooth.Build(road_.See(image.world_from_camera));
    image.smooth = smooth[0].clone();
    image.world_from_camera.translation() *= kUnitsPerMetre;
    return image;
  }

  /// Edges on a plane that lies so much lower than the road.
  static std::vector<EdgeDepth> Edges(double lower) {
    const Eigen::Vector3d plane =
        AxesInCamera(kMeterTruth).down / (kMeterTruth.height_m * lower * kUnitsPerMetre);
    std::vector<EdgeDepth> edges;
    for (int i = 0; i < 200; ++i) {
      EdgeDepth edge;
      edge.u = static_cast<std::int16_t>(60 + i);
      edge.v = static_cast<std::int16_t>(160 + i * 37 % 70);
      edge.known = true;
      edge.inverse_depth = static_cast<float>(plane.dot(Eigen::Vector3d(
          (edge.u - kRoadEye.cx) / kRoadEye.fx, (edge.v - kRoadEye.cy) / kRoadEye.fy, 1)));
      edge.variance = 1e-6F * edge.inverse_depth * edge.inverse_depth;
      edges.push_back(edge);
    }
    return edges;
  }

  void ExpectTruth(const std::optional<RoadHeight>& height) const {
    ASSERT_TRUE(height);
    EXPECT_NEAR(height->units / kUnitsPerMetre, kMeterTruth.height_m, 0.02);
    EXPECT_LT(height->relative_sigma, 0.05);
  }

  SyntheticRoad road_{kMeterTruth};
  RoadHeightMeter meter_{{}, kRoadEye};
};

TEST_F(RoadHeightMeterTest, TellsTheHeightByTheTextureOfTheLaneWhereTheEdgesAreWrong) {
  ExpectTruth(meter_.Measure(At(1.2), At(0), Edges(1.25)));
}

TEST_F(RoadHeightMeterTest, NeedsNoEdgesOnceThePlaneIsKnown) {
  EXPECT_FALSE(meter_.Measure(At(1.2), At(0), {}));
  ExpectTruth(meter_.Measure(At(1.2), At(0), Edges(1)));
  ExpectTruth(meter_.Measure(At(2.4), At(1.2), {}));
}

TEST_F(RoadHeightMeterTest, WithoutMovingFarTheEdgesTellTheHeightLessSurely) {
  const auto height = meter_.Measure(At(0.1), At(0), Edges(1.1));
  ASSERT_TRUE(height);
  EXPECT_NEAR(height->units / kUnitsPerMetre, 1.1 * kMeterTruth.height_m, 0.03);
  EXPECT_GT(height->relative_sigma, 0.05);
  EXPECT_FALSE(meter_.Measure(At(0), At(0), Edges(1))) << "the camera stood";
  EXPECT_FALSE(meter_.Measure(At(0, 1), At(0), Edges(1))) << "it moved sideways";
}

TEST_F(RoadHeightMeterTest, WhereThePlaneIsLostForLongItBeginsAnew) {
  ExpectTruth(meter_.Measure(At(1.2), At(0), Edges(1)));
  PosedImage dark = At(2.4);
  dark.smooth.setTo(90);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(meter_.Measure(dark, At(1.2), Edges(1.2))) << i;
  const auto by_edges = meter_.Measure(dark, At(1.2), Edges(1.2));
  ASSERT_TRUE(by_edges);
  EXPECT_NEAR(by_edges->units / kUnitsPerMetre, 1.2 * kMeterTruth.height_m, 0.03);
}

TEST_F(RoadHeightMeterTest, APitchThatIsStatedWronglyMisleadsTheEdgesAlone) {
  RoadHeightMeter::Config config;
  config.camera_pitch_rad = kMeterTruth.pitch_rad - Radians(8);
  RoadHeightMeter stated(config, kRoadEye);
  EXPECT_FALSE(stated.Measure(At(1.2), At(0), Edges(1))) << "no edges lie on such a plane";
  config.camera_pitch_rad = kMeterTruth.pitch_rad - Radians(2);
  RoadHeightMeter nearly(config, kRoadEye);
  ExpectTruth(nearly.Measure(At(1.2), At(0), Edges(1)));
}

}  // namespace
}  // namespace livemap::odometry
