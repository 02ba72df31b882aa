#pragma once

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>

namespace livemap::ros_io {

/// A depth image without a copy: CV_16UC1 (16UC1, MONO16) or CV_32FC1 in metres (32FC1; REP 118).
/// Throws Error for another encoding, or where the data do not fill the image.
cv_bridge::CvImageConstPtr ToSharedDepth(const sensor_msgs::ImageConstPtr& message);

/// A depth image (16UC1 or MONO16 in 1 / `units_per_m`, 32FC1 in metres; REP 118) as CV_32FC1
/// metres of `size`, each pixel the nearest one's: depths are not mixed. 0 and NaN are unknown.
/// Throws Error as ToSharedDepth does, and for another shape than that of `size`.
cv::Mat ToDepthMetres(const sensor_msgs::ImageConstPtr& message, cv::Size size, double units_per_m);

}  // namespace livemap::ros_io
