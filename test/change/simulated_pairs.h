#pragma once

#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "datasets/camera_file.h"
#include "simulation/motion/pass_drive.h"
#include "simulation/render/lighting.h"
#include "simulation/render/street_renderer.h"

namespace livemap::change {

/// Two pictures of one place from two drives, with the truth about both.
struct SimulatedPair {
  simulation::SimulatedFrame before;
  simulation::SimulatedFrame after;

  /// Optical frames.
  Eigen::Isometry3d BeforeFromAfter() const {
    return before.world_from_optical.inverse() * after.world_from_optical;
  }
};

/// How the two drives differ.
struct SimulatedPairOptions {
  std::uint64_t seed = 3;
  std::size_t pairs = 4;
  double left_m = 0.5;  ///< The second drive beside the first one.
  simulation::Condition second = simulation::Condition::kDay;
  double changes = 0;
  double every_m = 12;    ///< Along the street.
  double behind_m = 0.2;  ///< The first drive's camera stands this much further back.
};

inline simulation::SimulatedCamera PairCamera() {
  simulation::SimulatedCamera camera;
  camera.intrinsics = geo::CameraIntrinsics{400, 400, 255.5, 191.5, 512, 384};
  return camera;
}

inline std::vector<SimulatedPair> MakePairs(const SimulatedPairOptions& options) {
  constexpr double kSpeedMps = 8;
  const double length_m = 420 + options.every_m * static_cast<double>(options.pairs);
  const auto street = [&](simulation::StreetPass::Which which) {
    return simulation::Street(simulation::WorldDescription(), options.seed, length_m,
                              options.second != simulation::Condition::kSnow,
                              {which, options.changes});
  };
  const simulation::Street first_street = street(simulation::StreetPass::Which::kFirst);
  const simulation::Street second_street = street(simulation::StreetPass::Which::kSecond);
  datasets::CameraMounting mounting;
  mounting.height_m = 1.4;
  simulation::PassManner first;
  first.speed_mps = kSpeedMps;
  first.seconds = 60;
  first.rate_hz = 50;
  simulation::PassManner second = first;
  second.left_m = options.left_m;
  const simulation::PassDrive first_drive(first_street, first, mounting, 0);
  const simulation::PassDrive second_drive(second_street, second, mounting, 0);
  simulation::RenderConfig render;
  render.smooth_edges = false;
  simulation::StreetRenderer first_renderer(
      first_street, PairCamera(),
      simulation::MakeLighting(simulation::Condition::kDay, options.seed), render);
  simulation::StreetRenderer second_renderer(
      second_street, PairCamera(), simulation::MakeLighting(options.second, options.seed + 17),
      render);
  std::vector<SimulatedPair> pairs;
  for (std::size_t i = 0; i < options.pairs; ++i) {
    const double along_m = 20 + options.every_m * static_cast<double>(i);
    const std::size_t a = first_drive.Nearest(along_m - options.behind_m);
    const std::size_t b = second_drive.Nearest(along_m);
    pairs.push_back(
        {first_renderer.Render(first_drive.Camera(a), static_cast<std::uint32_t>(a)),
         second_renderer.Render(second_drive.Camera(b), static_cast<std::uint32_t>(b) + 100000)});
  }
  return pairs;
}

/// Where the truth says that a pixel of the later picture lies in the earlier one; NaN without
/// depth or behind the camera.
inline cv::Point2d TruePlace(const SimulatedPair& pair, const geo::CameraIntrinsics& camera,
                             int column, int row) {
  const auto z = static_cast<double>(pair.after.depth.at<float>(row, column));
  if (z <= 0) return {std::nan(""), std::nan("")};
  const Eigen::Vector3d point =
      pair.BeforeFromAfter() *
      Eigen::Vector3d((column - camera.cx) / camera.fx * z, (row - camera.cy) / camera.fy * z, z);
  if (point.z() <= 0.1) return {std::nan(""), std::nan("")};
  return {camera.fx * point.x() / point.z() + camera.cx,
          camera.fy * point.y() / point.z() + camera.cy};
}

}  // namespace livemap::change
