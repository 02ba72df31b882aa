#pragma once

#include <livemap/ChangedObjects.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/Header.h>

#include <opencv2/core.hpp>
#include <string>

#include "change/objects/change_detector.h"

namespace livemap::ros_io {

/// What a picture that was looked at tells. `header` is the image's, `method` the name of what
/// compared.
ChangedObjects ToMessage(const change::ChangeDetector::Answer& answer,
                         const std_msgs::Header& header, const std::string& drive_id,
                         const std::string& method);

/// A mono8 message of `classes`, or a bgr8 one of a colour picture, with the image's header.
sensor_msgs::ImagePtr ToImageMessage(const cv::Mat& pixels, const std_msgs::Header& header);

}  // namespace livemap::ros_io
