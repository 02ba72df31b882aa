#include "hazard/picture.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace livemap {
namespace {

constexpr int kLowestQuality = 30;  // Below it a box is no longer legible: make it smaller instead.
constexpr int kQualityStep = 20;
constexpr int kSmallestSidePx = 64;

}  // namespace

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

}  // namespace livemap
