#pragma once

#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <vector>

namespace livemap::test {

/// A JPEG of `image` whose EXIF data say the orientation, as a phone writes it.
inline std::vector<std::uint8_t> OrientedJpeg(const cv::Mat& image, int orientation,
                                              bool big_endian = false) {
  std::vector<std::uint8_t> file;
  cv::imencode(".jpg", image, file);
  const auto value = static_cast<std::uint8_t>(orientation);
  std::vector<std::uint8_t> exif = {0xff, 0xe1, 0, 34, 'E', 'x', 'i', 'f', 0, 0};
  const std::vector<std::uint8_t> little = {'I', 'I', 42, 0, 8, 0,     0, 0, 1, 0, 0x12, 1, 3,
                                            0,   1,   0,  0, 0, value, 0, 0, 0, 0, 0,    0, 0};
  const std::vector<std::uint8_t> big = {'M', 'M', 0, 42, 0, 0, 0,     8, 0, 1, 1, 0x12, 0,
                                         3,   0,   0, 0,  1, 0, value, 0, 0, 0, 0, 0,    0};
  const std::vector<std::uint8_t>& tiff = big_endian ? big : little;
  exif.insert(exif.end(), tiff.begin(), tiff.end());
  file.insert(file.begin() + 2, exif.begin(), exif.end());
  return file;
}

}  // namespace livemap::test
