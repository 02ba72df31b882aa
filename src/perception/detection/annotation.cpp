#include "perception/detection/annotation.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "common/error.h"
#include "common/text.h"

namespace livemap::perception {
namespace {

/// Colours that stand out from asphalt, vegetation and sky, by class index.
const std::array<cv::Scalar, 6> kColours = {cv::Scalar(0, 0, 230),  cv::Scalar(0, 140, 255),
                                            cv::Scalar(220, 60, 0), cv::Scalar(200, 0, 200),
                                            cv::Scalar(0, 160, 0),  cv::Scalar(160, 160, 0)};

std::string AnnotationLabelOf(const HazardDetection& detection) {
  std::string label = detection.class_name.substr(0, 40);
  // OpenCV's stroke fonts have no other characters.
  std::replace_if(
      label.begin(), label.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  std::array<char, 16> confidence{};
  std::snprintf(confidence.data(), confidence.size(), " %.2f", double{detection.confidence});
  return label + confidence.data();
}

void DrawAnnotationLabel(cv::Mat& bgr, const cv::Rect& frame, const std::string& label,
                         const cv::Scalar& colour, double font_scale, int thickness) {
  int baseline = 0;
  const cv::Size text =
      cv::getTextSize(label, cv::FONT_HERSHEY_SIMPLEX, font_scale, thickness, &baseline);
  const int margin = 2 * thickness;
  const cv::Size plate(text.width + 2 * margin, text.height + baseline + 2 * margin);
  // Above the frame where there is room, else below it, else inside the image's edge.
  int top = frame.y - plate.height;
  if (top < 0) top = frame.y + frame.height;
  top = std::max(0, std::min(top, bgr.rows - plate.height));
  const int left = std::max(0, std::min(frame.x, bgr.cols - plate.width));
  cv::rectangle(bgr, cv::Rect({left, top}, plate), colour, cv::FILLED);
  cv::putText(bgr, label, {left + margin, top + margin + text.height}, cv::FONT_HERSHEY_SIMPLEX,
              font_scale, cv::Scalar(255, 255, 255), thickness, cv::LINE_AA);
}

}  // namespace

void AnnotateImage(cv::Mat& bgr, const std::vector<HazardDetection>& detections) {
  if (bgr.empty() || bgr.dims != 2 || bgr.type() != CV_8UC3) {
    throw Error("an image to annotate is empty or has " +
                PixelText(static_cast<int>(8 * bgr.elemSize1()), bgr.channels()) +
                ", accepted are " + PixelText(8, 3) + " (BGR)");
  }
  const double size = std::max(bgr.rows, bgr.cols);
  const double font_scale = std::max(0.4, size / 1300);
  const int thickness = std::max(1, cvRound(size / 640));
  std::vector<std::pair<cv::Rect, cv::Scalar>> frames;
  // The most confident last, so that its label lies on top.
  for (auto detection = detections.rbegin(); detection != detections.rend(); ++detection) {
    const cv::Rect frame(cvFloor(detection->box.x), cvFloor(detection->box.y),
                         cvCeil(detection->box.width), cvCeil(detection->box.height));
    const cv::Scalar& colour =
        kColours[static_cast<std::size_t>(detection->class_index) % kColours.size()];
    DrawAnnotationLabel(bgr, frame, AnnotationLabelOf(*detection), colour, font_scale, thickness);
    frames.emplace_back(frame, colour);
  }
  // No label hides where another hazard is.
  for (const auto& [frame, colour] : frames) cv::rectangle(bgr, frame, colour, thickness + 1);
}

}  // namespace livemap::perception
