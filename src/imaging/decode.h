#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>

namespace livemap::imaging {

/// What DecodeImage makes of a file.
struct DecodeConfig {
  enum class Pixels {
    kGreyOrColour,  ///< CV_8UC1 for one colour component, else CV_8UC3 (BGR).
    kColour,        ///< CV_8UC3 (BGR), of grey files too.
    kAsStored,      ///< Depth and channels of the file; a palette is resolved.
  };
  Pixels pixels = Pixels::kGreyOrColour;
  /// Pixels are turned as the file's orientation says (ReadOrientation). Otherwise they stay as
  /// they are stored, for pictures whose size a header has announced.
  bool upright = true;
};

/// Decodes a whole JPEG or PNG. Throws Error saying what is wrong: neither format, more than
/// `max_pixels`, cut off, or refused by the decoder. Bytes behind the picture's end do not count.
cv::Mat DecodeImage(const std::uint8_t* bytes, std::size_t size, std::int64_t max_pixels,
                    const DecodeConfig& config = {});

}  // namespace livemap::imaging
