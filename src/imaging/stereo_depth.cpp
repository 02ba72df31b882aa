#include "imaging/stereo_depth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>

#include "common/error.h"

namespace livemap::imaging {
namespace {

/// What StereoSGBM returns is in sixteenths of a pixel.
constexpr double kSteps = 16;
/// Of numbers that calibrations state with few digits.
constexpr double kSamePx = 0.01;
/// Far below every shift: what is blended with it is recognised.
constexpr float kUnknown = -1e6F;

std::string StereoNumberText(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string StereoSizeText(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

double StereoBaselineM(const CameraCalibration& left, const CameraCalibration& right) {
  const double fx = left.p(0, 0);
  return left.p(0, 3) / fx - right.p(0, 3) / fx;
}

cv::Ptr<cv::StereoSGBM> MakeStereoMatcher(const StereoConfig& config, int first_px, int search_px) {
  const int area = config.block_size * config.block_size;
  constexpr int kPreFilterCap = 31;
  constexpr int kSpeckleRangePx = 2;
  // The penalties of a step of one pixel and of a larger one that OpenCV's manual recommends.
  return cv::StereoSGBM::create(first_px, search_px, config.block_size, 8 * area, 32 * area,
                                config.left_right_px, kPreFilterCap, config.uniqueness_percent,
                                config.speckle_pixels, kSpeckleRangePx,
                                cv::StereoSGBM::MODE_SGBM_3WAY);
}

}  // namespace

void CheckStereoConfig(const StereoConfig& config) {
  const auto refuse = [](const std::string& name, double value, const std::string& accepted) {
    throw Error("stereo's " + name + " is " + StereoNumberText(value) + ", accepted is " +
                accepted);
  };
  if (!(config.min_depth_m > 0) || !std::isfinite(config.min_depth_m)) {
    refuse("least depth", config.min_depth_m, "more than 0 m");
  }
  if (!(config.min_disparity_px > 0) || !std::isfinite(config.min_disparity_px)) {
    refuse("least disparity", config.min_disparity_px, "more than 0 pixels");
  }
  if (config.scale != 1 && config.scale != 2 && config.scale != 4) {
    refuse("scale", config.scale, "1, 2 or 4");
  }
  if (config.block_size < 1 || config.block_size > 21 || config.block_size % 2 == 0) {
    refuse("block size", config.block_size, "an odd number from 1 to 21");
  }
  if (config.uniqueness_percent < 0 || config.uniqueness_percent > 100) {
    refuse("uniqueness", config.uniqueness_percent, "0 to 100 percent");
  }
}

StereoGeometry MakeStereoGeometry(const CameraCalibration& left, const CameraCalibration& right) {
  if (left.width != right.width || left.height != right.height) {
    throw Error("the left image is " + StereoSizeText(left.width, left.height) +
                " and the right one " + StereoSizeText(right.width, right.height) +
                ", a stereo pair has one size");
  }
  const auto same = [&](int row, int column) {
    return std::abs(left.p(row, column) - right.p(row, column)) <= kSamePx;
  };
  const auto shows = [&](int row, int column) {
    return StereoNumberText(left.p(row, column)) + " and " + StereoNumberText(right.p(row, column));
  };
  if (!(left.p(0, 0) > 0) || !same(0, 0) || !same(1, 1)) {
    throw Error("the focal lengths in P are " + shows(0, 0) + " across and " + shows(1, 1) +
                " down, a rectified stereo pair has the same positive ones");
  }
  if (!same(1, 2) || !same(1, 3)) {
    throw Error("the rows in P are " + shows(1, 2) + ", shifted by " + shows(1, 3) +
                ": a rectified stereo pair sees one point in one row");
  }
  const double baseline_m = StereoBaselineM(left, right);
  if (!(baseline_m > 0) || !std::isfinite(baseline_m)) {
    throw Error("the right camera's P has " + StereoNumberText(right.p(0, 3)) +
                " in its fourth column, accepted is -fx times the baseline in metres, so that the "
                "right camera is to the right of the left one");
  }
  const double offset_px = left.p(0, 2) - right.p(0, 2);
  if (!(std::abs(offset_px) < 0.5 * left.width)) {
    throw Error("the columns of the principal points in P are " + shows(0, 2) +
                ", a stereo pair's differ by less than half the image's width");
  }
  return {left.p(0, 0), baseline_m, offset_px};
}

StereoDepth::StereoDepth(const StereoConfig& config, const CameraCalibration& left,
                         const CameraCalibration& right)
    : config_(config), geometry_(MakeStereoGeometry(left, right)), size_(left.width, left.height) {
  CheckStereoConfig(config);
  constexpr int kMultiple = 16;  // Of StereoSGBM's search.
  matched_ = cv::Size(size_.width / config.scale, size_.height / config.scale);
  if (matched_.empty()) {
    throw Error("the image is " + StereoSizeText(size_.width, size_.height) +
                ", too small for stereo");
  }
  step_px_ = static_cast<double>(size_.width) / matched_.width;
  const double near_px = geometry_.focal_px * geometry_.baseline_m / config.min_depth_m;
  const double longest_px = std::min<double>(kMaxSearchPx, 0.5 * matched_.width);
  if (near_px / step_px_ > longest_px) {
    throw Error(
        "stereo's least depth is " + StereoNumberText(config.min_depth_m) + " m, a search over " +
        StereoNumberText(std::ceil(near_px)) + " pixels; accepted with these cameras is at least " +
        StereoNumberText(geometry_.focal_px * geometry_.baseline_m / (longest_px * step_px_)) +
        " m");
  }
  first_px_ = static_cast<int>(std::floor(geometry_.offset_px / step_px_));
  // One more on either side, so that the ends have neighbours to interpolate with.
  const int wanted = static_cast<int>(std::ceil(near_px / step_px_)) + 2;
  search_px_ = (wanted + kMultiple - 1) / kMultiple * kMultiple;
  matcher_ = MakeStereoMatcher(config, first_px_, search_px_);
}

void StereoDepth::Prepare(const cv::Mat& image, const char* camera, cv::Mat& grey) {
  if (image.size() != size_ || (image.type() != CV_8UC1 && image.type() != CV_8UC3)) {
    throw Error("the " + std::string(camera) + " image is " +
                StereoSizeText(image.cols, image.rows) + " of " + std::to_string(image.channels()) +
                " channels, accepted is " + StereoSizeText(size_.width, size_.height) +
                " of 8 bit grey or BGR");
  }
  const cv::Mat* ready = &image;
  if (image.channels() == 3) {
    cv::cvtColor(image, grey_, cv::COLOR_BGR2GRAY);
    ready = &grey_;
  }
  if (config_.scale != 1) {
    cv::resize(*ready, small_, matched_, 0, 0, cv::INTER_AREA);
    ready = &small_;
  }
  // The matcher leaves out as many columns on the left as it searches over.
  cv::copyMakeBorder(*ready, grey, 0, 0, std::max(0, first_px_ + search_px_), 0,
                     cv::BORDER_REPLICATE);
}

cv::Mat StereoDepth::FullDisparity() const {
  const cv::Mat inside = found_.colRange(found_.cols - matched_.width, found_.cols);
  cv::Mat disparity;
  inside.convertTo(disparity, CV_32FC1, step_px_ / kSteps);
  // StereoSGBM marks what it did not find by the value below its first.
  disparity.setTo(kUnknown, inside < first_px_ * static_cast<int>(kSteps));
  if (config_.scale == 1) return disparity;
  // Between two surfaces and beside a hole the nearest pixel's, on a surface the slope's.
  cv::Mat nearest, sloped, apart;
  cv::resize(disparity, nearest, size_, 0, 0, cv::INTER_NEAREST);
  cv::resize(disparity, sloped, size_, 0, 0, cv::INTER_LINEAR);
  cv::absdiff(nearest, sloped, apart);
  sloped.copyTo(nearest, apart < step_px_);
  return nearest;
}

cv::Mat StereoDepth::Compute(const cv::Mat& left, const cv::Mat& right) {
  Prepare(left, "left", left_);
  Prepare(right, "right", right_);
  matcher_->compute(left_, right_, found_);
  cv::Mat depth = FullDisparity();
  const auto scale = static_cast<float>(geometry_.focal_px * geometry_.baseline_m);
  const auto offset = static_cast<float>(geometry_.offset_px);
  const auto least = static_cast<float>(config_.min_disparity_px);
  for (int row = 0; row < depth.rows; ++row) {
    float* values = depth.ptr<float>(row);
    for (int column = 0; column < depth.cols; ++column) {
      const float shift = values[column] - offset;
      const bool seen_by_right = values[column] <= static_cast<float>(column);
      values[column] =
          shift >= least && seen_by_right ? scale / shift : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return depth;
}

}  // namespace livemap::imaging
