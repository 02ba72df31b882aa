#include "detection/yolox_decoder.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/error.h"

namespace livemap {
namespace {

/// exp() of more than this is wider than any image; the limit keeps the arithmetic finite.
constexpr float kMostLogSize = 8.0F;

/// Rows of one level of the output, in image pixels.
struct Cell {
  int column;
  int row;
  int stride;
};

cv::Rect2f DecodeBox(const float* values, Cell cell, double scale, cv::Size image_size) {
  const double stride = cell.stride / scale;
  const double centre_x = (static_cast<double>(values[0]) + cell.column) * stride;
  const double centre_y = (static_cast<double>(values[1]) + cell.row) * stride;
  const double half_width = 0.5 * std::exp(std::min(values[2], kMostLogSize)) * stride;
  const double half_height = 0.5 * std::exp(std::min(values[3], kMostLogSize)) * stride;
  const auto cut = [](double value, int limit) {
    return static_cast<float>(std::clamp(value, 0.0, static_cast<double>(limit)));
  };
  const float x_min = cut(centre_x - half_width, image_size.width);
  const float y_min = cut(centre_y - half_height, image_size.height);
  return {x_min, y_min, cut(centre_x + half_width, image_size.width) - x_min,
          cut(centre_y + half_height, image_size.height) - y_min};
}

void DecodeRow(const float* values, Cell cell, const ModelManifest& manifest, double scale,
               cv::Size image_size, std::vector<HazardDetection>& detections) {
  const float objectness = values[4];
  for (std::size_t index = 0; index < manifest.classes.size(); ++index) {
    const float confidence = objectness * values[5 + index];
    // Written so that NaN is refused too. Two negative scores would make a positive product.
    if (!(confidence >= manifest.thresholds[index] && objectness <= 1 && objectness >= 0 &&
          values[5 + index] <= 1)) {
      continue;
    }
    const bool finite = std::all_of(values, values + 4, [](float v) { return std::isfinite(v); });
    if (!finite) return;
    const cv::Rect2f box = DecodeBox(values, cell, scale, image_size);
    if (!(box.width > 0 && box.height > 0)) return;
    detections.push_back({manifest.classes[index], static_cast<int>(index), confidence, box});
  }
}

bool MoreConfident(const HazardDetection& a, const HazardDetection& b) {
  return a.confidence > b.confidence;
}

void CheckShape(const cv::Mat& predictions, const ModelManifest& manifest) {
  const int columns = 5 + static_cast<int>(manifest.classes.size());
  const bool accepted = predictions.type() == CV_32F && predictions.dims == 3 &&
                        predictions.isContinuous() && predictions.size[0] == 1 &&
                        predictions.size[1] == manifest.AnchorCount() &&
                        predictions.size[2] == columns;
  if (!accepted) {
    throw Error("the output of model '" + manifest.name +
                "' has another shape, accepted is float32 of 1 x " +
                std::to_string(manifest.AnchorCount()) + " x " + std::to_string(columns));
  }
}

}  // namespace

double IntersectionOverUnion(const cv::Rect2f& a, const cv::Rect2f& b) {
  const double width =
      std::min(double{a.x} + a.width, double{b.x} + b.width) - std::max(double{a.x}, double{b.x});
  const double height =
      std::min(double{a.y} + a.height, double{b.y} + b.height) - std::max(double{a.y}, double{b.y});
  if (width <= 0 || height <= 0) return 0;
  const double intersection = width * height;
  const double together = double{a.width} * a.height + double{b.width} * b.height - intersection;
  return together > 0 ? intersection / together : 0;
}

std::vector<HazardDetection> SuppressOverlaps(std::vector<HazardDetection> candidates,
                                              float iou_limit) {
  // Stable, so that equal confidences keep the order of the cells and a run can be repeated.
  std::stable_sort(candidates.begin(), candidates.end(), MoreConfident);
  std::vector<std::size_t> looked_at;  // by class
  std::vector<HazardDetection> kept;
  for (HazardDetection& candidate : candidates) {
    const auto index = static_cast<std::size_t>(candidate.class_index);
    if (looked_at.size() <= index) looked_at.resize(index + 1, 0);
    if (looked_at[index] == kMostCandidates) continue;
    ++looked_at[index];
    const bool overlaps = std::any_of(kept.begin(), kept.end(), [&](const HazardDetection& better) {
      return better.class_index == candidate.class_index &&
             IntersectionOverUnion(better.box, candidate.box) > iou_limit;
    });
    if (!overlaps) kept.push_back(std::move(candidate));
  }
  return kept;
}

std::vector<HazardDetection> DecodeYolox(const cv::Mat& predictions, const ModelManifest& manifest,
                                         double scale, cv::Size image_size) {
  CheckShape(predictions, manifest);
  const std::size_t columns = 5 + manifest.classes.size();
  const float* values = predictions.ptr<float>();
  std::vector<HazardDetection> candidates;
  for (const int stride : manifest.head.strides) {
    for (int row = 0; row < manifest.input.height / stride; ++row) {
      for (int column = 0; column < manifest.input.width / stride; ++column) {
        DecodeRow(values, {column, row, stride}, manifest, scale, image_size, candidates);
        values += columns;
      }
    }
  }
  return SuppressOverlaps(std::move(candidates), manifest.nms_iou);
}

}  // namespace livemap
