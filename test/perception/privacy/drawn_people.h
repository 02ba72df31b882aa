#pragma once

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

namespace livemap::perception {

/// A drawn face looking at the camera, `height` pixels from chin to hair, around `centre`.
inline void DrawFace(cv::Mat& bgr, cv::Point centre, int height) {
  const auto part = [&](double x, double y, double width, double height_share, cv::Scalar colour) {
    const cv::Point middle(centre.x + cvRound(x * height), centre.y + cvRound(y * height));
    const cv::Size axes(std::max(1, cvRound(width * height)),
                        std::max(1, cvRound(height_share * height)));
    cv::ellipse(bgr, middle, axes, 0, 0, 360, colour, cv::FILLED, cv::LINE_AA);
  };
  part(0, -0.15, 0.48, 0.55, {30, 40, 50});  // Hair.
  part(0, 0, 0.40, 0.52, {140, 170, 215});
  for (const double side : {-0.17, 0.17}) {
    part(side, -0.10, 0.10, 0.05, {90, 110, 150});
    part(side, -0.10, 0.07, 0.03, {240, 240, 240});
    part(side, -0.10, 0.03, 0.03, {20, 20, 20});
    part(side, -0.19, 0.10, 0.03, {30, 40, 60});  // Brow.
  }
  part(0, 0.08, 0.06, 0.10, {120, 150, 195});
  part(-0.04, 0.15, 0.02, 0.015, {60, 80, 110});
  part(0.04, 0.15, 0.02, 0.015, {60, 80, 110});
  part(0, 0.30, 0.15, 0.04, {70, 70, 160});
}

/// A white number plate in a black frame, its upper left corner at `corner`.
inline void DrawPlate(cv::Mat& bgr, cv::Point corner, int width, const std::string& number) {
  const int height = cvRound(width / 4.6);
  const cv::Rect plate(corner, cv::Size(width, height));
  cv::rectangle(bgr, cv::Rect(plate.x - 3, plate.y - 3, width + 6, height + 6), {20, 20, 20},
                cv::FILLED);
  cv::rectangle(bgr, plate, {235, 235, 235}, cv::FILLED);
  cv::putText(bgr, number, {plate.x + width * 8 / 100, plate.y + height * 8 / 10},
              cv::FONT_HERSHEY_SIMPLEX, height / 30.0, {10, 10, 10}, std::max(1, height / 9),
              cv::LINE_AA);
}

}  // namespace livemap::perception
