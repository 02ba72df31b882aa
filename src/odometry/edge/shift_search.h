#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace livemap::odometry {

/// Finds by how many pixels one small picture is shifted against another, whatever their light:
/// every whole shift is tried, so that nothing depends on where the search begins. Keeps its
/// buffers; not thread-safe.
class ShiftSearch {
 public:
  struct Shift {
    int x = 0, y = 0;  ///< Where a pixel of the reference lies in the new picture, less its place.
    float cost = 0;    ///< Mean absolute difference after both pictures' contrast is made alike.
  };
  static constexpr std::size_t kMostShifts = 8;
  struct Shifts {
    std::array<Shift, kMostShifts> best;
    std::size_t count = 0;
    const Shift* begin() const { return best.data(); }
    const Shift* end() const { return best.data() + count; }
  };

  /// Memory for pictures of so many pixels.
  void Reserve(std::size_t pixels);

  /// The best shifts up to two fifths of the width to a side and one fifth up or down, best first,
  /// none next to a better one.
  /// Both are CV_8UC1 of one size. None when one of them is as good as even: a covered lens.
  Shifts Find(const cv::Mat& reference, const cv::Mat& picture);

 private:
  std::vector<std::uint8_t> reference_, picture_;  // With the same mean and contrast.
  std::vector<float> costs_;                       // Of all shifts, row by row.
};

}  // namespace livemap::odometry
