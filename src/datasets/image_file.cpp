#include "datasets/image_file.h"

#include "common/error.h"
#include "imaging/decode.h"

namespace livemap::datasets {
namespace {

constexpr std::size_t kMaxImageFileBytes = 64U << 20U;
constexpr std::int64_t kMaxPixels = 64'000'000;

}  // namespace

ImageFile ReadImageFile(const std::string& path, int width, int height) {
  const std::string text = ReadFile(path, kMaxImageFileBytes);
  ImageFile file;
  file.bytes.assign(text.begin(), text.end());
  try {
    imaging::DecodeImage(file.bytes.data(), file.bytes.size(), kMaxPixels);
  } catch (const Error& error) {
    throw Error("'" + path + "': " + error.what());
  }
  file.header = *imaging::ReadImageHeader(file.bytes.data(), file.bytes.size());
  if ((width > 0 && file.header.width != width) || (height > 0 && file.header.height != height)) {
    throw Error("'" + path + "' is " + std::to_string(file.header.width) + "x" +
                std::to_string(file.header.height) + ", the camera's calibration is for " +
                std::to_string(width) + "x" + std::to_string(height));
  }
  return file;
}

}  // namespace livemap::datasets
