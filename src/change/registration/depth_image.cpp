#include "change/registration/depth_image.h"

#include <string>

#include "common/error.h"

namespace livemap::change {

void CheckDepthImage(const cv::Mat& depth, cv::Size size) {
  if (depth.type() == CV_32FC1 && depth.size() == size) return;
  throw Error("a depth image is " + std::to_string(depth.cols) + "x" + std::to_string(depth.rows) +
              ", accepted is single precision of its picture's size, " +
              std::to_string(size.width) + "x" + std::to_string(size.height));
}

}  // namespace livemap::change
