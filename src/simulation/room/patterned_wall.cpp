#include "simulation/room/patterned_wall.h"

#include <cmath>

namespace livemap::simulation {
namespace {

constexpr double kDistanceM = 2;

/// Grey value of the wall: patches with edges about a centimetre wide, no two alike.
double WallPattern(double x, double y) {
  const double patches = std::tanh(6 * std::sin(9 * x + 3 * std::sin(4 * y))) +
                         std::tanh(6 * std::sin(8 * y + 2 * std::sin(5 * x)));
  return 128 + 38 * patches + 12 * std::sin(23 * x + 17 * y);
}

}  // namespace

PatternedWall::View PatternedWall::See(const geo::CameraIntrinsics& camera,
                                       const Eigen::Isometry3d& world_from_optical, double gain,
                                       double bias) {
  View view;
  view.grey.create(camera.height, camera.width, CV_8UC1);
  view.depth.create(camera.height, camera.width, CV_32FC1);
  const Eigen::Vector3d normal(0.15, 0.1, 1);  // normal . p = kDistanceM on the wall.
  const Eigen::Vector3d eye = world_from_optical.translation();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray =
          world_from_optical.linear() *
          Eigen::Vector3d((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
      const double distance = (kDistanceM - normal.dot(eye)) / normal.dot(ray);
      const Eigen::Vector3d point = eye + distance * ray;
      view.depth.at<float>(y, x) = static_cast<float>(distance);
      view.grey.at<std::uint8_t>(y, x) =
          cv::saturate_cast<std::uint8_t>(gain * WallPattern(point.x(), point.y()) + bias);
    }
  }
  return view;
}

}  // namespace livemap::simulation
