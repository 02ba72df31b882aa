#include "zone/image_header.h"

#include <cstring>

namespace livemap {
namespace {

/// A file's bytes that can only be read within their bounds.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::size_t size() const { return size_; }
  bool Has(std::size_t offset, std::size_t count) const {
    return offset <= size_ && count <= size_ - offset;
  }
  bool Matches(std::size_t offset, const char* text, std::size_t count) const {
    return Has(offset, count) && std::memcmp(data_ + offset, text, count) == 0;
  }
  std::uint32_t BigEndian(std::size_t offset, std::size_t count) const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value = value << 8 | data_[offset + i];
    return value;
  }
  std::uint32_t LittleEndian(std::size_t offset, std::size_t count) const {
    std::uint32_t value = 0;
    for (std::size_t i = count; i-- > 0;) value = value << 8 | data_[offset + i];
    return value;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

bool IsFrameHeader(std::uint32_t marker) {
  // SOF0..SOF15 but the table segments DHT, JPG and DAC that stand among them.
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::optional<ImageHeader> ReadJpeg(const Bytes& bytes) {
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
    if (IsFrameHeader(marker)) {
      if (length < 8 || !bytes.Has(at, 9)) return std::nullopt;
      return ImageHeader{"jpeg", bytes.BigEndian(at + 7, 2), bytes.BigEndian(at + 5, 2)};
    }
    at += 2 + length;
  }
  return std::nullopt;
}

std::optional<ImageHeader> ReadPng(const Bytes& bytes) {
  if (!bytes.Matches(8, "\0\0\0\x0dIHDR", 8) || !bytes.Has(16, 17)) return std::nullopt;
  return ImageHeader{"png", bytes.BigEndian(16, 4), bytes.BigEndian(20, 4)};
}

std::optional<ImageHeader> ReadWebp(const Bytes& bytes) {
  if (bytes.Matches(12, "VP8X", 4) && bytes.Has(20, 10)) {
    return ImageHeader{"webp", bytes.LittleEndian(24, 3) + 1, bytes.LittleEndian(27, 3) + 1};
  }
  if (bytes.Matches(12, "VP8L", 4) && bytes.Matches(20, "\x2f", 1) && bytes.Has(21, 4)) {
    const std::uint32_t packed = bytes.LittleEndian(21, 4);
    return ImageHeader{"webp", (packed & 0x3fff) + 1, (packed >> 14 & 0x3fff) + 1};
  }
  if (bytes.Matches(12, "VP8 ", 4) && bytes.Matches(23, "\x9d\x01\x2a", 3) && bytes.Has(26, 4)) {
    return ImageHeader{"webp", bytes.LittleEndian(26, 2) & 0x3fff,
                       bytes.LittleEndian(28, 2) & 0x3fff};
  }
  return std::nullopt;
}

}  // namespace

std::optional<ImageHeader> ReadImageHeader(const std::uint8_t* data, std::size_t size) {
  const Bytes bytes(data, size);
  std::optional<ImageHeader> header;
  if (bytes.Matches(0, "\xff\xd8", 2)) header = ReadJpeg(bytes);
  if (bytes.Matches(0, "\x89PNG\r\n\x1a\n", 8)) header = ReadPng(bytes);
  if (bytes.Matches(0, "RIFF", 4) && bytes.Matches(8, "WEBP", 4)) header = ReadWebp(bytes);
  if (header && (header->width == 0 || header->height == 0)) return std::nullopt;
  return header;
}

}  // namespace livemap
