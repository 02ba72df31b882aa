#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "drives/camera_file.h"
#include "drives/generated_world.h"

namespace livemap {

/// A hazard as a picture shows it.
struct VisibleHazard {
  int id = 0;
  std::string class_name;
  cv::Rect2d box;  ///< Pixels, (0, 0) the outer corner of the first pixel; inside the image.
};

/// Draws a generated world as the camera of a vehicle on its line sees it. The same world, camera
/// and sequence of calls give the same pictures. Not thread-safe.
class GeneratedDriveRenderer {
 public:
  GeneratedDriveRenderer(const GeneratedWorld& world, const CameraFile& camera);
  ~GeneratedDriveRenderer();

  /// The picture from `along_m` (not decreasing from call to call), CV_8UC3 BGR.
  cv::Mat Render(double along_m);
  /// The hazards that the picture shows: at most 35 m ahead, box at least 12x5 pixels, most of it
  /// inside the image.
  std::vector<VisibleHazard> Visible(double along_m) const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace livemap
