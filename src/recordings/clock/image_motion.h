#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace livemap::recordings {

/// How the picture moved between two images of a camera that looks along or against the way.
struct ImageMotion {
  std::int64_t stamp_ns = 0;  ///< Midway between the two.
  /// How fast the far field moves to the left, image widths per second: as the vehicle turns right.
  double turn = 0;
  /// Median speed of the picture's points without the turn, image widths per second: 0 while the
  /// vehicle stands.
  double flow = 0;
};

/// Measures the motion of the picture by corners that are followed from image to image (Lucas and
/// Kanade 1981, in a pyramid). The horizontal motion of the upper picture is taken as a turn, the
/// same everywhere, plus what moving ahead adds: linear in the distance from the middle, for the
/// left and the right of the road by itself. Tukey's weights leave out what moves otherwise, such
/// as other vehicles, and burnt-in text. Not thread-safe.
class ImageMotionMeter {
 public:
  /// Images closer in time than this are passed over.
  static constexpr double kMinStepS = 0.08;
  /// Images further apart are not compared.
  static constexpr double kMaxStepS = 0.5;
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
