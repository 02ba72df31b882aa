#include "imaging/report_picture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace livemap::imaging {
namespace {

constexpr int kLowestQuality = 30;  // Below it a box is no longer legible: make it smaller instead.
constexpr int kQualityStep = 20;
constexpr int kFineQualityStep = 5;
constexpr int kSmallestSidePx = 64;
constexpr double kCropAspect = 1.5;
constexpr double kMinContext = 1.5;
constexpr double kContextStep = 0.95;  // By its square: a tenth of the surroundings at a time.
constexpr double kScaleStep = 0.84;

/// The box's part of the image; empty when it has none.
cv::Rect2d BoxInsidePicture(const Box& box, const cv::Size& image) {
  // Written so that NaN has no part.
  if (!(box.x_max > box.x_min && box.y_max > box.y_min)) return {};
  const double left = std::max(0.0, static_cast<double>(box.x_min));
  const double top = std::max(0.0, static_cast<double>(box.y_min));
  const double right = std::min(1.0 * image.width, static_cast<double>(box.x_max));
  const double bottom = std::min(1.0 * image.height, static_cast<double>(box.y_max));
  if (!(right > left && bottom > top)) return {};
  return {left, top, right - left, bottom - top};
}

/// 3 to 2 around the box, at least `min_px` wide, moved into the image and cut where it is
/// larger.
cv::Rect CropPictureAround(const cv::Rect2d& box, double context, double min_px,
                           const cv::Size& image) {
  const double width = std::max({context * box.width, context * box.height * kCropAspect, min_px});
  const cv::Size size(std::min(image.width, cvCeil(width)),
                      std::min(image.height, cvCeil(width / kCropAspect)));
  const auto start = [](double middle, int length, int available) {
    return std::clamp(cvRound(middle - length / 2.0), 0, available - length);
  };
  return {start(box.x + box.width / 2, size.width, image.width),
          start(box.y + box.height / 2, size.height, image.height), size.width, size.height};
}

double WidestPictureCrop(const CropConfig& config) { return std::max(config.context, kMinContext); }

bool EncodePictureAt(const cv::Mat& image, int quality, std::size_t max_bytes,
                     CroppedPicture& cropped) {
  // Tables made for the picture save some hundredths of the bytes for a millisecond.
  const std::vector<int> settings{cv::IMWRITE_JPEG_QUALITY, quality, cv::IMWRITE_JPEG_OPTIMIZE, 1};
  if (!cv::imencode(".jpg", image, cropped.jpeg, settings)) return false;
  cropped.quality = quality;
  return cropped.jpeg.size() <= max_bytes;
}

/// The part with `scale` pixels for each of its own and with its marks; others keep their pixels.
cv::Mat MarkedPicture(const cv::Mat& part, double scale, const PictureMarks* marks,
                      const PixelRegion& shown) {
  cv::Mat image = part;
  if (scale < 1) {
    const cv::Size size(std::max(1, cvRound(part.cols * scale)),
                        std::max(1, cvRound(part.rows * scale)));
    cv::resize(part, image, size, 0, 0, cv::INTER_AREA);
  } else if (marks != nullptr) {
    image = part.clone();
  }
  if (marks != nullptr) DrawMarks(image, *marks, shown, scale);
  return image;
}

/// The picture at the best quality from `best` down to `worst` within the bytes; false: none is.
bool EncodePictureBetween(const cv::Mat& image, int best, int worst, std::size_t max_bytes,
                          CroppedPicture& cropped) {
  // The worst first: most pictures that do not fit are known by one encoding.
  if (!EncodePictureAt(image, worst, max_bytes, cropped)) return false;
  for (int quality = best; quality > worst; quality -= kFineQualityStep) {
    if (EncodePictureAt(image, quality, max_bytes, cropped)) return true;
  }
  return EncodePictureAt(image, worst, max_bytes, cropped);
}

/// The best of the part within the bytes whose scale is not below `min_scale`; false: there is
/// none.
bool EncodePictureLegibly(const cv::Mat& part, double min_scale, const CropConfig& config,
                          const PictureMarks* marks, CroppedPicture& cropped) {
  const int legible = std::min(config.quality, kLegibleQuality);
  const double wide_scale = std::clamp(1.0 * kMinCropPx / part.cols, min_scale, 1.0);
  for (double scale = 1;;) {
    const cv::Mat image = MarkedPicture(part, scale, marks, cropped.shown);
    cropped.scale = scale;
    // A picture is made smaller than that only when it does not fit in a coarser quality either.
    const int worst =
        scale <= wide_scale && image.cols >= kMinCropPx ? std::min(legible, kWideQuality) : legible;
    if (EncodePictureBetween(image, config.quality, worst, config.max_bytes, cropped)) return true;
    if (scale <= min_scale) return false;
    const double smaller = std::max(min_scale, scale * kScaleStep);
    scale = scale > wide_scale ? std::max(wide_scale, smaller) : smaller;
  }
}

PixelRegion PictureRegionOf(const cv::Rect& part) {
  return {static_cast<std::uint32_t>(part.x), static_cast<std::uint32_t>(part.y),
          static_cast<std::uint32_t>(part.width), static_cast<std::uint32_t>(part.height)};
}

}  // namespace

PixelRegion Union(const PixelRegion& a, const PixelRegion& b) {
  if (a.IsWholeImage() || b.IsWholeImage()) return {};
  const std::uint32_t x = std::min(a.x, b.x);
  const std::uint32_t y = std::min(a.y, b.y);
  return {x, y, std::max(a.x + a.width, b.x + b.width) - x,
          std::max(a.y + a.height, b.y + b.height) - y};
}

std::vector<std::uint8_t> EncodeJpeg(const Picture& picture, int quality, std::size_t max_bytes) {
  if (picture.bgr.empty() || picture.bgr.type() != CV_8UC3) return {};
  cv::Mat image = picture.bgr;
  std::vector<std::uint8_t> file;
  while (true) {
    for (int tried = quality;; tried = std::max(kLowestQuality, tried - kQualityStep)) {
      if (!cv::imencode(".jpg", image, file, {cv::IMWRITE_JPEG_QUALITY, tried})) return {};
      if (file.size() <= max_bytes) return file;
      if (tried <= kLowestQuality) break;
    }
    if (std::max(image.cols, image.rows) < 2 * kSmallestSidePx) return {};
    cv::Mat half;
    cv::resize(image, half, cv::Size(std::max(1, image.cols / 2), std::max(1, image.rows / 2)), 0,
               0, cv::INTER_AREA);
    image = half;
  }
}

PixelRegion WidestCrop(const Box& box, int width, int height, const CropConfig& config) {
  const cv::Size image(width, height);
  const cv::Rect2d inside = BoxInsidePicture(box, image);
  if (inside.empty() || config.context <= 0) return {};
  return PictureRegionOf(CropPictureAround(inside, WidestPictureCrop(config), kMinCropPx, image));
}

CroppedPicture CropPicture(const Picture& picture, const Box& box, const CropConfig& config,
                           const PictureMarks* marks) {
  CroppedPicture cropped;
  if (picture.bgr.empty() || picture.bgr.type() != CV_8UC3) return cropped;
  const cv::Size image = picture.bgr.size();
  const cv::Rect2d inside = BoxInsidePicture(box, image);
  const bool whole = inside.empty() || config.context <= 0;
  const double side =
      inside.empty() ? std::min(image.width, image.height) : std::min(inside.width, inside.height);
  const double min_scale = std::min(1.0, kLegibleSidePx / std::max(side, 1.0));
  cv::Rect part({}, image);
  const double widest = WidestPictureCrop(config);
  double context = widest;
  while (true) {
    // By the square: a small box keeps little more than itself before it is lost.
    const double share = context / widest;
    if (!whole) part = CropPictureAround(inside, context, kMinCropPx * share * share, image);
    cropped.shown = PictureRegionOf(part);
    cropped.legible = EncodePictureLegibly(picture.bgr(part), min_scale, config, marks, cropped);
    if (cropped.legible) return cropped;
    if (whole || context <= kMinContext) break;
    context = std::max(kMinContext, context * kContextStep);
  }
  const cv::Mat marked = MarkedPicture(picture.bgr(part), 1, marks, cropped.shown);
  cropped.jpeg = EncodeJpeg({marked, nullptr}, kLegibleQuality, config.max_bytes);
  cropped.quality = 0;
  if (cropped.jpeg.empty()) cropped.shown = {};
  return cropped;
}

}  // namespace livemap::imaging
