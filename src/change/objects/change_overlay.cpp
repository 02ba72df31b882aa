#include "change/objects/change_overlay.h"

#include <opencv2/imgproc.hpp>

#include "common/error.h"

namespace livemap::change {
namespace {

constexpr double kColourShare = 0.5;
constexpr double kUnknownLight = 0.4;
constexpr double kTextHeight = 0.4;

cv::Scalar OverlayColourOf(protocol::ChangeClass change_class) {
  const auto rgb = protocol::ChangeClassColour(change_class);
  return {static_cast<double>(rgb[2]), static_cast<double>(rgb[1]), static_cast<double>(rgb[0])};
}

std::string OverlayLabelOf(const ChangeRegion& region) {
  const char* sign = region.direction == ChangeDirection::kAppeared   ? "+ "
                     : region.direction == ChangeDirection::kVanished ? "- "
                                                                      : "";
  return std::string(sign) + protocol::ChangeClassName(region.change_class);
}

}  // namespace

cv::Mat DrawChanges(const cv::Mat& bgr, const cv::Mat& classes,
                    const std::vector<ChangeRegion>& regions) {
  if (bgr.type() != CV_8UC3 || classes.type() != CV_8UC1 || bgr.size() != classes.size()) {
    throw Error("changes to draw are " + std::to_string(classes.cols) + "x" +
                std::to_string(classes.rows) + ", accepted is the size of their colour picture, " +
                std::to_string(bgr.cols) + "x" + std::to_string(bgr.rows));
  }
  cv::Mat drawn = bgr.clone();
  cv::Mat dark;
  bgr.convertTo(dark, -1, kUnknownLight);
  dark.copyTo(drawn, classes == kLeftOutPixel);
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    const cv::Mat here = classes == i;
    const cv::Mat colour(bgr.size(), CV_8UC3,
                         OverlayColourOf(static_cast<protocol::ChangeClass>(i)));
    cv::Mat blended;
    cv::addWeighted(bgr, 1 - kColourShare, colour, kColourShare, 0, blended);
    blended.copyTo(drawn, here);
  }
  for (const ChangeRegion& region : regions) {
    const cv::Scalar colour = OverlayColourOf(region.change_class);
    cv::rectangle(drawn, region.box, colour, 1);
    cv::putText(drawn, OverlayLabelOf(region), region.box.tl() + cv::Point(0, -3),
                cv::FONT_HERSHEY_SIMPLEX, kTextHeight, colour, 1, cv::LINE_AA);
  }
  return drawn;
}

}  // namespace livemap::change
