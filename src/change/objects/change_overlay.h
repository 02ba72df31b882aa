#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "change/objects/changed_regions.h"

namespace livemap::change {

/// `bgr` with the changed classes in their colours, regions boxed with class and direction, and
/// darker where nothing earlier is known. `classes` as in ChangeDetector::Answer.
cv::Mat DrawChanges(const cv::Mat& bgr, const cv::Mat& classes,
                    const std::vector<ChangeRegion>& regions);

}  // namespace livemap::change
