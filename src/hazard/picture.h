#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace livemap {

/// An image that others own: `owner` keeps the pixels alive, so that nothing is copied.
struct Picture {
  cv::Mat bgr;  ///< 8-bit, three channels, blue first.
  std::shared_ptr<const void> owner;
};

/// The picture as a JPEG file of at most `max_bytes`: first at `quality` (1..100), then at lower
/// ones, then at half the size and so on. Empty when there is no picture, when it is not 8-bit with
/// three channels, or when even a thumbnail of 64 pixels is too large.
std::vector<std::uint8_t> EncodeJpeg(const Picture& picture, int quality, std::size_t max_bytes);

}  // namespace livemap
