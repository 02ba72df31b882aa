#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>

namespace livemap::imaging {

/// How stored pixels are turned and mirrored to stand upright: the values of EXIF's tag Orientation
/// (CIPA DC-008 4.6.4). 1: as stored; 2: mirrored left to right; 3: turned by 180 degrees; 4:
/// mirrored top to bottom; 5: mirrored about the falling diagonal; 6: turned by 90 degrees
/// clockwise; 7: mirrored about the rising diagonal; 8: turned by 90 degrees counterclockwise.
constexpr int kUpright = 1;

/// Whether width and height change places: from 5 on.
constexpr bool SwapsSides(int orientation) { return orientation >= 5; }

/// The orientation that a JPEG (APP1 segment) or PNG (eXIf chunk) says; kUpright where it says none
/// or no valid one. Reads within `size` bytes only.
int ReadOrientation(const std::uint8_t* data, std::size_t size);

/// The image as it stands upright; of any type. With kUpright the image itself, not a copy.
cv::Mat Upright(const cv::Mat& stored, int orientation);

}  // namespace livemap::imaging
