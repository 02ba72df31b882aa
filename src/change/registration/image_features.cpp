#include "change/registration/image_features.h"

#include <cmath>
#include <limits>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "common/error.h"

namespace livemap::change {
namespace {

constexpr int kDescriptorBytes = 128;

/// The best partner of each row of `similarity` where it is clear enough. Descriptors have equal
/// lengths, so that of two the one with the greater product is the nearer.
std::vector<int> ClearlyNearestFeatures(const cv::Mat& squared, double ratio) {
  std::vector<int> nearest(static_cast<std::size_t>(squared.rows), -1);
  for (int row = 0; row < squared.rows; ++row) {
    const auto* distances = squared.ptr<float>(row);
    float first = std::numeric_limits<float>::max();
    float second = first;
    int best = -1;
    for (int column = 0; column < squared.cols; ++column) {
      if (distances[column] < first) {
        second = first;
        first = distances[column];
        best = column;
      } else if (distances[column] < second) {
        second = distances[column];
      }
    }
    if (static_cast<double>(first) < ratio * ratio * static_cast<double>(second)) {
      nearest[static_cast<std::size_t>(row)] = best;
    }
  }
  return nearest;
}

/// Squared distances of every row of `a` to every row of `b`: |a|^2 + |b|^2 - 2 ab.
cv::Mat SquaredFeatureDistances(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat af;
  cv::Mat bf;
  a.convertTo(af, CV_32FC1);
  b.convertTo(bf, CV_32FC1);
  cv::Mat aa;
  cv::Mat bb;
  cv::reduce(af.mul(af), aa, 1, cv::REDUCE_SUM);
  cv::reduce(bf.mul(bf), bb, 1, cv::REDUCE_SUM);
  cv::Mat squared;
  cv::gemm(af, bf, -2, cv::noArray(), 0, squared, cv::GEMM_2_T);
  for (int row = 0; row < squared.rows; ++row) {
    auto* distances = squared.ptr<float>(row);
    for (int column = 0; column < squared.cols; ++column) {
      distances[column] =
          std::max(0.0F, distances[column] + aa.at<float>(row) + bb.at<float>(column));
    }
  }
  return squared;
}

}  // namespace

ImageFeatures ExtractFeatures(const cv::Mat& image, const FeatureConfig& options) {
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_8UC3)) {
    throw Error("features are looked for in a picture that is empty or not 8 bit grey or colour");
  }
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  std::vector<cv::KeyPoint> keypoints;
  ImageFeatures features;
  cv::SIFT::create(options.max_features, 3, options.contrast_threshold, options.edge_threshold, 1.6,
                   CV_8U)
      ->detectAndCompute(grey, cv::noArray(), keypoints, features.descriptors);
  for (const cv::KeyPoint& keypoint : keypoints) features.points.push_back(keypoint.pt);
  if (keypoints.empty()) features.descriptors = cv::Mat(0, kDescriptorBytes, CV_8UC1);
  return features;
}

std::vector<std::pair<int, int>> MatchFeatures(const ImageFeatures& a, const ImageFeatures& b,
                                               double ratio) {
  std::vector<std::pair<int, int>> matches;
  if (a.points.size() < 2 || b.points.size() < 2) return matches;
  const cv::Mat squared = SquaredFeatureDistances(a.descriptors, b.descriptors);
  const std::vector<int> of_a = ClearlyNearestFeatures(squared, ratio);
  const std::vector<int> of_b = ClearlyNearestFeatures(squared.t(), ratio);
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    if (of_a[i] < 0 || of_b[static_cast<std::size_t>(of_a[i])] != static_cast<int>(i)) continue;
    matches.emplace_back(static_cast<int>(i), of_a[i]);
  }
  return matches;
}

}  // namespace livemap::change
