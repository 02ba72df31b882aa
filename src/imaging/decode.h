#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>

namespace livemap::imaging {

/// Decodes a whole JPEG or PNG to 8-bit grey (CV_8UC1) or BGR (CV_8UC3). Throws Error saying what
/// is wrong: neither format, more than `max_pixels`, cut off, or refused by the decoder.
cv::Mat DecodeImage(const std::uint8_t* bytes, std::size_t size, std::int64_t max_pixels);

}  // namespace livemap::imaging
