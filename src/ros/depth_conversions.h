#pragma once

#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>

namespace livemap {

/// A depth image (16UC1 or MONO16 in 1 / `units_per_m`, 32FC1 in metres; REP 118) as CV_32FC1
/// metres of `size`, each pixel the nearest one's: depths are not mixed. 0 and NaN are unknown.
/// Throws Error for another encoding, or another shape than that of `size`.
cv::Mat ToDepthMetres(const sensor_msgs::ImageConstPtr& message, cv::Size size, double units_per_m);

}  // namespace livemap
