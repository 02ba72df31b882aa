#include "ingest/image_header.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace livemap {
namespace {

constexpr std::array<std::uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
// How much padding some cameras write behind the end marker.
constexpr std::size_t kEndPadding = 64;

int BigEndian16(const std::uint8_t* bytes) { return bytes[0] << 8 | bytes[1]; }

std::uint32_t BigEndian32(const std::uint8_t* bytes) {
  return static_cast<std::uint32_t>(BigEndian16(bytes)) << 16 |
         static_cast<std::uint32_t>(BigEndian16(bytes + 2));
}

bool StandsAlone(int marker) { return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8); }

bool IsFrameHeader(int marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::optional<FrameHeader> ReadJpeg(const std::uint8_t* bytes, std::size_t size) {
  std::size_t at = 2;
  while (at + 4 <= size) {
    if (bytes[at] != 0xff) return std::nullopt;
    const int marker = bytes[at + 1];
    if (marker == 0xff) {  // Fill byte.
      ++at;
      continue;
    }
    if (StandsAlone(marker)) {
      at += 2;
      continue;
    }
    if (marker == 0xd9 || marker == 0xda) return std::nullopt;  // Image data before its header.
    const auto length = static_cast<std::size_t>(BigEndian16(bytes + at + 2));
    if (length < 2 || at + 2 + length > size) return std::nullopt;
    if (IsFrameHeader(marker)) {
      if (length < 8) return std::nullopt;
      return FrameHeader{FrameHeader::Format::kJpeg, BigEndian16(bytes + at + 7),
                         BigEndian16(bytes + at + 5), bytes[at + 9]};
    }
    at += 2 + length;
  }
  return std::nullopt;
}

std::optional<FrameHeader> ReadPng(const std::uint8_t* bytes, std::size_t size) {
  constexpr std::size_t kHeaderEnd = 8 + 8 + 13;
  if (size < kHeaderEnd || std::memcmp(bytes + 12, "IHDR", 4) != 0) return std::nullopt;
  const std::uint32_t width = BigEndian32(bytes + 16);
  const std::uint32_t height = BigEndian32(bytes + 20);
  constexpr std::uint32_t kLargest = 0x7fffffff;
  if (width > kLargest || height > kLargest) return std::nullopt;
  const int colour_type = bytes[25];
  const int channels = colour_type == 0 ? 1 : colour_type == 4 ? 2 : colour_type == 6 ? 4 : 3;
  return FrameHeader{FrameHeader::Format::kPng, static_cast<int>(width), static_cast<int>(height),
                     channels};
}

}  // namespace

std::optional<FrameHeader> ReadFrameHeader(const std::uint8_t* bytes, std::size_t size) {
  std::optional<FrameHeader> header;
  if (size >= 4 && bytes[0] == 0xff && bytes[1] == 0xd8) {
    header = ReadJpeg(bytes, size);
  } else if (size >= kPngSignature.size() &&
             std::equal(kPngSignature.begin(), kPngSignature.end(), bytes)) {
    header = ReadPng(bytes, size);
  }
  if (header && (header->width <= 0 || header->height <= 0)) return std::nullopt;
  return header;
}

bool HasImageEnd(const std::uint8_t* bytes, std::size_t size, FrameHeader::Format format) {
  const std::size_t tail = std::min(size, kEndPadding + 8);
  const std::uint8_t* const begin = bytes + (size - tail);
  const std::array<std::uint8_t, 2> eoi = {0xff, 0xd9};
  const std::array<std::uint8_t, 4> iend = {'I', 'E', 'N', 'D'};
  if (format == FrameHeader::Format::kJpeg) {
    return std::search(begin, bytes + size, eoi.begin(), eoi.end()) != bytes + size;
  }
  return std::search(begin, bytes + size, iend.begin(), iend.end()) != bytes + size;
}

}  // namespace livemap
