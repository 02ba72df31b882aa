#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace livemap::perception {

/// One hazard seen in one image. (livemap::Detection is the ROS message.)
struct HazardDetection {
  std::string class_name;  ///< A name of the model's class list.
  int class_index = 0;     ///< Its place in that list.
  float confidence = 0;    ///< 0..1, objectness times class score.
  cv::Rect2f box;          ///< px of the given image, inside it, never empty.
};

}  // namespace livemap::perception
