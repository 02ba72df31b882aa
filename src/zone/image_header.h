#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace livemap {

/// What a compressed picture says about itself before anything decodes it.
struct ImageHeader {
  std::string format;  ///< "jpeg", "png" or "webp".
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

/// Reads the dimensions of a JPEG (ITU T.81: the first frame header), PNG (IHDR) or WebP (VP8, VP8L
/// or VP8X chunk) file. None for anything else, for truncated headers and for zero dimensions.
/// Reads within `size` bytes only and allocates nothing that depends on the content.
std::optional<ImageHeader> ReadImageHeader(const std::uint8_t* data, std::size_t size);

}  // namespace livemap
