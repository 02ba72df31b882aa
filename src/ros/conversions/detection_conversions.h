#pragma once

#include <livemap/DetectionArray.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/Header.h>

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "perception/detection/hazard_detection.h"

namespace livemap::ros_io {

/// The message for the answer to one image. `header` is the image's, `image_size` in px,
/// `inference_ms` the wall time that it took.
DetectionArray ToMessage(const std::vector<perception::HazardDetection>& detections,
                         const std_msgs::Header& header, const std::string& model,
                         cv::Size image_size, double inference_ms);

/// A bgr8 message of `bgr` with the detections drawn in, with the image's header: one copy of the
/// pixels.
sensor_msgs::ImagePtr ToAnnotatedMessage(const cv::Mat& bgr,
                                         const std::vector<perception::HazardDetection>& detections,
                                         const std_msgs::Header& header);

}  // namespace livemap::ros_io
