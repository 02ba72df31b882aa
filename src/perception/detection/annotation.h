#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "perception/detection/hazard_detection.h"

namespace livemap::perception {

/// Draws a frame and a label ("pothole 0.83") for each detection into `bgr` (8 bit, 3 channels;
/// anything else throws Error). Line and text grow with the image; labels stay inside it. Class
/// names are drawn in ASCII, other characters as '?'.
void AnnotateImage(cv::Mat& bgr, const std::vector<HazardDetection>& detections);

}  // namespace livemap::perception
