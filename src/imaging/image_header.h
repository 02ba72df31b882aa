#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace livemap::imaging {

/// What a compressed picture says about itself before anything decodes it.
struct ImageHeader {
  enum class Format { kJpeg, kPng, kWebp };
  Format format = Format::kJpeg;
  int width = 0;     ///< Pixels, at least 1.
  int height = 0;    ///< Pixels, at least 1.
  int channels = 0;  ///< Colour components as stored: 1 grey, 2 grey + alpha, 3 colour, 4.
};

/// "jpeg", "png" or "webp".
const char* FormatName(ImageHeader::Format format);

/// Reads the size of a JPEG (first frame header, ITU-T T.81 B.2.2), PNG (IHDR chunk, ISO/IEC 15948
/// 11.2.2) or WebP (VP8, VP8L or VP8X chunk, RFC 9649 2.5 to 2.7) without decoding: OpenCV's
/// decoder would allocate up to 2^30 pixels on a header's word. None for anything else, when the
/// bytes end before the size, and for a width or height of zero. Reads within `size` bytes only.
std::optional<ImageHeader> ReadImageHeader(const std::uint8_t* data, std::size_t size);

/// A picture that was cut off decodes to half an image with a grey rest: true when the end marker
/// (JPEG EOI, PNG IEND) stands within the last bytes, padding tolerated, or all bytes that the RIFF
/// header of a WebP announces are there.
bool HasImageEnd(const std::uint8_t* data, std::size_t size, ImageHeader::Format format);

/// How many bytes stand behind the end of a whole picture, found segment by segment (JPEG), chunk
/// by chunk (PNG) or by the RIFF header (WebP): some cameras append a film or a thumbnail. None for
/// a picture that was cut off.
std::optional<std::size_t> BytesBehindEnd(const std::uint8_t* data, std::size_t size,
                                          ImageHeader::Format format);

}  // namespace livemap::imaging
