#include "imaging/decode.h"

#include <opencv2/imgcodecs.hpp>
#include <string>

#include "common/error.h"
#include "imaging/image_header.h"
#include "imaging/orientation.h"

namespace livemap::imaging {
namespace {

int FlagsFor(const ImageHeader& header, DecodeConfig::Pixels pixels) {
  // IMREAD_UNCHANGED never looks at the orientation.
  if (pixels == DecodeConfig::Pixels::kAsStored) return cv::IMREAD_UNCHANGED;
  const bool grey = pixels == DecodeConfig::Pixels::kGreyOrColour && header.channels <= 2;
  return (grey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR) | cv::IMREAD_IGNORE_ORIENTATION;
}

}  // namespace

cv::Mat DecodeImage(const std::uint8_t* bytes, std::size_t size, std::int64_t max_pixels,
                    const DecodeConfig& config) {
  const std::optional<ImageHeader> header = ReadImageHeader(bytes, size);
  // Not WebP: where libwebp takes no interest, OpenCV would hand the bytes to other libraries.
  if (!header || header->format == ImageHeader::Format::kWebp) {
    throw Error("the image of " + std::to_string(size) + " bytes is no JPEG or PNG");
  }
  const std::string dimensions =
      std::to_string(header->width) + "x" + std::to_string(header->height);
  if (static_cast<std::int64_t>(header->width) * header->height > max_pixels) {
    throw Error("the image says it is " + dimensions + ", accepted are " +
                std::to_string(max_pixels) + " pixels");
  }
  if (!HasImageEnd(bytes, size, header->format) && !BytesBehindEnd(bytes, size, header->format)) {
    throw Error("the image of " + dimensions + " is cut off after " + std::to_string(size) +
                " bytes");
  }
  const cv::Mat encoded(1, static_cast<int>(size), CV_8UC1, const_cast<std::uint8_t*>(bytes));
  cv::Mat image;
  try {
    image = cv::imdecode(encoded, FlagsFor(*header, config.pixels));
  } catch (const cv::Exception& exception) {
    throw Error("the image of " + dimensions + " cannot be decoded: " + exception.err);
  }
  if (image.empty()) throw Error("the image of " + dimensions + " cannot be decoded");
  return config.upright ? Upright(image, ReadOrientation(bytes, size)) : image;
}

}  // namespace livemap::imaging
