#include "ros/conversions/depth_conversions.h"

#include <sensor_msgs/image_encodings.h>

#include <cmath>
#include <exception>
#include <opencv2/imgproc.hpp>
#include <string>

#include "common/error.h"

namespace livemap::ros_io {

cv_bridge::CvImageConstPtr ToSharedDepth(const sensor_msgs::ImageConstPtr& message) {
  namespace encodings = sensor_msgs::image_encodings;
  const std::string& encoding = message->encoding;
  if (encoding != encodings::TYPE_16UC1 && encoding != encodings::MONO16 &&
      encoding != encodings::TYPE_32FC1) {
    throw Error("depth has encoding '" + encoding + "', accepted are 16UC1 and 32FC1");
  }
  try {
    return cv_bridge::toCvShare(message);
  } catch (const std::exception& error) {  // of cv_bridge or OpenCV
    throw Error(std::string("depth image cannot be read: ") + error.what());
  }
}

cv::Mat ToDepthMetres(const sensor_msgs::ImageConstPtr& message, cv::Size size,
                      double units_per_m) {
  const cv_bridge::CvImageConstPtr shared = ToSharedDepth(message);
  const cv::Mat& depth = shared->image;
  // A pixel of rounding in either direction.
  if (depth.empty() || std::abs(1.0 * depth.cols * size.height - 1.0 * depth.rows * size.width) >
                           depth.cols + size.width) {
    throw Error("depth is " + std::to_string(depth.cols) + "x" + std::to_string(depth.rows) +
                ", accepted is the shape of its image, " + std::to_string(size.width) + "x" +
                std::to_string(size.height));
  }
  cv::Mat metres;
  depth.convertTo(metres, CV_32FC1, depth.type() == CV_16UC1 ? 1 / units_per_m : 1);
  if (metres.size() != size) cv::resize(metres, metres, size, 0, 0, cv::INTER_NEAREST);
  return metres;
}

}  // namespace livemap::ros_io
