#include "change/methods/daisy.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/error.h"

namespace livemap::change {
namespace {

constexpr float kMinGradient = 1e-3F;

/// Gradient's positive part in each direction: how steeply grey values rise that way.
std::vector<cv::Mat> DaisyOrientationMaps(const cv::Mat& grey, int orientations) {
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32FC1, 1.0 / 255);
  cv::GaussianBlur(smooth, smooth, cv::Size(), 1.0);
  cv::Mat dx;
  cv::Mat dy;
  cv::Sobel(smooth, dx, CV_32FC1, 1, 0, 1);
  cv::Sobel(smooth, dy, CV_32FC1, 0, 1, 1);
  std::vector<cv::Mat> maps;
  for (int i = 0; i < orientations; ++i) {
    const double angle = 2 * CV_PI * i / orientations;
    cv::Mat map = dx * std::cos(angle) + dy * std::sin(angle);
    maps.push_back(cv::max(map, 0));
  }
  return maps;
}

}  // namespace

Daisy::Daisy(const cv::Mat& grey, const DaisyConfig& options) : options_(options) {
  if (grey.type() != CV_8UC1 || grey.empty()) throw Error("DAISY wants an 8-bit grey image");
  std::vector<cv::Mat> maps = DaisyOrientationMaps(grey, options.orientations);
  double blurred = 0;
  // A histogram's blur grows with its ring's radius, so that neighbours overlap by half.
  for (int ring = 0; ring <= options.rings; ++ring) {
    const double sigma =
        static_cast<double>(options.radius_px) * std::max(ring, 1) / (2.0 * options.rings);
    const double more = std::sqrt(std::max(sigma * sigma - blurred * blurred, 0.0));
    if (more > 0.1) {
      for (cv::Mat& map : maps) {
        cv::Mat wider;
        cv::GaussianBlur(map, wider, cv::Size(), more);
        map = wider;
      }
      blurred = sigma;
    }
    maps_.push_back(maps);
  }
  for (int ring = 1; ring <= options.rings; ++ring) {
    const double radius = static_cast<double>(options.radius_px) * ring / options.rings;
    for (int i = 0; i < options.ring_points; ++i) {
      const double angle = 2 * CV_PI * i / options.ring_points;
      places_.emplace_back(static_cast<float>(radius * std::cos(angle)),
                           static_cast<float>(radius * std::sin(angle)));
    }
  }
}

int Daisy::size() const {
  return (options_.rings * options_.ring_points + 1) * options_.orientations;
}

void Daisy::AddHistogram(const std::vector<cv::Mat>& maps, float column, float row,
                         float* histogram) const {
  const int x = std::clamp(static_cast<int>(std::lround(column)), 0, maps[0].cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(row)), 0, maps[0].rows - 1);
  float square = 0;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    histogram[i] = maps[i].at<float>(y, x);
    square += histogram[i] * histogram[i];
  }
  const float length = std::sqrt(square);
  // What is flat has no direction; noise must not become one.
  const float scale = length > kMinGradient ? 1 / length : 0;
  for (std::size_t i = 0; i < maps.size(); ++i) histogram[i] *= scale;
}

void Daisy::Describe(int column, int row, float* descriptor) const {
  const auto x = static_cast<float>(column);
  const auto y = static_cast<float>(row);
  AddHistogram(maps_[0], x, y, descriptor);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    descriptor += options_.orientations;
    const std::size_t ring = 1 + i / static_cast<std::size_t>(options_.ring_points);
    AddHistogram(maps_[ring], x + places_[i].x, y + places_[i].y, descriptor);
  }
}

}  // namespace livemap::change
