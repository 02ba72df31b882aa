#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace livemap {

/// What a compressed picture says about itself before anything is decoded.
struct FrameHeader {
  enum class Format { kJpeg, kPng };
  Format format = Format::kJpeg;
  int width = 0;     ///< Pixels.
  int height = 0;    ///< Pixels.
  int channels = 0;  ///< Colour components as stored: 1 grey, 2 grey + alpha, 3 colour, 4.
};

/// Reads the size of a JPEG (first frame header, ITU-T T.81 B.2.2) or PNG (IHDR chunk, ISO/IEC
/// 15948 11.2.2) without decoding: OpenCV's decoder would allocate up to 2^30 pixels on a header's
/// word. None when the bytes are neither or end before the size.
std::optional<FrameHeader> ReadFrameHeader(const std::uint8_t* bytes, std::size_t size);

/// A picture that was cut off decodes to half an image with a grey rest: true when the end marker
/// (JPEG EOI, PNG IEND) stands within the last bytes, padding tolerated.
bool HasImageEnd(const std::uint8_t* bytes, std::size_t size, FrameHeader::Format format);

}  // namespace livemap
