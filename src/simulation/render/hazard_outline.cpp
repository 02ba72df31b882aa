#include "simulation/render/hazard_outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace livemap::simulation {
namespace {

/// Nearer triangles are left out: they would reach across the whole picture and back.
constexpr double kNearestM = 0.3;
/// cv::fillConvexPoly takes whole numbers of 1/16 px.
constexpr int kSubpixelBits = 4;
/// Beyond so many pixels outside the picture a corner is pulled in, so that whole numbers suffice.
constexpr double kFarOutside = 4096;

using PixelTriangle = std::array<cv::Point, 3>;  // in 1/16 px

cv::Point OutlineSubpixels(const Eigen::Vector2d& pixel) {
  const auto clamp = [](double value) {
    return static_cast<int>(
        std::lround(std::clamp(value, -kFarOutside, kFarOutside) * (1 << kSubpixelBits)));
  };
  return {clamp(pixel.x()), clamp(pixel.y())};
}

int CountOutlinePixelsIn(const std::vector<PixelTriangle>& triangles, const cv::Size& size) {
  cv::Mat covered = cv::Mat::zeros(size, CV_8UC1);
  for (const PixelTriangle& triangle : triangles) {
    cv::fillConvexPoly(covered, triangle.data(), 3, cv::Scalar(1), cv::LINE_8, kSubpixelBits);
  }
  return cv::countNonZero(covered);
}

}  // namespace

OutlinePixels CountOutlinePixels(const StreetScene& scene, const SimulatedCamera& camera,
                                 const Eigen::Isometry3d& world_from_optical) {
  const Eigen::Isometry3d optical_from_world = world_from_optical.inverse();
  std::map<std::uint32_t, std::vector<PixelTriangle>> bodies;
  for (const auto& block : scene.visible()) {
    const Mesh& mesh = block->street.mesh;
    for (const Triangle& triangle : mesh.triangles) {
      if (!IsHazard(ClassOfInstance(triangle.instance))) continue;
      PixelTriangle pixels;
      bool ahead = true;
      for (std::size_t i = 0; i < 3; ++i) {
        const Eigen::Vector3d point =
            optical_from_world *
            (block->street.origin + mesh.positions[triangle.corners[i]].cast<double>());
        ahead = ahead && point.z() > kNearestM;
        if (ahead) pixels[i] = OutlineSubpixels(camera.Project(point));
      }
      if (ahead) bodies[triangle.instance].push_back(pixels);
    }
  }
  OutlinePixels outlines;
  for (const auto& [instance, triangles] : bodies) {
    const int covered =
        CountOutlinePixelsIn(triangles, {camera.intrinsics.width, camera.intrinsics.height});
    if (covered > 0) outlines[instance] = covered;
  }
  return outlines;
}

}  // namespace livemap::simulation
