#pragma once

#include <opencv2/core.hpp>

namespace livemap::change {

/// How the road of an earlier picture lies on the road of the later one.
struct RoadAlignment {
  /// Pixel of the earlier picture to pixel of the later one, for what lies on the road's plane.
  cv::Matx33d after_from_before = cv::Matx33d::eye();
  /// Correlation of both pictures' fine structure on the road once they are laid onto each other,
  /// -1 to 1; 0 where they share less than half of the road. 14 pairs of real roads had 0.54 to
  /// 0.86, simulated ones in snow and by day 0.05 to 0.17.
  double agreement = 0;
};

/// A registration of whole pictures (RegisterByEdges) fits a street as a whole, and leaves its road
/// off by tens of pixels where the second drive stood elsewhere. This brings the road alone into
/// place: dense optical flow (Kroeger et al. 2016) on the road region, and the homography that most
/// of it follows, four times. `before` and `after`: CV_8UC3 of one size, `before` roughly
/// registered and known where `valid` (CV_8UC1) is not 0. Throws Error for other pictures.
RoadAlignment AlignRoad(const cv::Mat& before, const cv::Mat& after, const cv::Mat& valid);

}  // namespace livemap::change
