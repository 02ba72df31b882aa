#include "odometry/edge/keyframe_point_selector.h"

#include <algorithm>
#include <cstddef>

namespace livemap::odometry {
namespace {

/// A keyframe whose points lie in less than this share of the cells of its image takes faint edges,
/// too: what is in one corner leaves the view at once, and says little while it is there. Where
/// those are no more, its finest level is a coarser one that has so many times more.
constexpr double kEnoughCovered = 0.4;
constexpr double kBetterCovered = 1.5;
constexpr int kCellsAcross = 8, kCellsDown = 6;
/// Faint edges are as strong as this, grey levels per px, and their points as steep as this.
constexpr double kFaintEdgeGradient = 2;
constexpr float kFaintPointGradient = 0.8F;

/// The cell at a part of the image's width or height, also where rounding puts that outside.
int CellAt(double part, int cells) {
  const double cell = part * cells;
  return cell > 0 ? static_cast<int>(std::min(cell, cells - 1.0)) : 0;  // NaN is 0, too.
}

/// Share of the cells of the image that have points.
double CoveredShare(const EdgePoints& points, const geo::CameraIntrinsics& camera) {
  std::array<bool, kCellsAcross * kCellsDown> covered{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double u = camera.fx * static_cast<double>(points.x[i] / points.z[i]) + camera.cx;
    const double v = camera.fy * static_cast<double>(points.y[i] / points.z[i]) + camera.cy;
    const int column = CellAt(u / camera.width, kCellsAcross);
    const int row = CellAt(v / camera.height, kCellsDown);
    covered[static_cast<std::size_t>(row * kCellsAcross + column)] = true;
  }
  return static_cast<double>(std::count(covered.begin(), covered.end(), true)) /
         static_cast<double>(covered.size());
}

EdgeExtractor::Config FaintEdges(EdgeExtractor::Config config) {
  config.min_gradient = std::min(config.min_gradient, kFaintEdgeGradient);
  return config;
}

ReferenceLevel LevelOf(const Keyframe& keyframe, int level) {
  return {keyframe.images[level], keyframe.depths[level], keyframe.inverse_depth_sigmas[level]};
}

}  // namespace

KeyframePointSelector::KeyframePointSelector(const Config& config, const LevelCameras& cameras)
    : config_(config),
      cameras_(cameras),
      extractor_(config.edges),
      faint_extractor_(FaintEdges(config.edges)),
      selector_(config.points.seed) {}

void KeyframePointSelector::Reserve(const cv::Size& size) {
  masked_points_.Reserve(static_cast<std::size_t>(
      *std::max_element(config_.max_points.begin(), config_.max_points.end())));
  selector_.Reserve(static_cast<std::size_t>(size.area()));
  extractor_.Reserve(size);
  faint_extractor_.Reserve(size);
}

void KeyframePointSelector::Select(Keyframe& keyframe) {
  keyframe.finest_level = 0;
  double best_covered = 0;
  for (int level = 0; level < cameras_.levels; ++level) {
    const double covered = std::min(kEnoughCovered, SelectLevel(level, keyframe));
    if (level > 0 && covered < kBetterCovered * best_covered) continue;
    keyframe.finest_level = level;
    best_covered = covered;
  }
  selector_.SelectAll(keyframe.images.thumbnail(),
                      cameras_.camera[static_cast<std::size_t>(cameras_.levels)],
                      keyframe.thumbnail_points);
}

/// The points of one level; the share of the image that they cover.
double KeyframePointSelector::SelectLevel(int level, Keyframe& keyframe) {
  const auto index = static_cast<std::size_t>(level);
  PointSelection selection = SelectionOf(level);
  const ReferenceLevel reference = LevelOf(keyframe, level);
  const geo::CameraIntrinsics& camera = cameras_.camera[index];
  EdgePoints& points = keyframe.points[index];
  selector_.Select(reference, extractor_.Extract(reference.grey), camera, selection, points);
  double covered = CoveredShare(points, camera);
  if (covered < kEnoughCovered) {
    selection.min_gradient = std::min(selection.min_gradient, kFaintPointGradient);
    selector_.Select(reference, faint_extractor_.Extract(reference.grey), camera, selection,
                     points);
    covered = CoveredShare(points, camera);
  }
  points.gradient_noise = keyframe.images.GradientNoise(level);
  return covered;
}

const EdgePoints& KeyframePointSelector::SelectUnder(const cv::Mat& grey, const Keyframe& keyframe,
                                                     int level) {
  selector_.Select(LevelOf(keyframe, level), extractor_.Extract(grey),
                   cameras_.camera[static_cast<std::size_t>(level)], SelectionOf(level),
                   masked_points_);
  return masked_points_;
}

PointSelection KeyframePointSelector::SelectionOf(int level) const {
  PointSelection selection = config_.points;
  selection.max_points =
      static_cast<std::size_t>(config_.max_points[static_cast<std::size_t>(level)]);
  return selection;
}

}  // namespace livemap::odometry
