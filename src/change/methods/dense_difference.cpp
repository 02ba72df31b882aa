// The thesis's classical baselines: how much two dense descriptors of one place differ.
#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "change/methods/change_method.h"
#include "change/methods/daisy.h"

namespace livemap::change {
namespace {

constexpr int kStride = 2;           // Pixels between descriptors.
constexpr float kSiftSizePx = 5.0F;  // Diameter of a keypoint; the patch is six times as wide.

cv::Mat GreyForDifference(const cv::Mat& bgr) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

/// Rows and columns of descriptors over an image.
cv::Size DenseGridOf(cv::Size size) {
  return {(size.width + kStride - 1) / kStride, (size.height + kStride - 1) / kStride};
}

/// A score per descriptor to one per pixel.
ChangeProbabilities DifferenceFromGrid(const cv::Mat& scores, cv::Size size) {
  cv::Mat change;
  cv::resize(scores, change, size, 0, 0, cv::INTER_LINEAR);
  cv::min(change, 1.0, change);
  cv::max(change, 0.0, change);
  ChangeProbabilities probabilities;
  probabilities.of_class.resize(2);
  probabilities.of_class[1] = change;
  cv::subtract(1.0, change, probabilities.of_class[0]);
  return probabilities;
}

class DenseSiftDifference : public ChangeMethod {
 public:
  bool tells_classes() const override { return false; }

 protected:
  ChangeProbabilities Infer(const AlignedPair& pair) override {
    const cv::Mat before = Describe(pair.before);
    const cv::Mat after = Describe(pair.after);
    const cv::Size grid = DenseGridOf(pair.after.size());
    cv::Mat scores(grid, CV_32FC1);
    for (int i = 0; i < before.rows; ++i) {
      const double distance = cv::norm(before.row(i), after.row(i), cv::NORM_L2);
      // Two unit vectors without negative entries are at most the root of two apart.
      scores.at<float>(i / grid.width, i % grid.width) = static_cast<float>(distance / M_SQRT2);
    }
    return DifferenceFromGrid(scores, pair.after.size());
  }

 private:
  /// Upright SIFT descriptors at the grid's points, one per row, length 1 or 0.
  static cv::Mat Describe(const cv::Mat& bgr) {
    const cv::Size grid = DenseGridOf(bgr.size());
    std::vector<cv::KeyPoint> points;
    points.reserve(static_cast<std::size_t>(grid.area()));
    for (int row = 0; row < grid.height; ++row) {
      for (int column = 0; column < grid.width; ++column) {
        points.emplace_back(static_cast<float>(column * kStride), static_cast<float>(row * kStride),
                            kSiftSizePx, 0.0F);
      }
    }
    cv::Mat descriptors;
    cv::SIFT::create()->compute(GreyForDifference(bgr), points, descriptors);
    for (int i = 0; i < descriptors.rows; ++i) {
      cv::Mat descriptor = descriptors.row(i);
      const double length = cv::norm(descriptor);
      if (length > 0) descriptor /= length;
    }
    return descriptors;
  }
};

class DenseDaisyDifference : public ChangeMethod {
 public:
  bool tells_classes() const override { return false; }

 protected:
  ChangeProbabilities Infer(const AlignedPair& pair) override {
    const Daisy before(GreyForDifference(pair.before));
    const Daisy after(GreyForDifference(pair.after));
    const cv::Size grid = DenseGridOf(pair.after.size());
    const auto size = static_cast<std::size_t>(before.size());
    std::vector<float> a(size);
    std::vector<float> b(size);
    // As many histograms of length 1 as a descriptor has.
    const double most = std::sqrt(2.0 * static_cast<double>(size) / DaisyConfig().orientations);
    cv::Mat scores(grid, CV_32FC1);
    for (int row = 0; row < grid.height; ++row) {
      for (int column = 0; column < grid.width; ++column) {
        before.Describe(column * kStride, row * kStride, a.data());
        after.Describe(column * kStride, row * kStride, b.data());
        double square = 0;
        for (std::size_t i = 0; i < size; ++i) {
          const double difference = static_cast<double>(a[i]) - static_cast<double>(b[i]);
          square += difference * difference;
        }
        scores.at<float>(row, column) = static_cast<float>(std::sqrt(square) / most);
      }
    }
    return DifferenceFromGrid(scores, pair.after.size());
  }
};

class AbsoluteDifference : public ChangeMethod {
 public:
  bool tells_classes() const override { return false; }

 protected:
  ChangeProbabilities Infer(const AlignedPair& pair) override {
    cv::Mat apart;
    cv::absdiff(pair.before, pair.after, apart);
    cv::Mat score;
    cv::transform(apart, score, cv::Matx13d(1.0 / 3, 1.0 / 3, 1.0 / 3));
    score.convertTo(score, CV_32FC1, 1.0 / 255);
    ChangeProbabilities probabilities;
    probabilities.of_class = {1.0 - score, score};
    return probabilities;
  }
};

}  // namespace

std::unique_ptr<ChangeMethod> MakeAbsoluteDifference() {
  return std::make_unique<AbsoluteDifference>();
}

std::unique_ptr<ChangeMethod> MakeDenseSiftDifference() {
  return std::make_unique<DenseSiftDifference>();
}

std::unique_ptr<ChangeMethod> MakeDaisyDifference() {
  return std::make_unique<DenseDaisyDifference>();
}

}  // namespace livemap::change
