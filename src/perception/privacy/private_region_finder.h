#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap::perception {

/// Finds what must not leave the car: faces and number plates. Not thread-safe.
class PrivateRegionFinder {
 public:
  virtual ~PrivateRegionFinder() = default;

  /// All that meets `part` of `bgr` (8 bit, 3 channels), as rectangles in pixels of `bgr` and
  /// inside it; others may be among them. Throws Error when it cannot say.
  virtual std::vector<cv::Rect> Find(const cv::Mat& bgr, const cv::Rect& part) = 0;
};

struct PrivateRegionConfig {
  /// Folder of OpenCV's Haar cascades (Debian's opencv-data): frontal and profile faces, plates.
  std::string cascades = "/usr/share/opencv4/haarcascades";
  /// A YuNet model (ONNX) that looks for faces instead of the cascades; empty: none.
  std::string face_model;
  int min_side_px = 16;  ///< Smaller faces and plates are not looked for; nobody knows them by it.
};

/// Throws Error naming the file that cannot be loaded: who has no finder sends no picture.
std::unique_ptr<PrivateRegionFinder> MakePrivateRegionFinder(const PrivateRegionConfig& config);

}  // namespace livemap::perception
