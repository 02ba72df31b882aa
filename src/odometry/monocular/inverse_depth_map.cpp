#include "odometry/monocular/inverse_depth_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace livemap::odometry {
namespace {

constexpr int kMapBorderPx = 3;

/// The product of two Gaussians.
void FuseInverseDepth(EdgeDepth& edge, float inverse_depth, float variance) {
  const float sum = edge.variance + variance;
  edge.inverse_depth = (edge.inverse_depth * variance + inverse_depth * edge.variance) / sum;
  edge.variance = edge.variance * variance / sum;
}

bool InverseDepthsAgree(float one, float one_variance, float other, float other_variance,
                        float sigmas) {
  const float difference = one - other;
  return difference * difference <= sigmas * sigmas * (one_variance + other_variance);
}

}  // namespace

InverseDepthMap::InverseDepthMap(const Config& config, const geo::CameraIntrinsics& camera)
    : config_(config), camera_(camera) {}

void InverseDepthMap::SetRange(double min_depth_m, double max_depth_m) {
  config_.min_depth_m = static_cast<float>(min_depth_m);
  config_.max_depth_m = static_cast<float>(max_depth_m);
}

void InverseDepthMap::Clear() { edges_.clear(); }

void InverseDepthMap::PlaceEdges(const cv::Mat& edges) {
  index_.create(edges.size(), CV_32SC1);
  index_.setTo(-1);
  edges_.clear();
  const int all = cv::countNonZero(edges);
  int seen = 0, taken = 0;
  for (int v = kMapBorderPx; v < edges.rows - kMapBorderPx; ++v) {
    const std::uint8_t* mask = edges.ptr(v);
    int* index = index_.ptr<int>(v);
    for (int u = kMapBorderPx; u < edges.cols - kMapBorderPx; ++u) {
      if (mask[u] == 0) continue;
      const double due = static_cast<double>(++seen) * config_.max_edges / all;
      if (taken >= due && all > config_.max_edges) continue;
      ++taken;
      index[u] = static_cast<int>(edges_.size());
      EdgeDepth edge;
      edge.u = static_cast<std::int16_t>(u);
      edge.v = static_cast<std::int16_t>(v);
      edges_.push_back(edge);
    }
  }
}

void InverseDepthMap::MoveTo(const cv::Mat& edges, const Eigen::Isometry3d& new_from_last) {
  std::swap(edges_, last_edges_);
  PlaceEdges(edges);
  for (const EdgeDepth& edge : last_edges_) {
    if (edge.known) Bring(edge, new_from_last);
  }
}

/// The edge pixel at, or next to, a place.
EdgeDepth* InverseDepthMap::NearestEdge(float u, float v) {
  const int column = static_cast<int>(std::lround(u)), row = static_cast<int>(std::lround(v));
  if (column < kMapBorderPx || row < kMapBorderPx || column >= index_.cols - kMapBorderPx ||
      row >= index_.rows - kMapBorderPx) {
    return nullptr;
  }
  int nearest = -1;
  float least = 3;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const int candidate = index_.at<int>(row + dy, column + dx);
      const float x = static_cast<float>(column + dx) - u, y = static_cast<float>(row + dy) - v;
      if (candidate < 0 || x * x + y * y >= least) continue;
      least = x * x + y * y;
      nearest = candidate;
    }
  }
  return nearest < 0 ? nullptr : &edges_[static_cast<std::size_t>(nearest)];
}

/// One depth of the last keyframe; the variance follows the depth as in Engel et al. (2013),
/// equation (13).
void InverseDepthMap::Bring(const EdgeDepth& from, const Eigen::Isometry3d& new_from_last) {
  const double z = 1.0 / static_cast<double>(from.inverse_depth);
  const Eigen::Vector3d seen =
      new_from_last * Eigen::Vector3d((from.u - camera_.cx) / camera_.fx * z,
                                      (from.v - camera_.cy) / camera_.fy * z, z);
  if (!(seen.z() > static_cast<double>(config_.min_depth_m))) return;
  EdgeDepth* edge = NearestEdge(static_cast<float>(camera_.fx * seen.x() / seen.z() + camera_.cx),
                                static_cast<float>(camera_.fy * seen.y() / seen.z() + camera_.cy));
  if (edge == nullptr) return;
  const auto inverse_depth = static_cast<float>(1.0 / seen.z());
  const float ratio = inverse_depth / from.inverse_depth;
  const float stretch = ratio * ratio * (1 + config_.growth);
  const float variance = from.variance * stretch * stretch;
  if (!edge->known) {
    edge->known = true;
    edge->misses = from.misses;
    edge->inverse_depth = inverse_depth;
    edge->variance = variance;
  } else if (InverseDepthsAgree(edge->inverse_depth, edge->variance, inverse_depth, variance,
                                config_.gate_sigmas)) {
    FuseInverseDepth(*edge, inverse_depth, variance);
  } else if (inverse_depth > edge->inverse_depth) {  // The nearer one hides the other.
    edge->misses = from.misses;
    edge->inverse_depth = inverse_depth;
    edge->variance = variance;
  }
}

void InverseDepthMap::Measure(const cv::Mat& keyframe, const cv::Mat& other,
                              const Eigen::Isometry3d& other_from_keyframe, bool find_new) {
  const EpipolarSearch search(keyframe, other, camera_, other_from_keyframe, config_.search);
  for (EdgeDepth& edge : edges_) {
    if (edge.known) {
      MeasureOne(edge, search);
    } else if (find_new) {
      FindNew(edge, search);
    }
  }
}

void InverseDepthMap::MeasureOne(EdgeDepth& edge, const EpipolarSearch& search) const {
  const float reach = config_.search_sigmas * std::sqrt(edge.variance);
  const float low = std::max(1 / config_.max_depth_m, edge.inverse_depth - reach);
  const float high = std::min(1 / config_.min_depth_m, edge.inverse_depth + reach);
  if (!(low < high) || search.LineLength(edge.u, edge.v, low, high) < config_.min_line_px) return;
  const auto match = search.Find(edge.u, edge.v, low, high, false);
  if (!match) return;
  if (InverseDepthsAgree(edge.inverse_depth, edge.variance, match->inverse_depth, match->variance,
                         config_.gate_sigmas)) {
    FuseInverseDepth(edge, match->inverse_depth, match->variance);
    edge.misses = 0;
  } else if (++edge.misses >= config_.max_misses) {
    edge.known = false;
  }
}

void InverseDepthMap::FindNew(EdgeDepth& edge, const EpipolarSearch& search) const {
  const Interval all = {1 / config_.max_depth_m, 1 / config_.min_depth_m};
  std::optional<EpipolarMatch> match;
  if (const auto near = NeighboursInterval(edge)) {
    match = search.Find(edge.u, edge.v, near->low, near->high, true);
  }
  if (!match) match = search.Find(edge.u, edge.v, all.low, all.high, true);
  if (!match || match->inverse_depth < all.low || match->inverse_depth > all.high) return;
  edge.known = true;
  edge.misses = 0;
  edge.inverse_depth = match->inverse_depth;
  edge.variance = match->variance;
}

/// Where the depths of the known edges around an edge suggest to search its own.
std::optional<InverseDepthMap::Interval> InverseDepthMap::NeighboursInterval(
    const EdgeDepth& edge) const {
  Interval interval = {std::numeric_limits<float>::infinity(), 0};
  for (int dy = -kMapBorderPx; dy <= kMapBorderPx; ++dy) {
    const int* index = index_.ptr<int>(edge.v + dy) + edge.u;
    for (int dx = -kMapBorderPx; dx <= kMapBorderPx; ++dx) {
      if (index[dx] < 0) continue;
      const EdgeDepth& other = edges_[static_cast<std::size_t>(index[dx])];
      if (!other.known) continue;
      interval.low = std::min(interval.low, other.inverse_depth);
      interval.high = std::max(interval.high, other.inverse_depth);
    }
  }
  if (interval.high <= 0) return std::nullopt;
  interval.low = std::max(1 / config_.max_depth_m, interval.low * (1 - config_.neighbour_margin));
  interval.high = std::min(1 / config_.min_depth_m, interval.high * (1 + config_.neighbour_margin));
  return interval;
}

void InverseDepthMap::Regularise() {
  smoothed_.resize(edges_.size());
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    EdgeDepth& edge = edges_[i];
    smoothed_[i] = edge.inverse_depth;
    if (!edge.known) continue;
    float sum = edge.inverse_depth / edge.variance, weights = 1 / edge.variance;
    int friends = 0, strangers = 0;
    for (int dy = -2; dy <= 2; ++dy) {
      for (int dx = -2; dx <= 2; ++dx) {
        const int neighbour = index_.at<int>(edge.v + dy, edge.u + dx);
        if (neighbour < 0 || (dx == 0 && dy == 0)) continue;
        const EdgeDepth& other = edges_[static_cast<std::size_t>(neighbour)];
        if (!other.known) continue;
        if (!InverseDepthsAgree(edge.inverse_depth, edge.variance, other.inverse_depth,
                                other.variance, 2)) {
          ++strangers;
          continue;
        }
        ++friends;
        const float weight = 1 / (other.variance + edge.variance);
        sum += weight * other.inverse_depth;
        weights += weight;
      }
    }
    smoothed_[i] = sum / weights;
    if (strangers > 2 * friends) smoothed_[i] = 0;
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    if (!edges_[i].known) continue;
    if (smoothed_[i] > 0) {
      edges_[i].inverse_depth = smoothed_[i];
    } else {
      edges_[i].known = false;
    }
  }
}

bool InverseDepthMap::IsCertain(const EdgeDepth& edge) const {
  const float worst = config_.worst_relative_sigma * edge.inverse_depth;
  return edge.known && edge.variance <= worst * worst;
}

const cv::Mat& InverseDepthMap::DepthImage() {
  depth_.create(camera_.height, camera_.width, CV_32FC1);
  sigma_.create(depth_.size(), CV_32FC1);
  depth_.setTo(0);
  sigma_.setTo(0);
  for (const EdgeDepth& edge : edges_) {
    if (!IsCertain(edge)) continue;
    for (int dy = -1; dy <= 1; ++dy) {
      float* depth = depth_.ptr<float>(edge.v + dy) + edge.u;
      float* sigma = sigma_.ptr<float>(edge.v + dy) + edge.u;
      for (int dx = -1; dx <= 1; ++dx) {
        const bool own = dx == 0 && dy == 0;
        if (!own && depth[dx] > 0) continue;
        depth[dx] = 1 / edge.inverse_depth;
        sigma[dx] = config_.shared_error * std::sqrt(edge.variance);
      }
    }
  }
  return depth_;
}

std::size_t InverseDepthMap::CountKnown() const {
  return static_cast<std::size_t>(std::count_if(edges_.begin(), edges_.end(),
                                                [](const EdgeDepth& edge) { return edge.known; }));
}

}  // namespace livemap::odometry
