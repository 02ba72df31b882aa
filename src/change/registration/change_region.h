#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap::change {

/// Names of the regions of a picture that can be measured: "all" and "road".
std::vector<std::string> ChangeRegionNames();

/// CV_8UC1 of `size`: 255 within the region, else 0. "road" is where a forward camera sees the road
/// it drives on, whatever stands there: from a strip a third of the width below the horizon, at
/// 0.42 of the height, it widens to the whole width at 0.8 of the height and below. Throws Error
/// naming the regions for any other name.
cv::Mat ChangeRegionMask(const std::string& name, cv::Size size);

}  // namespace livemap::change
