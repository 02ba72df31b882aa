// How pictures and films say that they lie: EXIF in JPEG and PNG, the track's matrix in MP4; and
// where a picture ends. The first byte chooses.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "imaging/image_header.h"
#include "imaging/orientation.h"
#include "imaging/video_orientation.h"

namespace livemap::fuzz {
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void FuzzOne(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  const std::vector<std::uint8_t> bytes(data + 1, data + size);
  int orientation = imaging::kUpright;
  if (data[0] % 2 == 0) {
    orientation = imaging::OrientationOfMovie(bytes);
  } else {
    orientation = imaging::ReadOrientation(bytes.data(), bytes.size());
    for (const auto format :
         {imaging::ImageHeader::Format::kJpeg, imaging::ImageHeader::Format::kPng,
          imaging::ImageHeader::Format::kWebp}) {
      const auto behind = imaging::BytesBehindEnd(bytes.data(), bytes.size(), format);
      Require(!behind || *behind <= bytes.size());
    }
  }
  Require(orientation >= 1 && orientation <= 8);
  const cv::Mat small(2, 3, CV_8UC1, cv::Scalar(7));
  Require(imaging::Upright(small, orientation).total() == small.total());
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::FuzzOne(data, size);
  return 0;
}
