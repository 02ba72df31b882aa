#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

namespace livemap::change {

/// SIFT features of one picture. Source: D. G. Lowe, "Distinctive Image Features from
/// Scale-Invariant Keypoints", IJCV 60(2), 2004.
struct ImageFeatures {
  std::vector<cv::Point2f> points;  ///< Pixels; (0, 0) is the centre of the first one.
  cv::Mat descriptors;              ///< CV_8UC1, 128 columns, one row per point.

  std::size_t Bytes() const { return points.size() * (sizeof(cv::Point2f) + 128) + 128; }
};

/// What is looked for in a picture.
struct FeatureConfig {
  int max_features = 600;  ///< The ones with the strongest contrast are kept.
  double contrast_threshold = 0.02;
  double edge_threshold = 10;
};

/// `image`: CV_8UC1 or CV_8UC3 (BGR); Error otherwise. A picture without texture has no features.
ImageFeatures ExtractFeatures(const cv::Mat& image, const FeatureConfig& options = {});

/// Indices of features that match: the nearest of the other picture, nearer than `ratio` times the
/// second nearest (Lowe 2004, 7.1), and that in both directions.
std::vector<std::pair<int, int>> MatchFeatures(const ImageFeatures& a, const ImageFeatures& b,
                                               double ratio);

}  // namespace livemap::change
