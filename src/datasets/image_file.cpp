#include "datasets/image_file.h"

#include <utility>

#include "common/error.h"
#include "common/text.h"
#include "imaging/decode.h"
#include "imaging/orientation.h"

namespace livemap::datasets {
namespace {

constexpr std::size_t kMaxImageFileBytes = 64U << 20U;
constexpr std::int64_t kMaxPixels = 64'000'000;

std::string SizeText(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

struct DecodedFile {
  ImageFile file;
  cv::Mat image;
};

void CheckSize(const std::string& path, const DecodedFile& decoded, int width, int height) {
  const cv::Mat& image = decoded.image;
  if ((width <= 0 || image.cols == width) && (height <= 0 || image.rows == height)) return;
  const int orientation =
      imaging::ReadOrientation(decoded.file.bytes.data(), decoded.file.bytes.size());
  throw Error("'" + path + "' is " + SizeText(image.cols, image.rows) +
              (orientation == imaging::kUpright ? ""
                                                : " after turning it as its EXIF orientation " +
                                                      std::to_string(orientation) + " says") +
              ", the camera's calibration is for " + SizeText(width, height));
}

DecodedFile Decode(const std::string& path, int width, int height,
                   const imaging::DecodeConfig& config) {
  const std::string text = ReadFile(path, kMaxImageFileBytes);
  DecodedFile decoded;
  decoded.file.bytes.assign(text.begin(), text.end());
  const std::vector<std::uint8_t>& bytes = decoded.file.bytes;
  try {
    decoded.image = imaging::DecodeImage(bytes.data(), bytes.size(), kMaxPixels, config);
  } catch (const Error& error) {
    throw Error("'" + path + "': " + error.what());
  }
  decoded.file.header = *imaging::ReadImageHeader(bytes.data(), bytes.size());
  decoded.file.header.width = decoded.image.cols;
  decoded.file.header.height = decoded.image.rows;
  CheckSize(path, decoded, width, height);
  return decoded;
}

}  // namespace

ImageFile ReadImageFile(const std::string& path, int width, int height) {
  return std::move(Decode(path, width, height, {}).file);
}

cv::Mat ReadPictureFile(const std::string& path, int width, int height,
                        imaging::DecodeConfig::Pixels pixels) {
  return Decode(path, width, height, {pixels, true}).image;
}

cv::Mat ReadDepthFile(const std::string& path, int width, int height) {
  cv::Mat depth = ReadPictureFile(path, width, height, imaging::DecodeConfig::Pixels::kAsStored);
  if (depth.type() != CV_16UC1) {
    throw Error("the depth image '" + path + "' has " +
                PixelText(static_cast<int>(8 * depth.elemSize1()), depth.channels()) +
                ", accepted is a PNG of " + PixelText(16, 1));
  }
  return depth;
}

}  // namespace livemap::datasets
