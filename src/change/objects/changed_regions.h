#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "change/methods/change_probabilities.h"
#include "protocol/change_class.h"

namespace livemap::change {

/// Whether the earlier or the later drive has what changed.
enum class ChangeDirection { kUnknown, kAppeared, kVanished };

/// A connected piece of one picture that changed.
struct ChangeRegion {
  protocol::ChangeClass change_class = protocol::ChangeClass::kNoChange;
  cv::Rect box;  ///< Pixels.
  int pixels = 0;
  double confidence = 0;  ///< Mean probability that its pixels changed, 0 to 1.
  ChangeDirection direction = ChangeDirection::kUnknown;
};

/// What counts as a region.
struct ChangeRegionConfig {
  int min_pixels = 60;          ///< Smaller pieces are noise; of a picture 320 wide.
  double min_confidence = 0.5;  ///< Of a pixel that makes a region.
  /// Of a pixel that a region takes in besides, as a share of min_confidence: a network is unsure
  /// at outlines, and where an object meets the ground is what says where it stands.
  double rim_share = 0.5;
  int rim_px = 8;  ///< How far from a pixel that makes the region; of a picture 320 wide.
};

/// CV_8UC1: where the probability of change is at least `min_confidence` the likeliest class of
/// change (of probabilities without classes kOtherObjects), elsewhere kNoChange.
cv::Mat ChangedClasses(const ChangeProbabilities& probabilities, double min_confidence);

/// Connected regions of change, the largest first: the pixels of ChangedClasses, joined over eight
/// neighbours whatever their class, with their rim; a region has the class of most of the pixels
/// that make it, and their confidence. `before` and `after` are the aligned pictures (CV_8UC3,
/// BGR); a region's direction is ChangeDirectionEstimator's. Throws Error when the sizes differ.
std::vector<ChangeRegion> FindChangeRegions(const ChangeProbabilities& probabilities,
                                            const cv::Mat& before, const cv::Mat& after,
                                            const ChangeRegionConfig& options = {});

}  // namespace livemap::change
