#include "imaging/image_header.h"

#include <algorithm>
#include <string_view>

#include "imaging/file_bytes.h"

namespace livemap::imaging {
namespace {

using Format = ImageHeader::Format;

// How much padding some cameras write behind the end marker.
constexpr std::size_t kEndPadding = 64;

/// None where a side is zero or above what an int holds.
std::optional<ImageHeader> MakeImageHeader(Format format, std::uint32_t width, std::uint32_t height,
                                           std::uint32_t channels) {
  constexpr std::uint32_t kLargest = 0x7fffffff;
  if (width == 0 || height == 0 || width > kLargest || height > kLargest) return std::nullopt;
  return ImageHeader{format, static_cast<int>(width), static_cast<int>(height),
                     static_cast<int>(channels)};
}

bool IsJpegFrameHeader(std::uint32_t marker) {
  // SOF0..SOF15 but the table segments DHT, JPG and DAC that stand among them.
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::optional<ImageHeader> ReadJpegHeader(const FileBytes& bytes) {
  std::size_t at = 2;
  while (bytes.Has(at, 4)) {
    if (bytes.BigEndian(at, 1) != 0xff) return std::nullopt;
    const std::uint32_t marker = bytes.BigEndian(at + 1, 1);
    if (marker == 0xff) {  // Fill byte.
      ++at;
      continue;
    }
    // Start of image, restart, end of image, start of scan: no frame header came before.
    if (marker <= 0x01 || (marker >= 0xd0 && marker <= 0xda)) return std::nullopt;
    const std::size_t length = bytes.BigEndian(at + 2, 2);
    if (length < 2) return std::nullopt;
    if (IsJpegFrameHeader(marker)) {
      if (length < 8 || !bytes.Has(at, 10)) return std::nullopt;
      return MakeImageHeader(Format::kJpeg, bytes.BigEndian(at + 7, 2), bytes.BigEndian(at + 5, 2),
                             bytes.BigEndian(at + 9, 1));
    }
    at += 2 + length;
  }
  return std::nullopt;
}

std::optional<ImageHeader> ReadPngHeader(const FileBytes& bytes) {
  if (!bytes.Matches(8, std::string_view("\0\0\0\x0dIHDR", 8)) || !bytes.Has(16, 17)) {
    return std::nullopt;
  }
  const std::uint32_t colour_type = bytes.BigEndian(25, 1);
  const std::uint32_t channels = colour_type == 0   ? 1
                                 : colour_type == 4 ? 2
                                 : colour_type == 6 ? 4
                                                    : 3;
  return MakeImageHeader(Format::kPng, bytes.BigEndian(16, 4), bytes.BigEndian(20, 4), channels);
}

std::optional<ImageHeader> ReadWebpHeader(const FileBytes& bytes) {
  constexpr std::uint32_t kColour = 3;
  if (bytes.Matches(12, "VP8X") && bytes.Has(20, 10)) {
    return MakeImageHeader(Format::kWebp, bytes.LittleEndian(24, 3) + 1,
                           bytes.LittleEndian(27, 3) + 1, kColour);
  }
  if (bytes.Matches(12, "VP8L") && bytes.Matches(20, "\x2f") && bytes.Has(21, 4)) {
    const std::uint32_t packed = bytes.LittleEndian(21, 4);
    return MakeImageHeader(Format::kWebp, (packed & 0x3fff) + 1, (packed >> 14 & 0x3fff) + 1,
                           kColour);
  }
  if (bytes.Matches(12, "VP8 ") && bytes.Matches(23, "\x9d\x01\x2a") && bytes.Has(26, 4)) {
    return MakeImageHeader(Format::kWebp, bytes.LittleEndian(26, 2) & 0x3fff,
                           bytes.LittleEndian(28, 2) & 0x3fff, kColour);
  }
  return std::nullopt;
}

/// The offset behind the end of image of a JPEG whose segments and scans are whole; none otherwise.
std::optional<std::size_t> EndOfJpeg(const FileBytes& bytes) {
  std::size_t at = 2;
  while (bytes.Has(at, 2)) {
    if (bytes.BigEndian(at, 1) != 0xff) {  // Of a scan's data.
      ++at;
      continue;
    }
    const std::uint32_t marker = bytes.BigEndian(at + 1, 1);
    if (marker == 0xd9) return at + 2;
    if (marker == 0xff) {  // Fill byte.
      ++at;
    } else if (marker <= 0x01 || (marker >= 0xd0 && marker <= 0xd8)) {
      at += 2;  // A byte of data that looks like a marker, or a marker without a segment.
    } else {
      if (!bytes.Has(at, 4)) return std::nullopt;
      at += 2 + std::size_t{bytes.BigEndian(at + 2, 2)};
    }
  }
  return std::nullopt;
}

/// The same behind IEND.
std::optional<std::size_t> EndOfPng(const FileBytes& bytes) {
  for (std::size_t at = 8; bytes.Has(at, 12);) {
    const std::size_t end = at + 12 + bytes.BigEndian(at, 4);
    if (bytes.Matches(at + 4, "IEND"))
      return end <= bytes.size() ? std::optional(end) : std::nullopt;
    at = end;
  }
  return std::nullopt;
}

}  // namespace

const char* FormatName(Format format) {
  switch (format) {
    case Format::kJpeg:
      return "jpeg";
    case Format::kPng:
      return "png";
    case Format::kWebp:
      return "webp";
  }
  return "";
}

std::optional<ImageHeader> ReadImageHeader(const std::uint8_t* data, std::size_t size) {
  const FileBytes bytes(data, size);
  if (bytes.Matches(0, "\xff\xd8")) return ReadJpegHeader(bytes);
  if (bytes.Matches(0, "\x89PNG\r\n\x1a\n")) return ReadPngHeader(bytes);
  if (bytes.Matches(0, "RIFF") && bytes.Matches(8, "WEBP")) return ReadWebpHeader(bytes);
  return std::nullopt;
}

bool HasImageEnd(const std::uint8_t* data, std::size_t size, Format format) {
  if (format == Format::kWebp) {
    const FileBytes bytes(data, size);
    return bytes.Has(4, 4) && bytes.Has(8, bytes.LittleEndian(4, 4));
  }
  const std::string_view marker = format == Format::kJpeg ? "\xff\xd9" : "IEND";
  const std::size_t tail = std::min(size, kEndPadding + 8);
  const std::string_view end(reinterpret_cast<const char*>(data) + (size - tail), tail);
  return end.find(marker) != std::string_view::npos;
}

std::optional<std::size_t> BytesBehindEnd(const std::uint8_t* data, std::size_t size,
                                          Format format) {
  const FileBytes bytes(data, size);
  std::optional<std::size_t> end;
  switch (format) {
    case Format::kJpeg:
      end = EndOfJpeg(bytes);
      break;
    case Format::kPng:
      end = EndOfPng(bytes);
      break;
    case Format::kWebp:
      if (HasImageEnd(data, size, format)) end = std::size_t{8} + bytes.LittleEndian(4, 4);
      break;
  }
  if (!end) return std::nullopt;
  return size - *end;
}

}  // namespace livemap::imaging
