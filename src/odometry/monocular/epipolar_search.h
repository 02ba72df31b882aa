#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <opencv2/core.hpp>
#include <optional>

#include "geo/camera_intrinsics.h"

namespace livemap::odometry {

/// What one search along an epipolar line found.
struct EpipolarMatch {
  float inverse_depth = 0;  ///< 1/m, in the keyframe's optical frame.
  float variance = 0;       ///< 1/m^2
};

struct EpipolarConfig {
  /// Lines are searched so far from the far end on, px.
  int longest_line_px = 200;
  /// Of a match whose place along the line was not known before: any other place must fit worse by
  /// this factor.
  float distinct_ratio = 1.7F;
  /// Noise of a grey value, standard deviation, grey levels.
  float grey_sigma = 2.5F;
  /// Matches with larger residuals are refused, standard deviation, grey levels.
  float worst_residual = 12.0F;
  /// How far the line lies beside its true place, because the motion is not known exactly, px.
  float line_sigma_px = 0.3F;
  /// Edges whose gradient makes a wider angle with the line slide along it: least cosine.
  float min_cosine = 0.25F;
  /// A match that is not determined along the line better than this says nothing, px.
  float worst_sigma_px = 1.0F;
};

/// Finds pixels of a keyframe in another view whose motion is known: the place along the epipolar
/// line where a small pattern around the pixel looks alike, but for a common difference of
/// brightness. Equation (10) of docs/explanation/monocular-odometry.md derives the variance. Both
/// images CV_8UC1 of the camera's size; they must outlive this object.
class EpipolarSearch {
 public:
  EpipolarSearch(const cv::Mat& keyframe, const cv::Mat& other, const geo::CameraIntrinsics& camera,
                 const Eigen::Isometry3d& other_from_keyframe, const EpipolarConfig& config);

  /// Pixels that the point moves over in the other view between two inverse depths (1/m).
  float LineLength(float u, float v, float inverse_depth_low, float inverse_depth_high) const;

  /// The match between two inverse depths. `distinct`: it must also be the only one there. None
  /// when the pattern leaves either image, nothing fits, or the line runs along the edge.
  std::optional<EpipolarMatch> Find(int u, int v, float inverse_depth_low, float inverse_depth_high,
                                    bool distinct) const;

 private:
  static constexpr int kPatternSize = 8;
  struct Offset {
    int x, y;
  };
  /// Spread over 5x5 pixels (Engel, Koltun, Cremers 2018, figure 2).
  static constexpr std::array<Offset, kPatternSize> kPattern = {
      {{0, -2}, {-1, -1}, {1, -1}, {-2, 0}, {0, 0}, {2, 0}, {-1, 1}, {0, 2}}};
  using Values = Eigen::Array<float, kPatternSize, 1>;

  /// The pattern around one pixel of the keyframe.
  struct Pattern {
    Values x, y, z;  // At infinity, in the other view, homogeneous.
    Values grey;
    Eigen::Vector3f centre() const { return {x[4], y[4], z[4]}; }
  };
  struct Places {
    Values u, v, z;
  };
  struct Sampled {
    Values residual;  // Without their mean.
    Values by_inverse_depth;
    Values across_line;
    float cost = 0;  // Mean squared residual.
  };

  bool CrossesLine(int u, int v, const Eigen::Vector2f& line) const;
  bool MakePattern(int u, int v, Pattern& pattern) const;
  Eigen::Vector2f Project(const Eigen::Vector3f& at_infinity, float inverse_depth) const;
  float InverseDepthAt(const Eigen::Vector3f& at_infinity, const Eigen::Vector2f& pixel) const;
  bool Place(const Pattern& pattern, float inverse_depth, Places& places) const;
  float Cost(const Pattern& pattern, float inverse_depth) const;
  bool Sample(const Pattern& pattern, float inverse_depth, Sampled& sampled) const;
  std::optional<float> Coarse(const Pattern& pattern, float low, float high, bool distinct) const;
  std::optional<EpipolarMatch> Refine(const Pattern& pattern, float inverse_depth) const;

  const cv::Mat& keyframe_;
  const cv::Mat& other_;
  EpipolarConfig config_;
  Eigen::Matrix3f infinite_homography_;  // K R K^-1
  Eigen::Vector3f epipole_;              // K t
};

}  // namespace livemap::odometry
