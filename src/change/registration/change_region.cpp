#include "change/registration/change_region.h"

#include <array>
#include <opencv2/imgproc.hpp>

#include "common/error.h"

namespace livemap::change {
namespace {

/// Shares of the width and the height, round the road; training/change/roads.py has the same.
const std::array<cv::Point2d, 6> kRoadOutline{
    {{0.35, 0.42}, {0.65, 0.42}, {1.0, 0.8}, {1.0, 1.0}, {0.0, 1.0}, {0.0, 0.8}}};

}  // namespace

std::vector<std::string> ChangeRegionNames() { return {"all", "road"}; }

cv::Mat ChangeRegionMask(const std::string& name, cv::Size size) {
  if (name == "all") return {size, CV_8UC1, cv::Scalar(255)};
  if (name != "road") throw Error("region '" + name + "' is unknown, accepted are all and road");
  std::vector<cv::Point> outline;
  outline.reserve(kRoadOutline.size());
  for (const cv::Point2d& corner : kRoadOutline) {
    outline.emplace_back(cvRound(corner.x * size.width), cvRound(corner.y * size.height));
  }
  cv::Mat mask(size, CV_8UC1, cv::Scalar(0));
  cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{outline}, cv::Scalar(255));
  return mask;
}

}  // namespace livemap::change
