#include "odometry/edge/point_selector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

namespace livemap::odometry {
namespace {

constexpr int kBorderPx = 2;
/// Of an edge, from 0 to half a turn.
constexpr std::size_t kDirections = 8;
/// Of the lines of one direction.
constexpr std::size_t kLineOffsets = 128;

float HalfPointDifference(int before, int after) {
  return 0.5F * static_cast<float>(after - before);
}

struct Gradient {
  float x, y;
};

Gradient PointGradientAt(const cv::Mat& grey, int x, int y) {
  const std::uint8_t* row = grey.ptr(y);
  return {HalfPointDifference(row[x - 1], row[x + 1]),
          HalfPointDifference(grey.ptr(y - 1)[x], grey.ptr(y + 1)[x])};
}

/// Whether some pixel up to two away is clearly nearer: as far as an occluding edge's gradient
/// reaches.
bool IsPointBehindAnEdge(const cv::Mat& depth_m, int x, int y, float ratio) {
  const float limit = depth_m.ptr<float>(y)[x] / ratio;
  for (int dy = -kBorderPx; dy <= kBorderPx; ++dy) {
    const float* row = depth_m.ptr<float>(y + dy);
    for (int dx = -kBorderPx; dx <= kBorderPx; ++dx) {
      if (row[x + dx] > 0 && row[x + dx] < limit) return true;
    }
  }
  return false;
}

bool IsUsablePoint(const ReferenceLevel& reference, const Pixel& pixel,
                   const PointSelection& selection) {
  const Gradient gradient = PointGradientAt(reference.grey, pixel.x, pixel.y);
  return gradient.x * gradient.x + gradient.y * gradient.y >=
             selection.min_gradient * selection.min_gradient &&
         !IsPointBehindAnEdge(reference.depth_m, pixel.x, pixel.y, selection.occlusion_ratio);
}

void AddEdgePoint(const ReferenceLevel& reference, const Pixel& pixel,
                  const geo::CameraIntrinsics& camera, EdgePoints& points) {
  const Gradient gradient = PointGradientAt(reference.grey, pixel.x, pixel.y);
  points.Add(pixel.x, pixel.y, reference.depth_m.ptr<float>(pixel.y)[pixel.x],
             reference.grey.ptr(pixel.y)[pixel.x], gradient.x, gradient.y, camera);
  const cv::Mat& sigma = reference.inverse_depth_sigma;
  if (!sigma.empty()) {
    points.inverse_depth_sigma.push_back(sigma.ptr<float>(pixel.y)[pixel.x]);
  }
}

/// Which of the directions a gradient has, whatever its sign.
std::uint8_t DirectionOf(const Gradient& gradient) {
  const float angle = std::atan2(gradient.y, gradient.x) / static_cast<float>(M_PI) + 1;
  return static_cast<std::uint8_t>(static_cast<std::size_t>(angle * kDirections + 0.5F) %
                                   kDirections);
}

/// What each direction gets of so many: all it has, or as much as the others that have more.
std::array<std::size_t, kDirections> FairShares(const std::array<std::size_t, kDirections>& counts,
                                                std::size_t most) {
  std::array<std::size_t, kDirections> order{}, shares{};
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(),
            [&counts](std::size_t a, std::size_t b) { return counts[a] < counts[b]; });
  for (std::size_t i = 0; i < kDirections; ++i) {
    shares[order[i]] = std::min(counts[order[i]], most / (kDirections - i));
    most -= shares[order[i]];
  }
  return shares;
}

/// Calls `visit` with every column of a mask's row, from `begin` on and before `end`, that is set.
/// Most are not: eight are looked at together.
template <typename Visit>
void ForEachPointSet(const std::uint8_t* mask, int begin, int end, const Visit& visit) {
  int x = begin;
  for (; x + 8 <= end; x += 8) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, mask + x, sizeof(eight));
    while (eight != 0) {
      const int byte = __builtin_ctzll(eight) / 8;
      visit(x + byte);
      eight &= ~(std::uint64_t{0xff} << (8 * byte));
    }
  }
  for (; x < end; ++x) {
    if (mask[x] != 0) visit(x);
  }
}

}  // namespace

void EdgePoints::Clear() {
  for (auto* values : {&x, &y, &z, &intensity, &inverse_depth_sigma, &slope}) values->clear();
  for (auto& column : jacobian) column.clear();
  gradient_noise = 0;
}

void EdgePoints::Reserve(std::size_t count) {
  for (auto* values : {&x, &y, &z, &intensity, &inverse_depth_sigma, &slope})
    values->reserve(count);
  for (auto& column : jacobian) column.reserve(count);
}

void EdgePoints::Add(float u, float v, float depth_m, float grey, float gradient_x,
                     float gradient_y, const geo::CameraIntrinsics& camera) {
  const auto fx = static_cast<float>(camera.fx);
  const auto fy = static_cast<float>(camera.fy);
  const float px = (u - static_cast<float>(camera.cx)) / fx * depth_m;
  const float py = (v - static_cast<float>(camera.cy)) / fy * depth_m;
  x.push_back(px);
  y.push_back(py);
  z.push_back(depth_m);
  intensity.push_back(grey);
  slope.push_back(std::sqrt(gradient_x * gradient_x + gradient_y * gradient_y));
  // Gradient by the point, equation (5); by its motion, equation (6).
  const float a = gradient_x * fx / depth_m;
  const float b = gradient_y * fy / depth_m;
  const float c = -(a * px + b * py) / depth_m;
  jacobian[0].push_back(a);
  jacobian[1].push_back(b);
  jacobian[2].push_back(c);
  jacobian[3].push_back(py * c - depth_m * b);
  jacobian[4].push_back(depth_m * a - px * c);
  jacobian[5].push_back(px * b - py * a);
}

void EdgePoints::Finish() {
  double sum = 0;
  for (const float depth_m : z) sum += 1.0 / static_cast<double>(depth_m);
  mean_inverse_depth = z.empty() ? 0 : sum / static_cast<double>(z.size());
}

void PointSelector::Select(const ReferenceLevel& reference, const cv::Mat& edges,
                           const geo::CameraIntrinsics& camera, const PointSelection& selection,
                           EdgePoints& points) {
  candidates_.clear();
  for (int y = kBorderPx; y < reference.grey.rows - kBorderPx; ++y) {
    const std::uint8_t* mask = edges.ptr(y);
    const float* depth = reference.depth_m.ptr<float>(y);
    ForEachPointSet(mask, kBorderPx, reference.grey.cols - kBorderPx, [&](int x) {
      if (depth[x] <= 0) return;
      candidates_.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
    });
  }
  points.Clear();
  if (selection.choice != PixelChoice::kEdges) {
    SelectAtRandom(reference, camera, selection, points);
    return;
  }
  points.Clear();
  FindDirections(reference.grey);
  Thin(selection.max_points);
  OrderByLines(reference.grey.size());
  for (const Pixel& pixel : candidates_) {
    if (IsUsablePoint(reference, pixel, selection)) AddEdgePoint(reference, pixel, camera, points);
  }
  points.Finish();
}

void PointSelector::FindDirections(const cv::Mat& grey) {
  directions_.resize(candidates_.size());
  std::transform(
      candidates_.begin(), candidates_.end(), directions_.begin(),
      [&grey](const Pixel& pixel) { return DirectionOf(PointGradientAt(grey, pixel.x, pixel.y)); });
}

/// Leaves at most so many candidates, in their order. Directions that are rare keep theirs: a wall
/// of stripes must not outvote the few edges that say how far the camera moved along it
/// (Rusinkiewicz and Levoy 2001, normal-space sampling, of the image's gradients).
void PointSelector::Thin(std::size_t most) {
  if (candidates_.size() <= most) return;
  std::array<std::size_t, kDirections> counts{};
  for (const std::uint8_t direction : directions_) ++counts[direction];
  const std::array<std::size_t, kDirections> shares = FairShares(counts, most);
  std::array<std::size_t, kDirections> seen{};
  std::size_t kept = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const std::size_t direction = directions_[i];
    const std::size_t before = seen[direction]++ * shares[direction] / counts[direction];
    if (seen[direction] * shares[direction] / counts[direction] > before) {
      directions_[kept] = directions_[i];
      candidates_[kept++] = candidates_[i];
    }
  }
  candidates_.resize(kept);
  directions_.resize(kept);
}

/// Puts pixels of one straight line one after the other: they err together, by aliasing or by a
/// depth, and the alignment's covariance takes those that follow each other for one part.
void PointSelector::OrderByLines(cv::Size size) {
  std::array<std::size_t, kDirections * kLineOffsets + 1> begins{};
  std::array<Gradient, kDirections> across{};  // By part of the image's reach.
  const auto reach = static_cast<float>(2 * (size.width + size.height));
  for (std::size_t i = 0; i < kDirections; ++i) {
    const float angle = static_cast<float>(i) * static_cast<float>(M_PI) / kDirections;
    across[i] = {std::cos(angle) / reach, std::sin(angle) / reach};
  }
  const auto line_of = [&](std::size_t i) {
    const Gradient& normal = across[directions_[i]];
    const float offset = 0.5F + normal.x * static_cast<float>(candidates_[i].x) +
                         normal.y * static_cast<float>(candidates_[i].y);
    return directions_[i] * kLineOffsets + static_cast<std::size_t>(offset * kLineOffsets);
  };
  for (std::size_t i = 0; i < candidates_.size(); ++i) ++begins[line_of(i) + 1];
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  ordered_.resize(candidates_.size());
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    ordered_[begins[line_of(i)]++] = candidates_[i];
  }
  std::swap(candidates_, ordered_);
}

/// From the pixels under the mask. Both random choices take equally many: they are counted and
/// drawn among those that can be used.
void PointSelector::SelectAtRandom(const ReferenceLevel& reference,
                                   const geo::CameraIntrinsics& camera,
                                   const PointSelection& selection, EdgePoints& points) {
  const auto forget_useless = [&](const PointSelection& asked) {
    candidates_.erase(
        std::remove_if(candidates_.begin(), candidates_.end(),
                       [&](const Pixel& pixel) { return !IsUsablePoint(reference, pixel, asked); }),
        candidates_.end());
  };
  forget_useless(selection);
  const auto asked_for = static_cast<std::size_t>(
      std::llround(selection.share * static_cast<double>(candidates_.size())));
  if (selection.choice == PixelChoice::kRandomPixels) {
    candidates_.clear();
    for (int y = kBorderPx; y < reference.grey.rows - kBorderPx; ++y) {
      for (int x = kBorderPx; x < reference.grey.cols - kBorderPx; ++x) {
        if (reference.depth_m.ptr<float>(y)[x] <= 0) continue;
        candidates_.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
      }
    }
    PointSelection any_gradient = selection;
    any_gradient.min_gradient = 0;
    forget_useless(any_gradient);
  }
  const std::size_t count = candidates_.size();
  const std::size_t wanted = std::min({asked_for, selection.max_points, count});
  for (std::size_t i = 0; i < wanted; ++i) {
    // Fisher and Yates; the standard's distributions differ from library to library.
    if (wanted < count) std::swap(candidates_[i], candidates_[i + random_() % (count - i)]);
    AddEdgePoint(reference, candidates_[i], camera, points);
  }
  points.Finish();
}

void PointSelector::SelectAll(const cv::Mat& grey, const geo::CameraIntrinsics& camera,
                              EdgePoints& points) {
  points.Clear();
  for (int y = 1; y < grey.rows - 1; ++y) {
    for (int x = 1; x < grey.cols - 1; ++x) {
      const Gradient gradient = PointGradientAt(grey, x, y);
      points.Add(static_cast<float>(x), static_cast<float>(y), 1.0F, grey.ptr(y)[x], gradient.x,
                 gradient.y, camera);
    }
  }
  points.Finish();
}

}  // namespace livemap::odometry
