#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "change/objects/change_tracker.h"

namespace livemap::change {

/// Tells which of two aligned pictures has what changed. Where a thing stands its colours differ
/// from those around it and its outline is an edge; where it is gone what lies around it goes on.
/// Light and season change both pictures as a whole, hence only ratios within one count.
class ChangeDirectionEstimator {
 public:
  /// CV_8UC3, BGR, of one size.
  ChangeDirectionEstimator(const cv::Mat& before, const cv::Mat& after);
  ~ChangeDirectionEstimator();

  /// `region`: CV_8UC1 of the pictures' size, 255 on the region, which lies within `box`.
  ChangeDirection Of(const cv::Mat& region, const cv::Rect& box) const;

 private:
  struct Picture;
  std::unique_ptr<Picture> before_;
  std::unique_ptr<Picture> after_;
};

}  // namespace livemap::change
