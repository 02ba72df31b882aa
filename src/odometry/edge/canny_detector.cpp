#include "odometry/edge/canny_detector.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>

namespace livemap::odometry {
namespace {

constexpr double kSobelGain = 8;
constexpr std::uint8_t kWeak = 1, kStrong = 255;
constexpr int kLanes = 8;  // Pixels worked off at once; narrower images have no edges.

/// Sobel's two factors down the columns: smoothing 1 2 1 and difference -1 0 1.
void CannyAcrossRows(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
                     int width, std::int16_t* smooth, std::int16_t* difference) {
  for (int x = 0; x < width; ++x) {
    smooth[x] = static_cast<std::int16_t>(above[x] + 2 * here[x] + below[x]);
    difference[x] = static_cast<std::int16_t>(below[x] - above[x]);
  }
}

/// And the other two along the row; `norm` is |dx| + |dy|. The first and last column see themselves
/// beyond the border.
void CannyAlongRow(const std::int16_t* smooth, const std::int16_t* difference, int width,
                   std::int16_t* dx, std::int16_t* dy, std::int16_t* norm) {
  for (int x = 1; x < width - 1; ++x) {
    const int across = smooth[x + 1] - smooth[x - 1];
    const int down = difference[x - 1] + 2 * difference[x] + difference[x + 1];
    dx[x] = static_cast<std::int16_t>(across);
    dy[x] = static_cast<std::int16_t>(down);
    norm[x] = static_cast<std::int16_t>(std::abs(across) + std::abs(down));
  }
  for (const int x : {0, width - 1}) {
    const int left = std::max(x - 1, 0), right = std::min(x + 1, width - 1);
    dx[x] = static_cast<std::int16_t>(smooth[right] - smooth[left]);
    dy[x] = static_cast<std::int16_t>(difference[left] + 2 * difference[x] + difference[right]);
    norm[x] = static_cast<std::int16_t>(std::abs(dx[x]) + std::abs(dy[x]));
  }
}

/// Which of eight pixels have the largest norm across their edge: all bits set where so. Canny's
/// four directions, told apart by the slopes 13/32 (tan 22.1 degrees) and 32/13, which 16 bits
/// hold.
cv::v_int16x8 AreCannyRidges(const std::int16_t* above, const std::int16_t* here,
                             const std::int16_t* below, const std::int16_t* dx,
                             const std::int16_t* dy) {
  using cv::v_load;
  using cv::v_select;
  const cv::v_int16x8 across = v_load(dx), down = v_load(dy), zero = cv::v_setzero_s16();
  const cv::v_int16x8 width = cv::v_max(across, zero - across),
                      height = cv::v_max(down, zero - down);
  const cv::v_int16x8 fine = cv::v_setall_s16(13);
  const cv::v_int16x8 upright = (height << 5) < cv::v_mul_wrap(width, fine);
  const cv::v_int16x8 level = (width << 5) < cv::v_mul_wrap(height, fine);
  const cv::v_int16x8 falling = (across ^ down) < zero;  // The gradient's signs differ.
  const cv::v_int16x8 before_slant = v_select(falling, v_load(above + 1), v_load(above - 1));
  const cv::v_int16x8 after_slant = v_select(falling, v_load(below - 1), v_load(below + 1));
  const cv::v_int16x8 before =
      v_select(upright, v_load(here - 1), v_select(level, v_load(above), before_slant));
  const cv::v_int16x8 after =
      v_select(upright, v_load(here + 1), v_select(level, v_load(below), after_slant));
  const cv::v_int16x8 norm = v_load(here);
  return (norm > before) & (norm >= after);
}

/// The upper left part of an image that is kept and only ever grows.
cv::Mat CannyMemoryView(cv::Mat& memory, cv::Size size, int type) {
  if (memory.cols < size.width || memory.rows < size.height) {
    memory.create(std::max(memory.rows, size.height), std::max(memory.cols, size.width), type);
  }
  return memory(cv::Rect({0, 0}, size));
}

}  // namespace

const cv::Mat& CannyDetector::Extract(const cv::Mat& grey, double strong_share,
                                      double min_gradient) {
  Differentiate(grey);
  const int strong = StrongThreshold(strong_share, min_gradient);
  ThinAbove(static_cast<int>(kWeakOfStrong * strong), strong);
  FollowEdges();
  return edges_;
}

const cv::Mat& CannyDetector::ExtractAbove(const cv::Mat& grey, int weak, int strong) {
  Differentiate(grey);
  ThinAbove(weak, strong);
  FollowEdges();
  return edges_;
}

void CannyDetector::Reserve(cv::Size size) {
  const cv::Size framed(size.width + 2, size.height + 2);
  CannyMemoryView(dx_memory_, size, CV_16SC1);
  CannyMemoryView(dy_memory_, size, CV_16SC1);
  CannyMemoryView(norm_memory_, framed, CV_16SC1);
  CannyMemoryView(edges_memory_, size, CV_8UC1);
  smooth_.reserve(static_cast<std::size_t>(size.width));
  difference_.reserve(static_cast<std::size_t>(size.width));
  open_.reserve(static_cast<std::size_t>(size.area()));
}

void CannyDetector::Differentiate(const cv::Mat& grey) {
  dx_ = CannyMemoryView(dx_memory_, grey.size(), CV_16SC1);
  dy_ = CannyMemoryView(dy_memory_, grey.size(), CV_16SC1);
  // One empty row and column around, so that no pixel needs a special case.
  norm_ = CannyMemoryView(norm_memory_, cv::Size(grey.cols + 2, grey.rows + 2), CV_16SC1);
  for (const int y : {0, norm_.rows - 1}) {
    std::memset(norm_.ptr(y), 0, sizeof(std::int16_t) * static_cast<std::size_t>(norm_.cols));
  }
  for (int y = 0; y < norm_.rows; ++y) {
    norm_.ptr<std::int16_t>(y)[0] = norm_.ptr<std::int16_t>(y)[norm_.cols - 1] = 0;
  }
  const auto width = static_cast<std::size_t>(grey.cols);
  smooth_.resize(width);
  difference_.resize(width);
  for (int y = 0; y < grey.rows; ++y) {
    CannyAcrossRows(grey.ptr(std::max(y - 1, 0)), grey.ptr(y),
                    grey.ptr(std::min(y + 1, grey.rows - 1)), grey.cols, smooth_.data(),
                    difference_.data());
    CannyAlongRow(smooth_.data(), difference_.data(), grey.cols, dx_.ptr<std::int16_t>(y),
                  dy_.ptr<std::int16_t>(y), norm_.ptr<std::int16_t>(y + 1) + 1);
  }
}

int CannyDetector::StrongThreshold(double strong_share, double min_gradient) const {
  constexpr std::size_t kBins = 512;
  constexpr int kBinWidth = 4;  // Sobel's L1 norm reaches 2040.
  std::array<int, kBins> histogram{};
  int total = 0;
  for (int y = 2; y < norm_.rows - 2; y += 4) {
    const auto* row = norm_.ptr<std::int16_t>(y);
    for (int x = 2 + y / 4 % 4; x < norm_.cols - 2; x += 4) {
      ++histogram[std::min(static_cast<std::size_t>(row[x] / kBinWidth), kBins - 1)];
      ++total;
    }
  }
  int strong = static_cast<int>(strong_share * total);
  std::size_t bin = kBins - 1;
  while (bin > 0 && (strong -= histogram[bin]) > 0) --bin;
  return std::max(static_cast<int>(min_gradient * kSobelGain), static_cast<int>(bin) * kBinWidth);
}

/// Marks ridges above the weak threshold and lists those above the strong one.
void CannyDetector::ThinAbove(int weak, int strong) {
  edges_ = CannyMemoryView(edges_memory_, dx_.size(), CV_8UC1);
  open_.clear();
  if (edges_.cols < kLanes || edges_.rows < 3) {
    edges_.setTo(0);
    return;
  }
  const cv::v_int16x8 weak_norm = cv::v_setall_s16(cv::saturate_cast<short>(weak));
  const cv::v_int16x8 strong_norm = cv::v_setall_s16(cv::saturate_cast<short>(strong));
  for (int y = 0; y < edges_.rows; ++y) {
    std::uint8_t* out = edges_.ptr(y);
    const std::int16_t* norm = norm_.ptr<std::int16_t>(y + 1) + 1;
    const std::int16_t* above = norm_.ptr<std::int16_t>(y) + 1;
    const std::int16_t* below = norm_.ptr<std::int16_t>(y + 2) + 1;
    const auto* dx = dx_.ptr<std::int16_t>(y);
    const auto* dy = dy_.ptr<std::int16_t>(y);
    for (int next = 0; next < edges_.cols; next += kLanes) {
      // The last eight may overlap the ones before.
      const int x = std::min(next, edges_.cols - kLanes);
      const cv::v_int16x8 enough = cv::v_load(norm + x) > weak_norm;
      if (!cv::v_check_any(enough)) {
        std::memset(out + x, 0, kLanes);
        continue;
      }
      const cv::v_int16x8 ridges =
          enough & AreCannyRidges(above + x, norm + x, below + x, dx + x, dy + x);
      const cv::v_int16x8 strong_ridges = ridges & (cv::v_load(norm + x) > strong_norm);
      const cv::v_int16x8 marks =
          (ridges & cv::v_setall_s16(kWeak)) | (strong_ridges & cv::v_setall_s16(kStrong));
      cv::v_pack_u_store(out + x, marks);
      for (int bits = cv::v_signmask(strong_ridges); bits != 0; bits &= bits - 1) {
        open_.push_back(out + x + __builtin_ctz(static_cast<unsigned>(bits)));
      }
    }
  }
}

/// Weak pixels that touch a strong one become strong, the others vanish.
void CannyDetector::FollowEdges() {
  const auto step = static_cast<std::ptrdiff_t>(edges_.step[0]);
  if (open_.empty()) {
    edges_.setTo(0);
    return;
  }
  const std::uint8_t* first = edges_.ptr(1);
  const std::uint8_t* last = edges_.ptr(edges_.rows - 2) + edges_.cols;
  while (!open_.empty()) {
    std::uint8_t* pixel = open_.back();
    open_.pop_back();
    if (pixel < first || pixel >= last) continue;  // In the first or last row.
    const std::ptrdiff_t column = (pixel - edges_.data) % step;
    if (column == 0 || column == edges_.cols - 1) continue;
    for (const std::ptrdiff_t neighbour : {-step - 1, -step, -step + 1, std::ptrdiff_t{-1},
                                           std::ptrdiff_t{1}, step - 1, step, step + 1}) {
      if (pixel[neighbour] != kWeak) continue;
      pixel[neighbour] = kStrong;
      open_.push_back(pixel + neighbour);
    }
  }
  for (int y = 0; y < edges_.rows; ++y) {
    std::uint8_t* row = edges_.ptr(y);
    for (int x = 0; x < edges_.cols; ++x) row[x] = row[x] == kStrong ? kStrong : 0;
  }
}

}  // namespace livemap::odometry
