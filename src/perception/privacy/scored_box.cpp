#include "perception/privacy/scored_box.h"

#include <algorithm>
#include <utility>

#include "perception/detection/yolox_decoder.h"

namespace livemap::perception {

std::vector<ScoredBox> Suppressed(const std::vector<ScoredBox>& boxes, float iou_limit) {
  std::vector<HazardDetection> candidates;
  candidates.reserve(boxes.size());
  for (const ScoredBox& each : boxes) candidates.push_back({"", 0, each.score, each.box});
  std::vector<ScoredBox> kept;
  for (const HazardDetection& each : SuppressOverlaps(std::move(candidates), iou_limit)) {
    kept.push_back({each.box, each.confidence});
  }
  return kept;
}

cv::Rect2f Moved(const cv::Rect2f& in_crop, const cv::Point& crop_in_picture) {
  return {in_crop.x + static_cast<float>(crop_in_picture.x),
          in_crop.y + static_cast<float>(crop_in_picture.y), in_crop.width, in_crop.height};
}

cv::Rect PixelsOf(const cv::Rect2f& box, const cv::Size& picture) {
  // Written so that NaN is 0.
  const auto within = [](float edge, int length) {
    return std::max(0.0F, std::min(edge, static_cast<float>(length)));
  };
  const cv::Point first(cvFloor(within(box.x, picture.width)),
                        cvFloor(within(box.y, picture.height)));
  const cv::Point end(cvCeil(within(box.x + box.width, picture.width)),
                      cvCeil(within(box.y + box.height, picture.height)));
  if (end.x <= first.x || end.y <= first.y) return {};
  return {first, end};
}

}  // namespace livemap::perception
