#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>

#include "simulation/render/hazard_outline.h"
#include "simulation/render/lighting.h"
#include "simulation/render/simulated_camera.h"
#include "simulation/render/street_scene.h"
#include "simulation/world/street.h"

namespace livemap::simulation {

/// A picture with the whole truth about it. All images have the camera's size; (0, 0) is the centre
/// of the first pixel.
struct SimulatedFrame {
  cv::Mat bgr;        ///< CV_8UC3.
  cv::Mat depth;      ///< CV_32FC1, metres along the optical axis; 0: sky.
  cv::Mat classes;    ///< CV_8UC1, ObjectClass.
  cv::Mat instances;  ///< CV_32SC1, see MakeInstance.
  OutlinePixels outlines;
  Eigen::Isometry3d world_from_optical = Eigen::Isometry3d::Identity();
};

/// Where a camera is and where it will be at the exposure's end; equal without motion blur.
struct CameraExposure {
  Eigen::Isometry3d world_from_optical = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d world_from_optical_end = Eigen::Isometry3d::Identity();
  double along_m = 0;  ///< Along the road, which part of the street is needed.
};

struct RenderConfig {
  int threads = 2;
  bool smooth_edges = true;  ///< More rays where neighbouring pixels differ.
};

/// Takes pictures of a street. The same street, camera, light, pose and frame number give the same
/// bytes whatever the number of threads and whatever was rendered before. Not thread-safe.
class StreetRenderer {
 public:
  /// `street` must outlive the renderer.
  StreetRenderer(const Street& street, const SimulatedCamera& camera, const Lighting& lighting,
                 const RenderConfig& options);
  ~StreetRenderer();

  SimulatedFrame Render(const CameraExposure& motion, std::uint32_t frame_number);

 private:
  class Exposure;

  const Street& street_;
  SimulatedCamera camera_;
  Lighting lighting_;
  RenderConfig options_;
  StreetScene scene_;
  std::vector<Vec3> rays_;  ///< Optical frame, z = 1, row by row.
};

/// Calls `work` with 0..count-1 on `threads` threads; rows are handed out as they come.
void ForEachRow(int count, int threads, const std::function<void(int)>& work);

}  // namespace livemap::simulation
