#include "perception/detection/view_fusion.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>

#include "perception/detection/yolox_decoder.h"

namespace livemap::perception {
namespace {

struct Seen {
  const HazardDetection* detection;
  std::size_t view;
};

using BestOfViews = std::vector<std::optional<HazardDetection>>;

HazardDetection MeanOfViews(const BestOfViews& best) {
  double confidence = 0;
  double left = 0;
  double top = 0;
  double width = 0;
  double height = 0;
  const HazardDetection* strongest = nullptr;
  for (const std::optional<HazardDetection>& one : best) {
    if (!one) continue;
    const double weight = one->confidence;
    confidence += weight;
    left += weight * one->box.x;
    top += weight * one->box.y;
    width += weight * one->box.width;
    height += weight * one->box.height;
    if (strongest == nullptr || one->confidence > strongest->confidence) strongest = &*one;
  }
  HazardDetection mean = *strongest;
  mean.confidence = static_cast<float>(confidence / static_cast<double>(best.size()));
  if (confidence > 0) {
    mean.box = {static_cast<float>(left / confidence), static_cast<float>(top / confidence),
                static_cast<float>(width / confidence), static_cast<float>(height / confidence)};
  }
  return mean;
}

/// `seen`: of one class, descending confidence.
void FuseViewsOfClass(const std::vector<Seen>& seen, std::size_t view_count, float iou_limit,
                      std::vector<HazardDetection>& fused) {
  std::vector<bool> taken(seen.size(), false);
  for (std::size_t first = 0; first < seen.size(); ++first) {
    if (taken[first]) continue;
    BestOfViews best(view_count);
    best[seen[first].view] = *seen[first].detection;
    for (std::size_t i = first + 1; i < seen.size(); ++i) {
      if (taken[i] ||
          IntersectionOverUnion(seen[first].detection->box, seen[i].detection->box) < iou_limit) {
        continue;
      }
      taken[i] = true;
      std::optional<HazardDetection>& of_view = best[seen[i].view];
      if (!of_view) of_view = *seen[i].detection;
    }
    fused.push_back(MeanOfViews(best));
  }
}

bool MoreConfidentInViews(const HazardDetection& a, const HazardDetection& b) {
  return a.confidence > b.confidence;
}

}  // namespace

std::vector<HazardDetection> FuseViews(const DetectionsOfViews& views, float iou_limit) {
  std::map<int, std::vector<Seen>> by_class;
  for (std::size_t view = 0; view < views.size(); ++view) {
    std::map<int, std::size_t> counts;
    for (const HazardDetection& detection : views[view]) {
      if (counts[detection.class_index]++ < kMaxFused) {
        by_class[detection.class_index].push_back({&detection, view});
      }
    }
  }
  std::vector<HazardDetection> fused;
  for (auto& [class_index, seen] : by_class) {
    std::stable_sort(seen.begin(), seen.end(), [](const Seen& a, const Seen& b) {
      return MoreConfidentInViews(*a.detection, *b.detection);
    });
    FuseViewsOfClass(seen, views.size(), iou_limit, fused);
  }
  std::stable_sort(fused.begin(), fused.end(), MoreConfidentInViews);
  return fused;
}

}  // namespace livemap::perception
