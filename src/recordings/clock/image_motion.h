#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace livemap::recordings {

/// How the picture moved between two images of a camera that looks along or against the way.
struct ImageMotion {
  std::int64_t stamp_ns = 0;  ///< Midway between the two.
  double turn_radps = 0;      ///< Of the camera about its upright axis, positive to the right.
  /// Median speed of the picture's points without the turn, image widths per second: 0 while the
  /// vehicle stands.
  double flow = 0;
};

/// Measures the motion of the picture by corners that are followed from image to image (Lucas and
/// Kanade 1981, in a pyramid, there and back). Moving ahead moves every point away from the middle,
/// however far it is. What a point moves across that direction is therefore the camera's rotation,
/// which is fitted to all points with Tukey's weights: these leave out what moves otherwise, such
/// as other vehicles and burnt-in text. The focal length is taken to be kFocal, the camera to look
/// about along the road: errors of both scale the turn, and the clocks' offset does not depend on
/// its scale. Not thread-safe.
class ImageMotionMeter {
 public:
  /// Images closer in time than this are passed over.
  static constexpr double kMinStepS = 0.08;
  /// Images further apart are not compared.
  static constexpr double kMaxStepS = 0.5;
  /// Of the focal length, in image widths: 66 degrees across.
  static constexpr double kFocal = 0.77;
  /// Width that images should have: more shows nothing more.
  static constexpr int kWidth = 320;

  /// Whether Add would look at an image of that stamp: the caller may spare itself the decoding.
  bool Wants(std::int64_t stamp_ns) const;
  /// `grey` is CV_8UC1, upright, of one size, with increasing stamps. The motion since the image
  /// before; none for the first one, after a gap, and where too few corners can be followed.
  std::optional<ImageMotion> Add(const cv::Mat& grey, std::int64_t stamp_ns);

 private:
  cv::Mat before_;
  std::int64_t before_ns_ = 0;
};

}  // namespace livemap::recordings
