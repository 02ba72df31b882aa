#include "perception/detection/yolox_decoder.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

#include "common/error.h"

namespace livemap::perception {
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

namespace {

/// exp() of more than this is wider than any image; the limit keeps the arithmetic finite.
constexpr float kMaxLogSize = 8.0F;

/// Of two views' boxes, from which on they are of one object.
constexpr float kFusionIou = 0.5F;

/// Confidence from which on a box of one view is compared with those of the others.
constexpr float kMinOfView = 0.05F;

/// Rows of one level of the output, in image pixels.
struct Cell {
  int column;
  int row;
  int stride;
};

cv::Rect2f DecodeYoloxBox(const float* values, Cell cell, double scale, cv::Size image_size) {
  const double stride = cell.stride / scale;
  const double centre_x = (static_cast<double>(values[0]) + cell.column) * stride;
  const double centre_y = (static_cast<double>(values[1]) + cell.row) * stride;
  const double half_width = 0.5 * std::exp(std::min(values[2], kMaxLogSize)) * stride;
  const double half_height = 0.5 * std::exp(std::min(values[3], kMaxLogSize)) * stride;
  const auto cut = [](double value, int limit) {
    return static_cast<float>(std::clamp(value, 0.0, static_cast<double>(limit)));
  };
  const float x_min = cut(centre_x - half_width, image_size.width);
  const float y_min = cut(centre_y - half_height, image_size.height);
  return {x_min, y_min, cut(centre_x + half_width, image_size.width) - x_min,
          cut(centre_y + half_height, image_size.height) - y_min};
}

void DecodeYoloxRow(const float* values, Cell cell, const ModelManifest& manifest,
                    const std::vector<float>& thresholds, double scale, cv::Size image_size,
                    std::vector<HazardDetection>& detections) {
  const float objectness = values[4];
  for (std::size_t index = 0; index < manifest.classes.size(); ++index) {
    const float confidence = objectness * values[5 + index];
    // Written so that NaN is refused too. Two negative scores would make a positive product.
    if (!(confidence >= thresholds[index] && objectness <= 1 && objectness >= 0 &&
          values[5 + index] <= 1)) {
      continue;
    }
    const bool finite = std::all_of(values, values + 4, [](float v) { return std::isfinite(v); });
    if (!finite) return;
    const cv::Rect2f box = DecodeYoloxBox(values, cell, scale, image_size);
    if (!(box.width > 0 && box.height > 0)) return;
    detections.push_back({manifest.classes[index], static_cast<int>(index), confidence, box});
  }
}

/// The boxes of one class that suppression has kept so far, in a grid by their centres.
///
/// Two boxes whose IoU is above t are alike: each side of one is at least t times that of the
/// other, and from a box of width w the other's centre is at most w * max(1 - t, (1 / t - 1) / 2)
/// away, likewise in height. So only the cells that near are looked at, and thousands of candidates
/// cost not much more than sorting them.
class YoloxKeptBoxes {
 public:
  YoloxKeptBoxes(const std::vector<HazardDetection>& all, const std::vector<std::size_t>& mine,
                 float iou_limit)
      : iou_limit_(iou_limit),
        reach_(std::max(1.0 - iou_limit, (1.0 / std::max(double{iou_limit}, 1e-9) - 1) / 2)) {
    for (const std::size_t index : mine) {
      const cv::Rect2f& box = all[index].box;
      width_ = std::max(width_, double{box.x} + box.width);
      height_ = std::max(height_, double{box.y} + box.height);
    }
    // About one candidate per cell; a few are compared as fast without cells.
    side_ = static_cast<int>(std::clamp(std::sqrt(static_cast<double>(mine.size())), 1.0, 64.0));
    first_.assign(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_), kNone);
  }

  bool KeepUnlessOverlapped(const cv::Rect2f& box) {
    const double x = double{box.x} + 0.5 * double{box.width};
    const double y = double{box.y} + 0.5 * double{box.height};
    // A little more than the reach: the bound is exact, the floats of a box are not.
    const double reach_x = 1.001 * reach_ * double{box.width} + 0.01;
    const double reach_y = 1.001 * reach_ * double{box.height} + 0.01;
    const int last_column = Cell(x + reach_x, width_);
    const int last_row = Cell(y + reach_y, height_);
    for (int row = Cell(y - reach_y, height_); row <= last_row; ++row) {
      for (int column = Cell(x - reach_x, width_); column <= last_column; ++column) {
        for (std::size_t i = first_[Index(column, row)]; i != kNone; i = next_[i]) {
          if (IntersectionOverUnion(boxes_[i], box) > iou_limit_) return false;
        }
      }
    }
    std::size_t& first = first_[Index(Cell(x, width_), Cell(y, height_))];
    boxes_.push_back(box);
    next_.push_back(first);
    first = boxes_.size() - 1;
    return true;
  }

 private:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  int Cell(double position, double extent) const {
    if (!(extent > 0)) return 0;
    return static_cast<int>(std::clamp(position / extent * side_, 0.0, side_ - 1.0));
  }
  std::size_t Index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(side_) +
           static_cast<std::size_t>(column);
  }

  float iou_limit_;
  double reach_;  ///< Sides of a box that the centre of one alike may be away.
  double width_ = 0;
  double height_ = 0;
  int side_ = 1;                    ///< Cells in each direction.
  std::vector<std::size_t> first_;  ///< By cell: the box kept last.
  std::vector<std::size_t> next_;   ///< By box: the one kept before it in its cell.
  std::vector<cv::Rect2f> boxes_;
};

/// Of how many views the rows are: all, or the first.
std::size_t CountYoloxViews(const cv::Mat& predictions, const ModelManifest& manifest) {
  const int columns = 5 + static_cast<int>(manifest.classes.size());
  if (predictions.type() == CV_32F && predictions.dims == 3 && predictions.isContinuous() &&
      predictions.size[0] == 1 && predictions.size[2] == columns) {
    if (predictions.size[1] == manifest.AnchorCount()) {
      return static_cast<std::size_t>(manifest.head.views);
    }
    if (predictions.size[1] == manifest.AnchorCountOfView(0)) return 1;
  }
  throw Error("the output of model '" + manifest.name +
              "' has another shape, accepted is float32 of 1 x " +
              std::to_string(manifest.AnchorCount()) + " x " + std::to_string(columns));
}

/// A view may be surer than the mean of all: what is weak in one is looked at too.
std::vector<float> YoloxThresholdsOfViews(const ModelManifest& manifest) {
  std::vector<float> thresholds = manifest.thresholds;
  if (manifest.head.views == 1 && !manifest.head.mirrored) return thresholds;
  for (float& threshold : thresholds) threshold = std::min(threshold, kMinOfView);
  return thresholds;
}

std::vector<HazardDetection> AboveYoloxThresholds(std::vector<HazardDetection> detections,
                                                  const ModelManifest& manifest) {
  const auto weak = [&](const HazardDetection& detection) {
    return detection.confidence <
           manifest.thresholds[static_cast<std::size_t>(detection.class_index)];
  };
  detections.erase(std::remove_if(detections.begin(), detections.end(), weak), detections.end());
  return detections;
}

}  // namespace

std::vector<HazardDetection> SuppressOverlaps(std::vector<HazardDetection> candidates,
                                              float iou_limit) {
  // Indices, as a detection holds a text. Stable, so that equal confidences keep the order of the
  // cells and a run can be repeated.
  std::vector<std::size_t> order(candidates.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return candidates[a].confidence > candidates[b].confidence;
  });
  std::vector<std::vector<std::size_t>> by_class;
  for (const std::size_t candidate : order) {
    const auto index = static_cast<std::size_t>(candidates[candidate].class_index);
    if (by_class.size() <= index) by_class.resize(index + 1);
    if (by_class[index].size() < kMaxCandidates) by_class[index].push_back(candidate);
  }
  std::vector<bool> keep(candidates.size(), false);
  for (const std::vector<std::size_t>& of_class : by_class) {
    YoloxKeptBoxes kept(candidates, of_class, iou_limit);
    for (const std::size_t candidate : of_class) {
      keep[candidate] = kept.KeepUnlessOverlapped(candidates[candidate].box);
    }
  }
  std::vector<HazardDetection> kept;
  for (const std::size_t candidate : order) {
    if (keep[candidate]) kept.push_back(std::move(candidates[candidate]));
  }
  return kept;
}

DetectionsOfViews DecodeViews(const cv::Mat& predictions, const ModelManifest& manifest,
                              double scale, cv::Size image_size) {
  DetectionsOfViews views(CountYoloxViews(predictions, manifest));
  const std::size_t columns = 5 + manifest.classes.size();
  const std::vector<float> thresholds = YoloxThresholdsOfViews(manifest);
  const float* values = predictions.ptr<float>();
  const std::size_t levels =
      manifest.head.strides.size() / static_cast<std::size_t>(manifest.head.views);
  for (std::size_t level = 0; level < views.size() * levels; ++level) {
    const int stride = manifest.head.strides[level];
    for (int row = 0; row < manifest.input.height / stride; ++row) {
      for (int column = 0; column < manifest.input.width / stride; ++column) {
        DecodeYoloxRow(values, {column, row, stride}, manifest, thresholds, scale, image_size,
                       views[level / levels]);
        values += columns;
      }
    }
  }
  for (std::vector<HazardDetection>& view : views) {
    view = SuppressOverlaps(std::move(view), manifest.nms_iou);
  }
  return views;
}

std::vector<HazardDetection> JoinViews(DetectionsOfViews views, const ModelManifest& manifest) {
  return AboveYoloxThresholds(
      views.size() == 1 ? std::move(views[0]) : FuseViews(views, kFusionIou), manifest);
}

DetectionsOfViews Mirrored(DetectionsOfViews views, int width) {
  for (std::vector<HazardDetection>& view : views) {
    for (HazardDetection& detection : view) {
      const float right = detection.box.x + detection.box.width;
      detection.box.x = std::max(static_cast<float>(width) - right, 0.0F);
    }
  }
  return views;
}

std::vector<HazardDetection> DecodeYolox(const cv::Mat& predictions, const ModelManifest& manifest,
                                         double scale, cv::Size image_size) {
  return JoinViews(DecodeViews(predictions, manifest, scale, image_size), manifest);
}

}  // namespace livemap::perception
