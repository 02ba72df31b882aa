#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace livemap::perception {

/// What a network of faces or plates found.
struct ScoredBox {
  cv::Rect2f box;  ///< px
  float score = 0;
};

/// Of boxes that overlap by more than `iou_limit` (intersection over union) the one with the higher
/// score alone stays. Descending scores.
std::vector<ScoredBox> Suppressed(const std::vector<ScoredBox>& boxes, float iou_limit);

/// A box of a crop, whose pixels are those of the picture, in the picture.
cv::Rect2f Moved(const cv::Rect2f& in_crop, const cv::Point& crop_in_picture);

/// The whole pixels of the picture that a box touches; empty where it lies beyond the picture or is
/// not a number.
cv::Rect PixelsOf(const cv::Rect2f& box, const cv::Size& picture);

}  // namespace livemap::perception
