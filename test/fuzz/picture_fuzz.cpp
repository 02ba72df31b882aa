// Pictures as vehicles and cameras send them: what is made of them for people and drivers, and what
// the vehicle's own ingest decodes. The first byte chooses, the second and third place the box.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "common/error.h"
#include "imaging/decode.h"
#include "imaging/image_header.h"
#include "zone/pictures/jpeg_walk.h"
#include "zone/pictures/picture_recoder.h"

namespace livemap::fuzz {
namespace {

constexpr int kMaxPixels = 1 << 18;
constexpr int kLongestSidePx = 64;
constexpr std::size_t kSmallBytes = 1500;

void Require(bool holds) {
  if (!holds) std::abort();
}

/// Whatever came in, what goes out is a plain, whole JPEG of a bounded size.
void CheckServed(const std::vector<std::uint8_t>& served, int longest_side_px) {
  const auto header = imaging::ReadImageHeader(served.data(), served.size());
  Require(header && header->format == imaging::ImageHeader::Format::kJpeg);
  Require(header->width <= longest_side_px && header->height <= longest_side_px);
  Require(!zone::WhyNoWholeJpeg(served, 1));
  Require(served[served.size() - 2] == 0xff && served.back() == 0xd9);
}

zone::PictureLimits Limits() {
  zone::PictureLimits limits;
  limits.max_pixels = kMaxPixels;
  limits.longest_side_px = kLongestSidePx;
  return limits;
}

void FuzzThumbnail(const std::vector<std::uint8_t>& file, std::uint8_t x, std::uint8_t y) {
  zone::SmallPictureLimits limits;
  limits.picture = Limits();
  limits.max_bytes = kSmallBytes;
  const imaging::Box box{x * 1.0F - 20, y * 1.0F - 20, x * 1.0F, y * 2.0F};
  const std::vector<std::uint8_t> small =
      zone::SmallPicture(file, box, {x % 7U, y % 5U, 200, 150}, limits);
  Require(small.size() <= kSmallBytes);
  if (!small.empty()) CheckServed(small, limits.width_px);
}

void FuzzOne(const std::uint8_t* data, std::size_t size) {
  if (size < 3) return;
  const std::vector<std::uint8_t> file(data + 3, data + size);
  try {
    switch (data[0] % 4) {
      case 0:
        CheckServed(zone::RecodePicture(file, Limits()), kLongestSidePx);
        break;
      case 1:
        FuzzThumbnail(file, data[1], data[2]);
        break;
      case 2:
        zone::WhyNoWholeJpeg(file, data[1]);
        Require(zone::DecodingWork(file) >= 0);
        break;
      default:
        Require(!imaging::DecodeImage(file.data(), file.size(), kMaxPixels).empty());
    }
  } catch (const Error& error) {
    Require(error.what()[0] != '\0');
  }
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzOne(data, size);
  return 0;
}
