#pragma once

#include <cstdint>

namespace livemap::imaging {

/// A rectangle in an image: edges in pixels, x to the right and y down, (0, 0) the outer corner of
/// the first pixel, min < max.
struct Box {
  float x_min = 0;
  float y_min = 0;
  float x_max = 0;
  float y_max = 0;

  bool operator==(const Box& other) const {
    return x_min == other.x_min && y_min == other.y_min && x_max == other.x_max &&
           y_max == other.y_max;
  }
};

/// A part of an image in whole pixels. Without width or height it stands for the whole image.
struct PixelRegion {
  std::uint32_t x = 0;  ///< Left edge.
  std::uint32_t y = 0;  ///< Upper edge.
  std::uint32_t width = 0;
  std::uint32_t height = 0;

  bool IsWholeImage() const { return width == 0 && height == 0; }
};

}  // namespace livemap::imaging
