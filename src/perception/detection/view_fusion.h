#pragma once

#include <vector>

#include "perception/detection/hazard_detection.h"

namespace livemap::perception {

/// By view of an image, detections in pixels of that image.
using DetectionsOfViews = std::vector<std::vector<HazardDetection>>;

/// What one network found in several views of an image (its scales, mirrored), as one list:
/// weighted boxes fusion (Solovyev, Wang and Gabruseva 2021).
///
/// `views`: the detections of each view, in pixels of the same image, each view already without
/// overlaps. Going down in confidence, a detection takes up those of its class that it overlaps by
/// at least `iou_limit` (above 0). Its box becomes the mean of each view's best one, weighted by
/// confidence, its confidence the mean of theirs, 0 for a view that has none: what only one view
/// shows is doubted. At most `kMaxFused` of each class and view, the most confident, are looked
/// at. Returns descending confidence.
std::vector<HazardDetection> FuseViews(const DetectionsOfViews& views, float iou_limit);
constexpr std::size_t kMaxFused = 300;

}  // namespace livemap::perception
