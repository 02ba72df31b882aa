#include "odometry/monocular/epipolar_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "odometry/bilinear.h"

namespace livemap::odometry {
namespace {

constexpr int kPatternReach = 2;
constexpr float kMinScale = 0.2F;  // Of the point's distance to the other view, against this one.
constexpr int kRefinements = 4;
/// Candidates this close to the best one, in steps of about a pixel, are the same minimum.
constexpr int kSameMinimum = 3;

}  // namespace

EpipolarSearch::EpipolarSearch(const cv::Mat& keyframe, const cv::Mat& other,
                               const geo::CameraIntrinsics& camera,
                               const Eigen::Isometry3d& other_from_keyframe,
                               const EpipolarConfig& config)
    : keyframe_(keyframe), other_(other), config_(config) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = camera.fx;
  k(1, 1) = camera.fy;
  k(0, 2) = camera.cx;
  k(1, 2) = camera.cy;
  infinite_homography_ = (k * other_from_keyframe.linear() * k.inverse()).cast<float>();
  epipole_ = (k * other_from_keyframe.translation()).cast<float>();
}

Eigen::Vector2f EpipolarSearch::Project(const Eigen::Vector3f& at_infinity,
                                        float inverse_depth) const {
  const Eigen::Vector3f seen = at_infinity + inverse_depth * epipole_;
  if (!(seen.z() > kMinScale)) return {-1, -1};
  return seen.head<2>() / seen.z();
}

/// The inverse of Project() along the axis on which the point moves more.
float EpipolarSearch::InverseDepthAt(const Eigen::Vector3f& at_infinity,
                                     const Eigen::Vector2f& pixel) const {
  const Eigen::Vector2f slope = epipole_.head<2>() - pixel * epipole_.z();
  const int axis = std::abs(slope.x()) > std::abs(slope.y()) ? 0 : 1;
  return (pixel[axis] * at_infinity.z() - at_infinity[axis]) / slope[axis];
}

float EpipolarSearch::LineLength(float u, float v, float inverse_depth_low,
                                 float inverse_depth_high) const {
  const Eigen::Vector3f at_infinity = infinite_homography_ * Eigen::Vector3f(u, v, 1);
  return (Project(at_infinity, inverse_depth_high) - Project(at_infinity, inverse_depth_low))
      .norm();
}

bool EpipolarSearch::MakePattern(int u, int v, Pattern& pattern) const {
  if (u < kPatternReach || v < kPatternReach || u >= keyframe_.cols - kPatternReach ||
      v >= keyframe_.rows - kPatternReach) {
    return false;
  }
  for (std::size_t i = 0; i < kPattern.size(); ++i) {
    const int x = u + kPattern[i].x, y = v + kPattern[i].y;
    const Eigen::Vector3f at_infinity =
        infinite_homography_ * Eigen::Vector3f(static_cast<float>(x), static_cast<float>(y), 1);
    const auto row = static_cast<Eigen::Index>(i);
    pattern.x[row] = at_infinity.x();
    pattern.y[row] = at_infinity.y();
    pattern.z[row] = at_infinity.z();
    pattern.grey[row] = keyframe_.ptr(y)[x];
  }
  return true;
}

/// Where the pattern lies in the other view; false when part of it is not inside.
bool EpipolarSearch::Place(const Pattern& pattern, float inverse_depth, Places& places) const {
  places.z = pattern.z + inverse_depth * epipole_.z();
  places.u = (pattern.x + inverse_depth * epipole_.x()) / places.z;
  places.v = (pattern.y + inverse_depth * epipole_.y()) / places.z;
  // Written so that NaN is outside.
  return places.z.minCoeff() > kMinScale && places.u.minCoeff() >= 1 && places.v.minCoeff() >= 1 &&
         places.u.maxCoeff() < static_cast<float>(other_.cols - 2) &&
         places.v.maxCoeff() < static_cast<float>(other_.rows - 2);
}

/// Mean squared residual; infinite outside the image.
float EpipolarSearch::Cost(const Pattern& pattern, float inverse_depth) const {
  Places places;
  if (!Place(pattern, inverse_depth, places)) return std::numeric_limits<float>::infinity();
  Values residual;
  for (Eigen::Index i = 0; i < kPatternSize; ++i) {
    residual[i] = Interpolate(other_, places.u[i], places.v[i]);
  }
  residual -= pattern.grey;
  return (residual - residual.mean()).square().mean();
}

bool EpipolarSearch::Sample(const Pattern& pattern, float inverse_depth, Sampled& sampled) const {
  Places places;
  if (!Place(pattern, inverse_depth, places)) return false;
  for (Eigen::Index i = 0; i < kPatternSize; ++i) {
    const float u = places.u[i], v = places.v[i];
    const Eigen::Vector2f gradient(
        0.5F * (Interpolate(other_, u + 1, v) - Interpolate(other_, u - 1, v)),
        0.5F * (Interpolate(other_, u, v + 1) - Interpolate(other_, u, v - 1)));
    const Eigen::Vector2f motion =
        (epipole_.head<2>() - Eigen::Vector2f(u, v) * epipole_.z()) / places.z[i];
    const Eigen::Vector2f across = Eigen::Vector2f(-motion.y(), motion.x()).normalized();
    sampled.residual[i] = Interpolate(other_, u, v) - pattern.grey[i];
    sampled.by_inverse_depth[i] = gradient.dot(motion);
    sampled.across_line[i] = gradient.dot(across);
  }
  for (Values* values : {&sampled.residual, &sampled.by_inverse_depth, &sampled.across_line}) {
    *values -= values->mean();
  }
  sampled.cost = sampled.residual.square().mean();
  return true;
}

/// Whether the keyframe's edge at a pixel runs across the direction of `line`.
bool EpipolarSearch::CrossesLine(int u, int v, const Eigen::Vector2f& line) const {
  const std::uint8_t* row = keyframe_.ptr(v);
  const Eigen::Vector2f gradient(
      static_cast<float>(row[u + 1] - row[u - 1]),
      static_cast<float>(keyframe_.ptr(v + 1)[u] - keyframe_.ptr(v - 1)[u]));
  return std::abs(gradient.dot(line)) >= config_.min_cosine * gradient.norm() * line.norm();
}

/// The best of places about a pixel apart.
std::optional<float> EpipolarSearch::Coarse(const Pattern& pattern, float low, float high,
                                            bool distinct) const {
  const Eigen::Vector2f begin = Project(pattern.centre(), low);
  Eigen::Vector2f end = Project(pattern.centre(), high);
  float length = (end - begin).norm();
  const auto longest = static_cast<float>(config_.longest_line_px);
  if (length > longest) {  // Nearer points are left to views from closer by.
    end = begin + longest / length * (end - begin);
    length = longest;
  }
  const int steps = std::max(1, static_cast<int>(std::ceil(length)));
  constexpr std::size_t kMost = 256;
  std::array<float, kMost> costs{};
  if (static_cast<std::size_t>(steps) >= kMost) return std::nullopt;
  int best = -1;
  for (int i = 0; i <= steps; ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(steps);
    const float inverse_depth = InverseDepthAt(pattern.centre(), begin + share * (end - begin));
    const auto index = static_cast<std::size_t>(i);
    costs[index] = Cost(pattern, inverse_depth);
    if (std::isfinite(costs[index]) &&
        (best < 0 || costs[index] < costs[static_cast<std::size_t>(best)])) {
      best = i;
    }
  }
  if (best < 0) return std::nullopt;
  if (distinct) {
    const float limit = config_.distinct_ratio * std::max(costs[static_cast<std::size_t>(best)],
                                                          config_.grey_sigma * config_.grey_sigma);
    for (int i = 0; i <= steps; ++i) {
      const bool apart = std::abs(i - best) > kSameMinimum;
      if (apart && costs[static_cast<std::size_t>(i)] < limit) return std::nullopt;
    }
  }
  const float share = static_cast<float>(best) / static_cast<float>(steps);
  return InverseDepthAt(pattern.centre(), begin + share * (end - begin));
}

/// Gauss-Newton on the inverse depth alone.
std::optional<EpipolarMatch> EpipolarSearch::Refine(const Pattern& pattern,
                                                    float inverse_depth) const {
  Sampled sampled;
  if (!Sample(pattern, inverse_depth, sampled)) return std::nullopt;
  for (int i = 0; i < kRefinements; ++i) {
    const float information = sampled.by_inverse_depth.square().sum();
    if (!(information > 0)) return std::nullopt;
    const float step = (sampled.by_inverse_depth * sampled.residual).sum() / information;
    Sampled moved;
    if (!Sample(pattern, inverse_depth - step, moved)) return std::nullopt;
    if (!(moved.cost < sampled.cost)) break;
    inverse_depth -= step;
    sampled = moved;
  }
  if (!(sampled.cost <= config_.worst_residual * config_.worst_residual)) return std::nullopt;
  const float information = sampled.by_inverse_depth.square().sum();
  const float noise = std::max(config_.grey_sigma * config_.grey_sigma, sampled.cost);
  const float beside =
      (sampled.by_inverse_depth * sampled.across_line).sum() / information * config_.line_sigma_px;
  EpipolarMatch match;
  match.inverse_depth = inverse_depth;
  match.variance = noise / information + beside * beside;
  const Eigen::Vector2f here = Project(pattern.centre(), inverse_depth);
  const Eigen::Vector2f motion = (epipole_.head<2>() - here * epipole_.z()) /
                                 (pattern.centre().z() + inverse_depth * epipole_.z());
  const float sigma_px = std::sqrt(match.variance) * motion.norm();
  if (!(sigma_px <= config_.worst_sigma_px)) return std::nullopt;
  return match;
}

std::optional<EpipolarMatch> EpipolarSearch::Find(int u, int v, float inverse_depth_low,
                                                  float inverse_depth_high, bool distinct) const {
  Pattern pattern;
  if (!MakePattern(u, v, pattern)) return std::nullopt;
  const Eigen::Vector2f line =
      Project(pattern.centre(), inverse_depth_high) - Project(pattern.centre(), inverse_depth_low);
  if (!CrossesLine(u, v, line)) return std::nullopt;
  const std::optional<float> coarse =
      Coarse(pattern, inverse_depth_low, inverse_depth_high, distinct);
  if (!coarse) return std::nullopt;
  return Refine(pattern, *coarse);
}

}  // namespace livemap::odometry
