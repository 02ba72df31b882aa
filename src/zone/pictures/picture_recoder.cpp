#include "zone/pictures/picture_recoder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "common/error.h"
#include "imaging/image_header.h"
#include "imaging/report_picture.h"
#include "zone/pictures/jpeg_walk.h"

namespace livemap::zone {
namespace {

// Encoders write about ten for a progressive picture.
constexpr int kMaxScans = 32;
// A view of fewer pixels shows nothing of the surroundings, a smaller frame is lost to the coding.
constexpr int kMinViewPx = 96;
constexpr int kMinFramePx = 10;
constexpr double kViewPerBox = 2.5;
constexpr int kThumbnailQuality = 75;

std::string Dimensions(const imaging::ImageHeader& header) {
  return std::to_string(header.width) + " x " + std::to_string(header.height) + " pixels";
}

/// `pixels` that each cost as much as `factor`, at least 1, plain ones. A header may say anything:
/// what is beyond an int64 is the most that it holds.
std::int64_t PictureWork(std::int64_t pixels, std::int64_t factor) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  return pixels > kMost / factor ? kMost : pixels * factor;
}

/// Everything that can be known without decoding.
imaging::ImageHeader CheckedHeader(const std::vector<std::uint8_t>& file,
                                   const PictureLimits& limits) {
  if (file.size() > limits.max_bytes) {
    throw Error("the picture has " + std::to_string(file.size()) + " bytes, accepted are " +
                std::to_string(limits.max_bytes));
  }
  const std::optional<imaging::ImageHeader> header =
      imaging::ReadImageHeader(file.data(), file.size());
  // Not WebP: where libwebp takes no interest, OpenCV would hand the bytes to other libraries.
  if (!header || header->format == imaging::ImageHeader::Format::kWebp) {
    throw Error("the picture is no JPEG or PNG");
  }
  const std::int64_t pixels = static_cast<std::int64_t>(header->width) * header->height;
  if (pixels > limits.max_pixels) {
    throw Error("the picture says it has " + Dimensions(*header) + ", accepted are " +
                std::to_string(limits.max_pixels) + " in all");
  }
  if (DecodingWork(file) > limits.max_work_px) {
    throw Error("the picture of " + Dimensions(*header) +
                " has so many scans or bytes per pixel that it costs as much as one of " +
                std::to_string(DecodingWork(file)) + " pixels, accepted are " +
                std::to_string(limits.max_work_px));
  }
  if (header->format == imaging::ImageHeader::Format::kJpeg) {
    if (const auto why = WhyNoWholeJpeg(file, kMaxScans)) throw Error("the picture " + *why);
  } else if (!imaging::HasImageEnd(file.data(), file.size(), header->format)) {
    throw Error("the picture of " + Dimensions(*header) + " is cut off");
  }
  return *header;
}

/// How many times smaller a JPEG can be decoded and still not be smaller than wanted.
int Reduction(const imaging::ImageHeader& header, int wanted_side_px) {
  if (header.format != imaging::ImageHeader::Format::kJpeg) return 1;
  int reduction = 1;
  while (reduction < 8 &&
         std::max(header.width, header.height) / (2 * reduction) >= wanted_side_px) {
    reduction *= 2;
  }
  return reduction;
}

int DecodingFlags(int reduction) {
  const int colour = reduction == 8   ? cv::IMREAD_REDUCED_COLOR_8
                     : reduction == 4 ? cv::IMREAD_REDUCED_COLOR_4
                     : reduction == 2 ? cv::IMREAD_REDUCED_COLOR_2
                                      : cv::IMREAD_COLOR;
  return colour | cv::IMREAD_IGNORE_ORIENTATION;
}

/// 8-bit BGR whose longest side is at least `wanted_side_px` where the picture's is.
cv::Mat DecodePixels(const std::vector<std::uint8_t>& file, const imaging::ImageHeader& header,
                     int wanted_side_px) {
  const int reduction = Reduction(header, wanted_side_px);
  const cv::Size expected((header.width + reduction - 1) / reduction,
                          (header.height + reduction - 1) / reduction);
  // Cleared: rows that a damaged file leaves out are black, not what was in memory before.
  cv::Mat image = cv::Mat::zeros(expected, CV_8UC3);
  const std::uint8_t* cleared = image.data;
  const cv::Mat encoded(1, static_cast<int>(file.size()), CV_8UC1,
                        const_cast<std::uint8_t*>(file.data()));
  cv::Mat decoded;
  try {
    decoded = cv::imdecode(encoded, DecodingFlags(reduction), &image);
  } catch (const cv::Exception&) {
    throw Error("the picture of " + Dimensions(header) + " cannot be decoded");
  }
  if (decoded.empty() || decoded.data != cleared) {
    throw Error("the picture of " + Dimensions(header) +
                " cannot be decoded, or is not of the size that its header says");
  }
  return decoded;
}

cv::Mat Shrunk(const cv::Mat& image, const cv::Size& size) {
  cv::Mat small;
  cv::resize(image, small, size, 0, 0, cv::INTER_AREA);
  return small;
}

/// Within `width_px` and two thirds of it, never larger than the view.
cv::Size ThumbnailSize(const cv::Size& view, int width_px) {
  const double scale = std::min({1.0, 1.0 * width_px / view.width, width_px / 1.5 / view.height});
  return {std::max(1, static_cast<int>(std::lround(view.width * scale))),
          std::max(1, static_cast<int>(std::lround(view.height * scale)))};
}

/// The part of the image that a thumbnail shows: 3 to 2, around the box, within the image.
cv::Rect View(const cv::Rect2d& box, const cv::Size& image) {
  const double width =
      std::max({kViewPerBox * box.width, 1.5 * kViewPerBox * box.height, 1.0 * kMinViewPx});
  const cv::Size size(std::min(image.width, static_cast<int>(std::ceil(width))),
                      std::min(image.height, static_cast<int>(std::ceil(width / 1.5))));
  const auto start = [](double middle, int length, int available) {
    return std::clamp(static_cast<int>(std::lround(middle - length / 2.0)), 0, available - length);
  };
  return {start(box.x + box.width / 2, size.width, image.width),
          start(box.y + box.height / 2, size.height, image.height), size.width, size.height};
}

/// The box in pixels of a copy of the region that the picture shows.
cv::Rect2d ScaledBox(const imaging::Box& box, const imaging::PixelRegion& shown,
                     const cv::Size& copy) {
  const double width = shown.width;
  const double height = shown.height;
  const double left = box.x_min - 1.0 * shown.x;
  const double top = box.y_min - 1.0 * shown.y;
  const double right = box.x_max - 1.0 * shown.x;
  const double bottom = box.y_max - 1.0 * shown.y;
  // Written so that NaN is refused too.
  const bool has_place =
      right > left && bottom > top && right > 0 && bottom > 0 && left < width && top < height;
  if (!has_place) throw Error("the box is empty or lies outside what the picture shows");
  const double x_min = std::max(0.0, left) * copy.width / width;
  const double y_min = std::max(0.0, top) * copy.height / height;
  const double x_max = std::min(width, right) * copy.width / width;
  const double y_max = std::min(height, bottom) * copy.height / height;
  return {x_min, y_min, x_max - x_min, y_max - y_min};
}

/// First and last pixel of a frame around [begin, begin + length), inside an image of `available`.
std::pair<int, int> FrameEdges(double begin, double length, int available) {
  const double middle = begin + length / 2;
  const double half = std::max(length, 1.0 * kMinFramePx) / 2;
  const int first = std::clamp(static_cast<int>(std::floor(middle - half)), 0, available - 1);
  const int last = std::clamp(static_cast<int>(std::ceil(middle + half)), first, available - 1);
  return {first, last};
}

/// Light on dark, so that it stands out on any ground.
void DrawBox(cv::Mat& image, const cv::Rect2d& box) {
  const auto [left, right] = FrameEdges(box.x, box.width, image.cols);
  const auto [top, bottom] = FrameEdges(box.y, box.height, image.rows);
  cv::rectangle(image, {left, top}, {right, bottom}, cv::Scalar(20, 20, 20), 4);
  cv::rectangle(image, {left, top}, {right, bottom}, cv::Scalar(40, 60, 255), 2);
}

}  // namespace

std::int64_t DecodingWork(const std::vector<std::uint8_t>& file) {
  const auto header = imaging::ReadImageHeader(file.data(), file.size());
  if (!header) return 0;
  const std::int64_t pixels = static_cast<std::int64_t>(header->width) * header->height;
  if (header->format == imaging::ImageHeader::Format::kJpeg) {
    return PictureWork(pixels, CountJpegScans(file));
  }
  if (header->format != imaging::ImageHeader::Format::kPng) return 0;
  // Behind width and height in IHDR: the depth, and at the end the interlacing.
  constexpr std::size_t kDepthAt = 24, kInterlacingAt = 28;
  const std::int64_t bytes_per_channel = file[kDepthAt] > 8 ? 2 : 1;
  const std::int64_t bytes_per_pixel = header->channels * bytes_per_channel;
  const std::int64_t passes = file[kInterlacingAt] != 0 ? 2 : 1;
  return PictureWork(pixels, std::max<std::int64_t>(1, (bytes_per_pixel + 2) / 3) * passes);
}

std::vector<std::uint8_t> RecodePicture(const std::vector<std::uint8_t>& file,
                                        const PictureLimits& limits) {
  const imaging::ImageHeader header = CheckedHeader(file, limits);
  cv::Mat image = DecodePixels(file, header, limits.longest_side_px);
  const int longest = std::max(image.cols, image.rows);
  if (longest > limits.longest_side_px) {
    const double scale = static_cast<double>(limits.longest_side_px) / longest;
    image = Shrunk(image, {std::max(1, static_cast<int>(std::lround(image.cols * scale))),
                           std::max(1, static_cast<int>(std::lround(image.rows * scale)))});
  }
  std::vector<std::uint8_t> recoded;
  if (!cv::imencode(".jpg", image, recoded, {cv::IMWRITE_JPEG_QUALITY, limits.jpeg_quality})) {
    throw Error("the picture of " + Dimensions(header) + " cannot be encoded");
  }
  return recoded;
}

std::vector<std::uint8_t> SmallPicture(const std::vector<std::uint8_t>& file,
                                       const imaging::Box& box, const imaging::PixelRegion& shown,
                                       const SmallPictureLimits& limits) {
  const imaging::ImageHeader header = CheckedHeader(file, limits.picture);
  const cv::Size whole(header.width, header.height);
  // As many pixels as the view needs, however small the box is in the image.
  const double view_width = View(ScaledBox(box, shown, whole), whole).width;
  const double longest = std::max(whole.width, whole.height);
  const double wanted_px = std::min(longest, longest * limits.width_px / view_width);
  const cv::Mat image = DecodePixels(file, header, std::max(1, static_cast<int>(wanted_px)));
  const cv::Rect2d place = ScaledBox(box, shown, image.size());
  const cv::Rect view = View(place, image.size());
  const cv::Size size = ThumbnailSize(view.size(), limits.width_px);
  cv::Mat thumbnail = Shrunk(image(view), size);
  DrawBox(
      thumbnail,
      {(place.x - view.x) * size.width / view.width, (place.y - view.y) * size.height / view.height,
       place.width * size.width / view.width, place.height * size.height / view.height});
  return imaging::EncodeJpeg({thumbnail, nullptr}, kThumbnailQuality, limits.max_bytes);
}

std::vector<std::uint8_t> SmallPicture(const std::vector<std::uint8_t>& file,
                                       const SmallPictureLimits& limits) {
  const imaging::ImageHeader header = CheckedHeader(file, limits.picture);
  const cv::Mat image = DecodePixels(file, header, limits.width_px);
  const cv::Mat thumbnail = Shrunk(image, ThumbnailSize(image.size(), limits.width_px));
  return imaging::EncodeJpeg({thumbnail, nullptr}, kThumbnailQuality, limits.max_bytes);
}

}  // namespace livemap::zone
