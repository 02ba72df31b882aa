#include "simulation/datasets/truth_pictures.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace livemap::simulation {

cv::Mat ColourClasses(const cv::Mat& classes) {
  cv::Mat hue(classes.size(), CV_8UC3);
  for (int row = 0; row < classes.rows; ++row) {
    for (int column = 0; column < classes.cols; ++column) {
      const int value = classes.at<std::uint8_t>(row, column);
      const bool hazard = IsHazard(static_cast<ObjectClass>(value));
      hue.at<cv::Vec3b>(row, column) =
          cv::Vec3b(static_cast<std::uint8_t>(value * 41 % 180), hazard ? 255 : 90,
                    value == 0 ? 0 : (hazard ? 255 : 150));
    }
  }
  cv::Mat bgr;
  cv::cvtColor(hue, bgr, cv::COLOR_HSV2BGR);
  return bgr;
}

cv::Mat ColourDepth(const cv::Mat& depth) {
  cv::Mat coded(depth.size(), CV_8UC1);
  for (int row = 0; row < depth.rows; ++row) {
    for (int column = 0; column < depth.cols; ++column) {
      const float metres = depth.at<float>(row, column);
      const float share = metres > 0 ? 255.0F * Saturate(3.0F / (metres + 1.0F)) : 0.0F;
      coded.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(share);
    }
  }
  cv::Mat bgr;
  cv::applyColorMap(coded, bgr, cv::COLORMAP_TURBO);
  bgr.setTo(cv::Scalar(0, 0, 0), depth <= 0);
  return bgr;
}

void DrawHazards(const std::vector<HazardInView>& hazards, cv::Mat& bgr) {
  for (const HazardInView& hazard : hazards) {
    cv::rectangle(bgr, hazard.box, cv::Scalar(0, 255, 255), 1);
    cv::putText(bgr, ClassName(hazard.object_class), {hazard.box.x, std::max(10, hazard.box.y - 3)},
                cv::FONT_HERSHEY_SIMPLEX, 0.4, cv::Scalar(0, 255, 255), 1, cv::LINE_AA);
  }
}

}  // namespace livemap::simulation
