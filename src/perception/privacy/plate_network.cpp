#include "perception/privacy/plate_network.h"

#include <algorithm>
#include <cmath>

#include "perception/inference/manifest_section.h"
#include "perception/privacy/network_answer.h"

namespace livemap::perception {
namespace {

constexpr char kPlateModel[] = "plates";
constexpr float kPlateIou = 0.3F;
/// Of offsets that are shares of the anchor's side.
constexpr float kPlateVariance = 0.1F;
/// The first numbers of the four corners in a row of `loc`.
constexpr int kPlateCorners[] = {4, 6, 10, 12};
constexpr int kPlateNumbers = 14;

cv::Rect2f PlateBox(const float* loc, const cv::Point3f& anchor, double scale) {
  float x_min = 0;
  float y_min = 0;
  float x_max = 0;
  float y_max = 0;
  bool is_first = true;
  for (const int corner : kPlateCorners) {
    const float x = anchor.x + loc[corner] * kPlateVariance * anchor.z;
    const float y = anchor.y + loc[corner + 1] * kPlateVariance * anchor.z;
    x_min = is_first ? x : std::min(x_min, x);
    y_min = is_first ? y : std::min(y_min, y);
    x_max = is_first ? x : std::max(x_max, x);
    y_max = is_first ? y : std::max(y_max, y);
    is_first = false;
  }
  const auto to_picture = static_cast<float>(1 / scale);
  return {x_min * to_picture, y_min * to_picture, (x_max - x_min) * to_picture,
          (y_max - y_min) * to_picture};
}

}  // namespace

std::vector<cv::Point3f> PlateAnchors(cv::Size input) {
  const std::vector<std::vector<float>> sides = {{10, 16, 24}, {32, 48}, {64, 96}, {128, 192, 256}};
  // Two convolutions of stride 2 before the first level, of which the first rounds up.
  cv::Size cells((input.width + 1) / 2 / 2, (input.height + 1) / 2 / 2);
  float stride = 4;
  std::vector<cv::Point3f> anchors;
  for (const std::vector<float>& of_level : sides) {
    cells = {cells.width / 2, cells.height / 2};
    stride *= 2;
    for (int row = 0; row < cells.height; ++row) {
      for (int column = 0; column < cells.width; ++column) {
        for (const float side : of_level) {
          anchors.emplace_back((static_cast<float>(column) + 0.5F) * stride,
                               (static_cast<float>(row) + 0.5F) * stride, side);
        }
      }
    }
  }
  return anchors;
}

std::vector<ScoredBox> DecodePlates(const cv::Mat& conf, const cv::Mat& iou, const cv::Mat& loc,
                                    cv::Size input, double scale, float found) {
  const std::vector<cv::Point3f> anchors = PlateAnchors(input);
  const auto count = static_cast<int>(anchors.size());
  RequireNumbers(conf, count, 2, kPlateModel, "conf");
  RequireNumbers(iou, count, 1, kPlateModel, "iou");
  RequireNumbers(loc, count, kPlateNumbers, kPlateModel, "loc");
  const float* plate = conf.ptr<float>();
  const float* trust = iou.ptr<float>();
  const float* offsets = loc.ptr<float>();
  std::vector<ScoredBox> plates;
  for (const cv::Point3f& anchor : anchors) {
    RequireScore(plate[1], kPlateModel);
    // The overlap is a regression, which may leave 0 to 1.
    const float score =
        std::sqrt(std::clamp(plate[1] * std::clamp(*trust, 0.0F, 1.0F), 0.0F, 1.0F));
    if (score >= found) {
      const cv::Rect2f box = PlateBox(offsets, anchor, scale);
      RequireFinite(box, kPlateModel);
      if (box.width > 0 && box.height > 0) plates.push_back({box, score});
    }
    plate += 2;
    trust += 1;
    offsets += kPlateNumbers;
  }
  return Suppressed(plates, kPlateIou);
}

PlateNetwork::PlateNetwork(const PrivacyNetworks::Network& network)
    : graph_(network.file, ReadHashedFile(kPlateModel, network.file, network.sha256)),
      input_(network.input.width, network.input.height),
      found_(network.found),
      letterbox_(network.input, network.normalisation) {
  // The file declares 320 x 240, and runs on any size.
  RequireOutputs(graph_, {"conf", "iou", "loc"});
  Find(cv::Mat(input_, CV_8UC3, cv::Scalar::all(127)));
}

std::vector<ScoredBox> PlateNetwork::Find(const cv::Mat& bgr) {
  const std::vector<cv::Mat> answer = graph_.Run({{"input", letterbox_.Fill(bgr)}});
  return DecodePlates(answer[0], answer[1], answer[2], input_, letterbox_.Scale(bgr.size()),
                      found_);
}

}  // namespace livemap::perception
