#include "odometry/edge/shift_search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace livemap::odometry {
namespace {

constexpr double kShiftAcross = 0.4;   // Share of the width: the largest shift to a side,
constexpr double kShiftAlong = 0.2;    // and up or down.
constexpr double kShiftMinSpread = 2;  // Grey levels; less is no picture.
constexpr double kShiftContrast = 40;  // Grey levels, of the pictures made alike.
constexpr int kShiftNeighbourPx = 1;   // Within it a better shift stands for a worse one.
constexpr int kShiftMinOverlap = 3;    // One part in so many of the area.

/// False when the picture is even.
bool MakeShiftPictureAlike(const cv::Mat& grey, std::vector<std::uint8_t>& out) {
  double sum = 0, squares = 0;
  for (int y = 0; y < grey.rows; ++y) {
    const std::uint8_t* row = grey.ptr(y);
    for (int x = 0; x < grey.cols; ++x) {
      sum += row[x];
      squares += row[x] * row[x];
    }
  }
  const auto count = static_cast<double>(grey.total());
  const double mean = sum / count, spread = std::sqrt(std::max(0.0, squares / count - mean * mean));
  if (spread < kShiftMinSpread) return false;
  std::array<std::uint8_t, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    table[i] = cv::saturate_cast<std::uint8_t>(128 + kShiftContrast / spread *
                                                         (static_cast<double>(i) - mean));
  }
  out.resize(grey.total());
  std::size_t at = 0;
  for (int y = 0; y < grey.rows; ++y) {
    const std::uint8_t* row = grey.ptr(y);
    for (int x = 0; x < grey.cols; ++x) out[at++] = table[row[x]];
  }
  return true;
}

float ShiftCost(const std::uint8_t* reference, const std::uint8_t* picture, cv::Size size, int dx,
                int dy) {
  const int left = std::max(0, -dx), right = std::min(size.width, size.width - dx);
  const int top = std::max(0, -dy), bottom = std::min(size.height, size.height - dy);
  const int area = (right - left) * (bottom - top);
  if (right <= left || bottom <= top || kShiftMinOverlap * area < size.area()) {
    return std::numeric_limits<float>::infinity();
  }
  std::uint32_t sum = 0;
  for (int y = top; y < bottom; ++y) {
    const std::uint8_t* a = reference + y * size.width + left;
    const std::uint8_t* b = picture + (y + dy) * size.width + left + dx;
    for (int x = 0; x < right - left; ++x) {
      sum += static_cast<std::uint32_t>(std::abs(int{a[x]} - int{b[x]}));
    }
  }
  return static_cast<float>(sum) / static_cast<float>(area);
}

}  // namespace

void ShiftSearch::Reserve(std::size_t pixels) {
  reference_.reserve(pixels);
  picture_.reserve(pixels);
  costs_.reserve(pixels);
}

ShiftSearch::Shifts ShiftSearch::Find(const cv::Mat& reference, const cv::Mat& picture) {
  Shifts found;
  if (!MakeShiftPictureAlike(reference, reference_) || !MakeShiftPictureAlike(picture, picture_)) {
    return found;
  }
  const int across = static_cast<int>(kShiftAcross * reference.cols);
  const int along = static_cast<int>(kShiftAlong * reference.cols);
  const int columns = 2 * across + 1, rows = 2 * along + 1;
  costs_.resize(static_cast<std::size_t>(columns * rows));
  for (int dy = -along; dy <= along; ++dy) {
    for (int dx = -across; dx <= across; ++dx) {
      costs_[static_cast<std::size_t>((dy + along) * columns + dx + across)] =
          ShiftCost(reference_.data(), picture_.data(), reference.size(), dx, dy);
    }
  }
  while (found.count < kMostShifts) {
    const auto best = std::min_element(costs_.begin(), costs_.end());
    if (!std::isfinite(*best)) break;
    const auto index = static_cast<int>(best - costs_.begin());
    const int row = index / columns, column = index % columns;
    found.best[found.count++] = {column - across, row - along, *best};
    for (int y = std::max(0, row - kShiftNeighbourPx);
         y <= std::min(rows - 1, row + kShiftNeighbourPx); ++y) {
      for (int x = std::max(0, column - kShiftNeighbourPx);
           x <= std::min(columns - 1, column + kShiftNeighbourPx); ++x) {
        costs_[static_cast<std::size_t>(y * columns + x)] = std::numeric_limits<float>::infinity();
      }
    }
  }
  return found;
}

}  // namespace livemap::odometry
