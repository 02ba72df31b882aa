#include "change/methods/road_look.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "change/registration/change_region.h"
#include "change/registration/road_alignment.h"
#include "common/error.h"
#include "common/median.h"
#include "perception/inference/engines.h"
#include "perception/inference/manifest_section.h"

namespace livemap::change {
namespace {

constexpr int kCellPx = 8;  // The detector's features are of its stride 8.
/// Rows that are looked at, shares of the height; training/change/road_features.py has the same.
constexpr double kBandTop = 0.366;
constexpr double kBandBottom = 0.967;
constexpr int kColourWidth = 480;       // Pictures are shrunk to it to compare colours.
constexpr int kColourReachPx = 2;       // A colour is looked for so far around.
constexpr double kLeastFeature = 0.05;  // What a feature and a colour differ by anyway.
constexpr double kLeastColour = 3;
constexpr float kSurelyNot = -50;
constexpr int kExposureRounds = 12;
constexpr int kExposureSamples = 4000;

cv::Range RoadBand(int height) {
  return {cvRound(kBandTop * height), cvRound(kBandBottom * height)};
}

perception::OnnxGraph LoadRoadGraph(const ChangeManifest& manifest) {
  const ChangeManifest::Graph& graph = manifest.road.value().graph;
  return {graph.file, perception::ReadHashedFile(manifest.name, graph.file, graph.sha256)};
}

perception::ModelManifest::Input RoadInput(const ChangeManifest& manifest) {
  perception::ModelManifest::Input input = manifest.input;
  input.width = manifest.road.value().width;
  input.height = manifest.road.value().height;
  return input;
}

/// Least distance of each cell of `one` to the 3 x 3 cells around it of `other`.
/// `most` (CV_32FC1) keeps the greater.
void NearestCells(const cv::Mat& one, const cv::Mat& other, cv::Size cells, cv::Mat& most) {
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      const cv::Mat here = one.row(y * cells.width + x);
      double least = std::numeric_limits<double>::max();
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, cells.height - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, cells.width - 1); ++u) {
          least = std::min(least, cv::norm(here, other.row(v * cells.width + u), cv::NORM_L2SQR));
        }
      }
      float& distance = most.at<float>(y, x);
      distance = std::max(distance, static_cast<float>(std::sqrt(least / one.cols)));
    }
  }
}

/// Two exposures of the same pixels: a line per channel that takes the one to the other. Pixels
/// that do not follow it, as those of things that changed, count little (weights of Geman and
/// McClure).
class ExposureFit {
 public:
  ExposureFit(const cv::Mat& from, const cv::Mat& to, const cv::Mat& mask) {
    std::vector<cv::Point> points;
    cv::findNonZero(mask, points);
    const std::size_t step = std::max<std::size_t>(points.size() / kExposureSamples, 1);
    for (std::size_t i = 0; i < points.size(); i += step) {
      from_.emplace_back(from.at<cv::Vec3b>(points[i]));
      to_.emplace_back(to.at<cv::Vec3b>(points[i]));
    }
    weights_.assign(from_.size(), 1);
    for (int round = 0; round < kExposureRounds && !from_.empty(); ++round) {
      for (int channel = 0; channel < 3; ++channel) FitChannel(channel);
      Weigh();
    }
  }

  cv::Mat Apply(const cv::Mat& from) const {
    cv::Mat exposed;
    cv::transform(from, exposed,
                  cv::Matx34d(gain_[0], 0, 0, offset_[0],  //
                              0, gain_[1], 0, offset_[1],  //
                              0, 0, gain_[2], offset_[2]));
    return exposed;
  }

 private:
  void FitChannel(int channel) {
    double sum = 0;
    double x = 0;
    double y = 0;
    double xx = 0;
    double xy = 0;
    for (std::size_t i = 0; i < from_.size(); ++i) {
      const double weight = weights_[i];
      sum += weight;
      x += weight * from_[i][channel];
      y += weight * to_[i][channel];
      xx += weight * from_[i][channel] * from_[i][channel];
      xy += weight * from_[i][channel] * to_[i][channel];
    }
    constexpr double kLeastVariance = 1e-3;
    gain_[channel] = std::clamp((xy - x * y / sum) / (xx - x * x / sum + kLeastVariance), 0.5, 2.0);
    offset_[channel] = (y - gain_[channel] * x) / sum;
  }

  void Weigh() {
    std::vector<double> misfits;
    misfits.reserve(from_.size());
    for (std::size_t i = 0; i < from_.size(); ++i) {
      misfits.push_back(cv::norm(from_[i].mul(gain_) + offset_ - to_[i], cv::NORM_L1) / 3);
    }
    const double scale = 1.5 * std::max(MedianOf(misfits), 1.0);
    for (std::size_t i = 0; i < misfits.size(); ++i) {
      const double ratio = misfits[i] / scale;
      weights_[i] = 1 / ((1 + ratio * ratio) * (1 + ratio * ratio));
    }
  }

  std::vector<cv::Vec3d> from_;
  std::vector<cv::Vec3d> to_;
  std::vector<double> weights_;
  cv::Vec3d gain_{1, 1, 1};
  cv::Vec3d offset_{0, 0, 0};
};

/// Least distance of each pixel of `one` to those around it of `other`, the sum of the channels;
/// both CV_16UC3. `most` (CV_16UC1) keeps the greater.
void NearestColours(const cv::Mat& one, const cv::Mat& other, cv::Mat& most) {
  cv::Mat padded;
  cv::copyMakeBorder(other, padded, kColourReachPx, kColourReachPx, kColourReachPx, kColourReachPx,
                     cv::BORDER_REPLICATE);
  cv::Mat least;
  cv::Mat apart;
  cv::Mat sum;
  for (int y = 0; y <= 2 * kColourReachPx; ++y) {
    for (int x = 0; x <= 2 * kColourReachPx; ++x) {
      cv::absdiff(one, padded(cv::Rect(cv::Point(x, y), one.size())), apart);
      cv::transform(apart, sum, cv::Matx13f(1, 1, 1));
      if (least.empty()) {
        least = sum.clone();
      } else {
        cv::min(least, sum, least);
      }
    }
  }
  cv::max(most, least, most);
}

/// CV_32FC1 of the band's size: how far colours are from the nearest of the other picture.
cv::Mat ColourDistance(const AlignedPair& pair, const cv::Mat& road) {
  const double shrink = std::min(1.0, static_cast<double>(kColourWidth) / pair.after.cols);
  cv::Mat before;
  cv::Mat after;
  cv::Mat mask;
  cv::resize(pair.before, before, {}, shrink, shrink, cv::INTER_AREA);
  cv::resize(pair.after, after, before.size(), 0, 0, cv::INTER_AREA);
  cv::resize(road & pair.valid, mask, before.size(), 0, 0, cv::INTER_NEAREST);
  before = ExposureFit(before, after, mask).Apply(before);
  const cv::Range band = RoadBand(before.rows);
  before.rowRange(band).convertTo(before, CV_16U);
  after.rowRange(band).convertTo(after, CV_16U);
  cv::Mat most(after.size(), CV_16UC1, cv::Scalar(0));
  NearestColours(after, before, most);
  NearestColours(before, after, most);
  cv::Mat distance;
  most.convertTo(distance, CV_32F);
  cv::resize(distance, distance, {pair.after.cols, RoadBand(pair.after.rows).size()}, 0, 0,
             cv::INTER_LINEAR);
  return distance;
}

/// weight * log(least + distance).
cv::Mat LogDistance(const cv::Mat& distance, double least, double weight) {
  cv::Mat logarithm = distance + least;
  cv::log(logarithm, logarithm);
  return weight * logarithm;
}

}  // namespace

RoadLook::RoadLook(const ChangeManifest& manifest)
    : config_(manifest.road.value()),
      letterbox_(RoadInput(manifest), manifest.normalisation),
      graph_(LoadRoadGraph(manifest)) {
  graph_.RequireInput("image", {1, 3, config_.height, config_.width});
  if (graph_.outputs().size() != 1 || graph_.outputs()[0] != config_.output) {
    throw Error("model file '" + graph_.file() + "' has " +
                std::to_string(graph_.outputs().size()) +
                " outputs, its manifest accepts one named '" + config_.output + "'");
  }
  Describe(cv::Mat(config_.height, config_.width, CV_8UC3, cv::Scalar(0)));
}

std::optional<AlignedPair> RoadLook::Align(const AlignedPair& pair) const {
  const cv::Mat& still = pair.after_is_warped ? pair.before : pair.after;
  const cv::Mat& moved = pair.after_is_warped ? pair.after : pair.before;
  const RoadAlignment alignment = AlignRoad(moved, still, pair.valid);
  if (alignment.agreement < config_.least_agreement) return std::nullopt;
  cv::Mat valid;
  cv::warpPerspective(pair.valid, valid, alignment.after_from_before, pair.valid.size(),
                      cv::INTER_NEAREST);
  cv::Mat warped;
  cv::warpPerspective(moved, warped, alignment.after_from_before, moved.size());
  warped = FillUnknown(warped, still, valid);
  if (pair.after_is_warped) return AlignedPair{still, warped, valid, true};
  return AlignedPair{warped, still, valid};
}

cv::Mat RoadLook::LogOdds(const AlignedPair& pair) {
  const cv::Mat road = ChangeRegionMask("road", pair.after.size());
  const cv::Range band = RoadBand(pair.after.rows);
  const cv::Mat features = FeatureDistance(pair.before.rowRange(band), pair.after.rowRange(band));
  const cv::Mat in_band = LogDistance(features, kLeastFeature, config_.features) +
                          LogDistance(ColourDistance(pair, road), kLeastColour, config_.colours) +
                          config_.bias;
  cv::Mat log_odds(pair.after.size(), CV_32FC1, cv::Scalar(kSurelyNot));
  in_band.copyTo(log_odds.rowRange(band));
  log_odds.setTo(kSurelyNot, (road & pair.valid) == 0);
  return log_odds;
}

cv::Mat RoadLook::Describe(const cv::Mat& band) {
  const std::vector<cv::Mat> answers = graph_.Run({{"image", letterbox_.Fill(band)}});
  const cv::Mat& features = answers[0];
  const int rows = config_.height / kCellPx;
  const int columns = config_.width / kCellPx;
  if (features.dims != 4 || features.type() != CV_32F || features.size[2] != rows ||
      features.size[3] != columns) {
    throw Error("model file '" + graph_.file() + "' answers with a tensor of " +
                perception::ShapeText(perception::ShapeOf(features)) +
                ", its manifest accepts features of " + std::to_string(rows) + "x" +
                std::to_string(columns) + " cells");
  }
  const cv::Mat channels(features.size[1], rows * columns, CV_32FC1,
                         const_cast<float*>(features.ptr<float>()));
  return channels.t();
}

cv::Mat RoadLook::FeatureDistance(const cv::Mat& before, const cv::Mat& after) {
  const cv::Mat earlier = Describe(before);
  const cv::Mat later = Describe(after);
  const cv::Size cells(config_.width / kCellPx, config_.height / kCellPx);
  cv::Mat most(cells, CV_32FC1, cv::Scalar(0));
  NearestCells(later, earlier, cells, most);
  NearestCells(earlier, later, cells, most);
  cv::Mat distance;
  cv::resize(most, distance, {config_.width, config_.height}, 0, 0, cv::INTER_LINEAR);
  const cv::Rect shown(cv::Point(), letterbox_.Fitted(after.size()));
  cv::resize(distance(shown), distance, after.size(), 0, 0, cv::INTER_LINEAR);
  return distance;
}

void RaiseChange(const cv::Mat& log_odds, ChangeProbabilities& probabilities) {
  constexpr float kNoEvidence = 1e-6F;
  const auto fallback = static_cast<std::size_t>(protocol::ChangeClass::kOtherObjects);
  for (int y = 0; y < log_odds.rows; ++y) {
    const auto* odds = log_odds.ptr<float>(y);
    for (int x = 0; x < log_odds.cols; ++x) {
      const float raised = 1 / (1 + std::exp(-odds[x]));
      float& unchanged = probabilities.of_class[0].at<float>(y, x);
      const float changed = 1 - unchanged;
      if (raised <= changed) continue;
      unchanged = 1 - raised;
      const bool known = changed > kNoEvidence;
      for (std::size_t i = 1; i < probabilities.of_class.size(); ++i) {
        float& of_class = probabilities.of_class[i].at<float>(y, x);
        of_class = known ? of_class * raised / changed : (i == fallback ? raised : 0.0F);
      }
    }
  }
}

}  // namespace livemap::change
