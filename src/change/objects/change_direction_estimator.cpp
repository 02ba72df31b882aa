#include "change/objects/change_direction_estimator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace livemap::change {
namespace {

constexpr double kDirectionReferenceWidth = 320;
constexpr int kGapPx = 2;   // Between a region and what lies around it, of a picture 320 wide,
constexpr int kRingPx = 7;  // and where that ends.
constexpr int kMinRingPixels = 30;
constexpr int kColourBins = 12;

// The weights of a logistic regression on 228 regions of simulated validation streets; 0.5 is
// where one in ten regions is judged wrongly (docs/results/change.md).
constexpr double kColourWeight = 4.0;
constexpr double kOutlineWeight = 1.5;
constexpr double kMinEvidence = 0.5;
constexpr double kMinDifference = 0.05;  // Of colours; a smaller one is noise.

/// Strength of grey edges, CV_32FC1, as multiples of their mean.
cv::Mat RelativeEdgesForDirection(const cv::Mat& bgr) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  cv::GaussianBlur(grey, grey, cv::Size(), 0.8);
  cv::Mat dx;
  cv::Mat dy;
  cv::Sobel(grey, dx, CV_32FC1, 1, 0);
  cv::Sobel(grey, dy, CV_32FC1, 0, 1);
  cv::Mat strength;
  cv::magnitude(dx, dy, strength);
  return strength / std::max(cv::mean(strength)[0], 1e-6);
}

cv::Mat RegionGrownForDirection(const cv::Mat& region, int by_px) {
  cv::Mat grown;
  cv::dilate(region, grown,
             cv::getStructuringElement(cv::MORPH_RECT, {2 * by_px + 1, 2 * by_px + 1}));
  return grown;
}

/// L1 distance of the distributions of one channel inside and around, 0 to 2.
double EdgeDifferenceForDirection(const cv::Mat& channel, const cv::Mat& inside,
                                  const cv::Mat& around) {
  double least = 0;
  double most = 0;
  cv::minMaxLoc(channel, &least, &most, nullptr, nullptr, inside | around);
  const std::array<float, 2> range{static_cast<float>(least), static_cast<float>(most) + 1};
  std::array<cv::Mat, 2> shares;
  for (std::size_t i = 0; i < 2; ++i) {
    const float* ranges[] = {range.data()};
    const int channels[] = {0};
    const int bins[] = {kColourBins};
    cv::calcHist(&channel, 1, channels, i == 0 ? inside : around, shares[i], 1, bins, ranges);
    shares[i] /= std::max(cv::sum(shares[i])[0], 1.0);
  }
  return cv::norm(shares[0], shares[1], cv::NORM_L1);
}

}  // namespace

struct ChangeDirectionEstimator::Picture {
  explicit Picture(const cv::Mat& bgr) : edges(RelativeEdgesForDirection(bgr)) {
    cv::Mat lab;
    cv::GaussianBlur(bgr, lab, cv::Size(), 1);
    cv::cvtColor(lab, lab, cv::COLOR_BGR2Lab);
    cv::split(lab, colours);
  }

  double ColoursDiffer(const cv::Rect& where, const cv::Mat& inside, const cv::Mat& around) const {
    double difference = 0;
    for (const cv::Mat& channel : colours)
      difference += EdgeDifferenceForDirection(channel(where), inside, around);
    return std::max(difference, kMinDifference);
  }

  cv::Mat edges;
  std::vector<cv::Mat> colours;
};

ChangeDirectionEstimator::ChangeDirectionEstimator(const cv::Mat& before, const cv::Mat& after)
    : before_(std::make_unique<Picture>(before)), after_(std::make_unique<Picture>(after)) {}

ChangeDirectionEstimator::~ChangeDirectionEstimator() = default;

ChangeDirection ChangeDirectionEstimator::Of(const cv::Mat& region, const cv::Rect& box) const {
  const double scale = region.cols / kDirectionReferenceWidth;
  const auto pixels = [scale](int px) { return std::max(1, static_cast<int>(px * scale)); };
  const cv::Point margin(pixels(kRingPx) + 1, pixels(kRingPx) + 1);
  const cv::Rect where =
      cv::Rect(box.tl() - margin, box.br() + margin) & cv::Rect(cv::Point(), region.size());
  const cv::Mat inside = region(where);
  const cv::Mat around = RegionGrownForDirection(inside, pixels(kRingPx)) &
                         ~RegionGrownForDirection(inside, pixels(kGapPx));
  cv::Mat outline;
  cv::morphologyEx(inside, outline, cv::MORPH_GRADIENT,
                   cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
  const double outlines = std::log((cv::mean(after_->edges(where), outline)[0] + 1e-6) /
                                   (cv::mean(before_->edges(where), outline)[0] + 1e-6));
  double colours = 0;
  if (cv::countNonZero(around) >= kMinRingPixels * scale * scale) {
    colours = std::log(after_->ColoursDiffer(where, inside, around) /
                       before_->ColoursDiffer(where, inside, around));
  }
  const double evidence = kColourWeight * colours + kOutlineWeight * outlines;
  if (evidence > kMinEvidence) return ChangeDirection::kAppeared;
  if (evidence < -kMinEvidence) return ChangeDirection::kVanished;
  return ChangeDirection::kUnknown;
}

}  // namespace livemap::change
