#include "placement/hazard_placement.h"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

namespace livemap::placement {
namespace {

constexpr geo::GeoPoint kAntenna{40.4433, -79.9436};

geo::TrackPose Pose(double course_rad) {
  geo::TrackPose pose;
  pose.position = kAntenna;
  pose.course_rad = course_rad;
  return pose;
}

TEST(PlaceHazard, AheadLiesAlongTheCourseAndLeftLiesToItsLeft) {
  for (const double course : {0.0, 0.8, M_PI / 2, 3.0, -2.0}) {
    const auto ahead = PlaceHazard(Pose(course), {0, 0}, {{20.0, 0.0}, Eigen::Matrix2d::Zero()});
    EXPECT_LT(
        geo::GeodesicDistanceM(ahead.position, geo::GeodesicDestination(kAntenna, course, 20)),
        1e-3);
    const auto left = PlaceHazard(Pose(course), {0, 0}, {{0.0, 5.0}, Eigen::Matrix2d::Zero()});
    EXPECT_LT(geo::GeodesicDistanceM(left.position,
                                     geo::GeodesicDestination(kAntenna, course - M_PI / 2, 5)),
              1e-3);
  }
}

TEST(PlaceHazard, AntennaOfTheVehicleIsTakenIntoAccount) {
  // Antenna 1.5 m behind base_link's origin and 0.4 m to the right; vehicle drives east.
  const auto placed =
      PlaceHazard(Pose(M_PI / 2), {-1.5, -0.4}, {{10.0, 0.0}, Eigen::Matrix2d::Zero()});
  const Eigen::Vector2d offset_m = geo::LocalFrame(kAntenna).ToEnu(placed.position);
  EXPECT_NEAR(offset_m.x(), 11.5, 1e-6);
  EXPECT_NEAR(offset_m.y(), 0.4, 1e-6);
}

TEST(PlaceHazard, CovarianceIsThatOfManyNoisyPlacements) {
  geo::TrackPose pose = Pose(0.6);
  pose.covariance_m2 << 0.5, 0.1, 0.1, 0.3;
  pose.course_variance_rad2 = 0.03 * 0.03;
  geo::GroundPoint ground{{18.0, -2.0}, Eigen::Matrix2d::Zero()};
  ground.covariance_m2 << 1.2, -0.1, -0.1, 0.05;
  const auto placed = PlaceHazard(pose, {1.0, 0.2}, ground);

  std::mt19937_64 random{5};
  std::normal_distribution<double> unit(0, 1);
  const auto draw = [&](const Eigen::Matrix2d& covariance) {
    const Eigen::Matrix2d root = covariance.llt().matrixL();
    const double first = unit(random);
    return Eigen::Vector2d(root * Eigen::Vector2d(first, unit(random)));
  };
  const geo::LocalFrame frame(kAntenna);
  const Eigen::Vector2d mean_m = frame.ToEnu(placed.position);
  Eigen::Matrix2d sampled = Eigen::Matrix2d::Zero();
  constexpr int kDraws = 40000;
  for (int i = 0; i < kDraws; ++i) {
    geo::TrackPose noisy_pose = pose;
    noisy_pose.position = frame.ToGeo(draw(pose.covariance_m2));
    noisy_pose.course_rad += 0.03 * unit(random);
    geo::GroundPoint noisy_ground = ground;
    noisy_ground.position_m += draw(ground.covariance_m2);
    const Eigen::Vector2d error_m =
        frame.ToEnu(PlaceHazard(noisy_pose, {1.0, 0.2}, noisy_ground).position) - mean_m;
    sampled += error_m * error_m.transpose() / kDraws;
  }
  EXPECT_LT((sampled - placed.covariance_m2).norm(), 0.04 * placed.covariance_m2.norm());
}

TEST(MiddleOf, LiesBehindTheFootFromWhereTheVehicleSeesIt) {
  const geo::GeoPoint vehicle{40.4433, -79.9436};
  const geo::LocalFrame frame(vehicle);
  PlacedHazard foot{frame.ToGeo(Eigen::Vector2d(9, 12)), Eigen::Matrix2d::Identity()};
  const PlacedHazard middle = MiddleOf(foot, vehicle, 0.5);
  EXPECT_LT((frame.ToEnu(middle.position) - Eigen::Vector2d(9.3, 12.4)).norm(), 1e-3);
  // Half of the half depth, in that direction alone.
  const Eigen::Vector2d along(0.6, 0.8), across(-0.8, 0.6);
  EXPECT_NEAR(along.dot(middle.covariance_m2 * along), 1 + 0.25 * 0.25, 1e-9);
  EXPECT_NEAR(across.dot(middle.covariance_m2 * across), 1, 1e-9);
  foot.position = frame.ToGeo(Eigen::Vector2d(0.3, 0.4));
  const PlacedHazard below = MiddleOf(foot, vehicle, 0.5);
  EXPECT_EQ(below.position.latitude_deg, foot.position.latitude_deg);
}

}  // namespace
}  // namespace livemap::placement
