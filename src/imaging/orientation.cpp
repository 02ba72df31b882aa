#include "imaging/orientation.h"

#include "imaging/file_bytes.h"

namespace livemap::imaging {
namespace {

constexpr std::uint32_t kOrientationTag = 0x0112;
constexpr std::uint32_t kShort = 3;
constexpr std::uint32_t kMaxEntries = 1000;

/// Of EXIF data, which are a TIFF file with one directory that counts.
int OrientationOfTiff(const FileBytes& tiff) {
  const bool little = tiff.Matches(0, "II");
  if (!little && !tiff.Matches(0, "MM")) return kUpright;
  const auto number = [&](std::size_t at, std::size_t count) {
    return little ? tiff.LittleEndian(at, count) : tiff.BigEndian(at, count);
  };
  if (!tiff.Has(0, 8) || number(2, 2) != 42) return kUpright;
  const std::size_t directory = number(4, 4);
  if (!tiff.Has(directory, 2)) return kUpright;
  const std::uint32_t entries = number(directory, 2);
  for (std::uint32_t i = 0; i < entries && i < kMaxEntries; ++i) {
    const std::size_t entry = directory + 2 + std::size_t{12} * i;
    if (!tiff.Has(entry, 12)) return kUpright;
    if (number(entry, 2) != kOrientationTag) continue;
    if (number(entry + 2, 2) != kShort || number(entry + 4, 4) != 1) return kUpright;
    const std::uint32_t value = number(entry + 8, 2);
    return value >= 1 && value <= 8 ? static_cast<int>(value) : kUpright;
  }
  return kUpright;
}

int OrientationOfJpeg(const FileBytes& bytes) {
  std::size_t at = 2;
  while (bytes.Has(at, 4) && bytes.BigEndian(at, 1) == 0xff) {
    const std::uint32_t marker = bytes.BigEndian(at + 1, 1);
    if (marker == 0xff) {  // Fill byte.
      ++at;
      continue;
    }
    // Start of scan, end of image and what has no length: metadata stand before them.
    if (marker <= 0x01 || (marker >= 0xd0 && marker <= 0xda)) return kUpright;
    const std::size_t length = bytes.BigEndian(at + 2, 2);
    if (length < 2) return kUpright;
    if (marker == 0xe1 && length >= 8 && bytes.Matches(at + 4, std::string_view("Exif\0\0", 6))) {
      return OrientationOfTiff(bytes.From(at + 10, length - 8));
    }
    at += 2 + length;
  }
  return kUpright;
}

int OrientationOfPng(const FileBytes& bytes) {
  for (std::size_t at = 8; bytes.Has(at, 12);) {
    const std::size_t length = bytes.BigEndian(at, 4);
    if (bytes.Matches(at + 4, "eXIf")) return OrientationOfTiff(bytes.From(at + 8, length));
    if (bytes.Matches(at + 4, "IEND")) return kUpright;
    at += 12 + length;
  }
  return kUpright;
}

}  // namespace

int ReadOrientation(const std::uint8_t* data, std::size_t size) {
  const FileBytes bytes(data, size);
  if (bytes.Matches(0, "\xff\xd8")) return OrientationOfJpeg(bytes);
  if (bytes.Matches(0, "\x89PNG\r\n\x1a\n")) return OrientationOfPng(bytes);
  return kUpright;
}

cv::Mat Upright(const cv::Mat& stored, int orientation) {
  constexpr int kTopToBottom = 0;
  constexpr int kLeftToRight = 1;
  constexpr int kBoth = -1;
  cv::Mat turned = stored;
  if (SwapsSides(orientation)) cv::transpose(stored, turned);
  cv::Mat upright;
  switch (orientation) {
    case 2:
    case 6:
      cv::flip(turned, upright, kLeftToRight);
      return upright;
    case 3:
    case 7:
      cv::flip(turned, upright, kBoth);
      return upright;
    case 4:
    case 8:
      cv::flip(turned, upright, kTopToBottom);
      return upright;
    default:
      return turned;
  }
}

}  // namespace livemap::imaging
