#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "perception/detection/hazard_detection.h"
#include "perception/detection/view_fusion.h"
#include "perception/inference/model_manifest.h"

namespace livemap::perception {

/// Turns the raw output of a YOLOX head into detections.
///
/// `predictions` is float32 1 x N x (5 + classes) as ModelManifest::Head says; per row the centre
/// is (tx + column, ty + row) * stride, the size exp(tw) * stride by exp(th) * stride px of the
/// network's input, the score objectness * class score. `scale` is input pixels per image pixel
/// (the letterbox's) and `image_size` the image, to which boxes are cut. Rows with a number that is
/// not finite, scores outside 0..1 and boxes outside the image are dropped. Returns what is at
/// least at its class's threshold and survives suppression, descending confidence. Several views
/// are suppressed each on its own, then fused (view_fusion.h); their mean is held against the
/// threshold. Throws Error when the shape of `predictions` is another.
std::vector<HazardDetection> DecodeYolox(const cv::Mat& predictions, const ModelManifest& manifest,
                                         double scale, cv::Size image_size);

/// The first half of DecodeYolox: the detections of each view, suppressed, in descending
/// confidence. Of a network that looks more than once they reach down to `kMinOfView`.
/// `predictions` may be the rows of the first view alone, which gives one view.
DetectionsOfViews DecodeViews(const cv::Mat& predictions, const ModelManifest& manifest,
                              double scale, cv::Size image_size);

/// The second half: what several views found as one list, at least at its class's threshold, in
/// descending confidence.
std::vector<HazardDetection> JoinViews(DetectionsOfViews views, const ModelManifest& manifest);

/// What was found in an image that was mirrored (left and right exchanged), `width` pixels wide, in
/// pixels of the image itself.
DetectionsOfViews Mirrored(DetectionsOfViews views, int width);

/// Greedy non-maximum suppression within each class: going down in confidence, a box that overlaps
/// a kept one of its class by more than `iou_limit` goes. At most `kMaxCandidates` of each class,
/// the most confident, are looked at, which bounds the time that a wild output can cost; boxes are
/// compared with near ones only. Returns the kept detections, descending confidence.
std::vector<HazardDetection> SuppressOverlaps(std::vector<HazardDetection> candidates,
                                              float iou_limit);
constexpr std::size_t kMaxCandidates = 3000;

/// Intersection over union of two boxes, 0 when both are empty.
double IntersectionOverUnion(const cv::Rect2f& a, const cv::Rect2f& b);

}  // namespace livemap::perception
