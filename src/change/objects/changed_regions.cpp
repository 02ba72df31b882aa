#include "change/objects/changed_regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "change/objects/change_direction_estimator.h"
#include "common/error.h"

namespace livemap::change {
namespace {

constexpr double kRegionReferenceWidth = 320;

protocol::ChangeClass MostFrequentInRegion(const cv::Mat& classes, const cv::Mat& region) {
  std::array<int, protocol::kChangeClasses> counts{};
  for (int row = 0; row < region.rows; ++row) {
    for (int column = 0; column < region.cols; ++column) {
      if (region.at<std::uint8_t>(row, column) == 0) continue;
      ++counts[classes.at<std::uint8_t>(row, column)];
    }
  }
  const auto most = std::max_element(counts.begin() + 1, counts.end());
  return static_cast<protocol::ChangeClass>(most - counts.begin());
}

/// Lets each labelled region take in pixels of `rim` that no region has, a ring at a time; where
/// two meet, the one with the greater label goes on. `labels`: CV_16UC1, 0 is none.
void GrowRegionsInto(const cv::Mat& rim, int rings, cv::Mat& labels) {
  for (int i = 0; i < rings; ++i) {
    cv::Mat larger;
    cv::dilate(labels, larger, cv::Mat());
    larger.copyTo(labels, rim & (labels == 0));
  }
}

}  // namespace

cv::Mat ChangedClasses(const ChangeProbabilities& probabilities, double min_confidence) {
  const cv::Mat& no_change = probabilities.of_class[0];
  cv::Mat classes(no_change.size(), CV_8UC1,
                  cv::Scalar(static_cast<double>(protocol::ChangeClass::kOtherObjects)));
  if (probabilities.tells_classes()) {
    cv::Mat most = probabilities.of_class[1].clone();
    classes.setTo(1);
    for (int i = 2; i < protocol::kChangeClasses; ++i) {
      const cv::Mat& probability = probabilities.of_class[static_cast<std::size_t>(i)];
      classes.setTo(i, probability > most);
      cv::max(most, probability, most);
    }
  }
  classes.setTo(0, no_change > 1 - min_confidence);
  return classes;
}

std::vector<ChangeRegion> FindChangeRegions(const ChangeProbabilities& probabilities,
                                            const cv::Mat& before, const cv::Mat& after,
                                            const ChangeRegionConfig& options) {
  if (before.type() != CV_8UC3 || after.type() != CV_8UC3 || before.size() != after.size() ||
      probabilities.of_class[0].size() != after.size()) {
    throw Error(
        "regions of change want probabilities and two colour pictures of one size, not pictures "
        "of " +
        std::to_string(before.cols) + "x" + std::to_string(before.rows) + " and " +
        std::to_string(after.cols) + "x" + std::to_string(after.rows));
  }
  const cv::Mat classes = ChangedClasses(probabilities, options.min_confidence);
  cv::Mat score;
  cv::subtract(1.0, probabilities.of_class[0], score);
  const cv::Mat changed = classes > 0;
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centres;
  // What does not fit a 16 bit label is noise by its number.
  const int count = std::min(
      cv::connectedComponentsWithStats(changed, labels, stats, centres, 8, CV_32S), 1 << 16);
  const double scale = after.cols / kRegionReferenceWidth;
  cv::Mat grown;
  labels.convertTo(grown, CV_16U);
  GrowRegionsInto(score >= options.rim_share * options.min_confidence,
                  static_cast<int>(std::lround(options.rim_px * scale)), grown);
  std::optional<ChangeDirectionEstimator> judge;  // Most pictures have nothing to judge.
  std::vector<ChangeRegion> regions;
  for (int i = 1; i < count; ++i) {
    ChangeRegion region;
    region.pixels = stats.at<int>(i, cv::CC_STAT_AREA);
    if (region.pixels < options.min_pixels * scale * scale) continue;
    const cv::Mat sure = labels == i;
    const cv::Mat whole = grown == i;
    region.box = cv::boundingRect(whole);
    region.confidence = cv::mean(score, sure)[0];
    region.change_class = MostFrequentInRegion(classes, sure);
    if (!judge) judge.emplace(before, after);
    region.direction = judge->Of(sure, region.box);
    regions.push_back(region);
  }
  std::stable_sort(
      regions.begin(), regions.end(),
      [](const ChangeRegion& a, const ChangeRegion& b) { return a.pixels > b.pixels; });
  return regions;
}

}  // namespace livemap::change
