#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "imaging/decode.h"
#include "imaging/image_header.h"

namespace livemap::datasets {

/// An image file's bytes as they are, checked.
struct ImageFile {
  std::vector<std::uint8_t> bytes;
  imaging::ImageHeader header;  ///< Width and height as the image stands upright.
};

/// Reads a JPEG or PNG and decodes it once to know that it is whole. Throws Error naming the file
/// and what is wrong with it: missing, above 64 MiB or 64 megapixels, corrupt, or not `width` x
/// `height` when those are positive. The size is that after turning the image as its EXIF
/// orientation says; where that alone contradicts `width` x `height`, the Error says so.
ImageFile ReadImageFile(const std::string& path, int width, int height);

/// The picture of a calibrated camera, decoded as `pixels` says and upright. Throws Error as
/// ReadImageFile.
cv::Mat ReadPictureFile(const std::string& path, int width, int height,
                        imaging::DecodeConfig::Pixels pixels);

/// A depth image as CV_16UC1, in the file's units. Throws Error as ReadImageFile, and naming depth
/// and channels of an image that is anything but a PNG of one channel with 16 bits.
cv::Mat ReadDepthFile(const std::string& path, int width, int height);

}  // namespace livemap::datasets
