#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "simulation/datasets/labels_in_view.h"

namespace livemap::simulation {

/// Each class in its colour, for looking at truth; CV_8UC3.
cv::Mat ColourClasses(const cv::Mat& classes);
/// Near warm, far cold, sky black; CV_8UC3.
cv::Mat ColourDepth(const cv::Mat& depth);
/// Draws boxes with class names into a picture.
void DrawHazards(const std::vector<HazardInView>& hazards, cv::Mat& bgr);

}  // namespace livemap::simulation
