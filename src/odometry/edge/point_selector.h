#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "geo/camera_intrinsics.h"

namespace livemap::odometry {

/// The pixels of a reference image that take part in an alignment: one array per quantity, because
/// the alignment's loops run over many points and few quantities.
struct EdgePoints {
  /// Position in the reference's optical frame, m.
  std::vector<float> x, y, z;
  /// Grey value of the reference there, 0..255.
  std::vector<float> intensity;
  /// Derivative of the reference's grey value by the twist delta of a motion Exp(delta) of the
  /// point: translation (per m), then rotation (per rad). Equation (6) of
  /// docs/explanation/odometry.md.
  std::array<std::vector<float>, 6> jacobian;
  /// Standard deviation of the inverse depth, 1/m; empty: depths are exact.
  std::vector<float> inverse_depth_sigma;
  /// Length of the reference's gradient there, grey levels per px.
  std::vector<float> slope;
  double mean_inverse_depth = 0;  ///< 1/m
  /// Variance of the noise in each component of the gradients, squared grey levels per px; 0: not
  /// known, every movement counts as seen.
  double gradient_noise = 0;

  std::size_t size() const { return x.size(); }
  void Clear();
  void Reserve(std::size_t count);
  void Add(float u, float v, float depth_m, float grey, float gradient_x, float gradient_y,
           const geo::CameraIntrinsics& camera);
  /// Means over all points; called once they are complete.
  void Finish();
};

/// Which pixels become points. The random ones are for experiments: they ask what edges are worth.
enum class PixelChoice {
  kEdges,         ///< Those under the mask, thinned evenly when there are too many.
  kRandomEdges,   ///< `share` of those under the mask.
  kRandomPixels,  ///< As many as kRandomEdges would take, but of all pixels with depth.
};

/// What makes a pixel under an edge mask a point.
struct PointSelection {
  std::size_t max_points = 6000;  ///< More than these are thinned.
  PixelChoice choice = PixelChoice::kEdges;
  double share = 1;  ///< Of the random choices; kRandomPixels may take more than the edges are.
  std::uint32_t seed = 1;  ///< Of the random choices, read by whoever makes the PointSelector.
  /// Grey levels per px; less says nothing about motion. Not asked of kRandomPixels.
  float min_gradient = 2.0F;
  /// A pixel whose 5x5 neighbourhood holds a depth nearer than its own by this factor lies behind
  /// an occluding edge: its depth is not the edge's.
  float occlusion_ratio = 1.08F;
};

/// A pixel of an image, at most 8192 wide.
struct Pixel {
  std::int16_t x, y;
};

/// What points are made of: one level of a keyframe, images of one size.
struct ReferenceLevel {
  const cv::Mat& grey;     ///< CV_8UC1
  const cv::Mat& depth_m;  ///< CV_32FC1, 0 unknown.
  /// Standard deviation of the inverse depth, CV_32FC1, 1/m; empty: depths are exact.
  const cv::Mat& inverse_depth_sigma;
};

/// Gathers points under an edge mask; keeps its list of pixels from call to call.
class PointSelector {
 public:
  /// The seed decides what the random choices take, one after the other.
  explicit PointSelector(std::uint32_t seed = 1) : random_(seed) {}

  /// Memory for masks with so many pixels set.
  void Reserve(std::size_t pixels) {
    candidates_.reserve(pixels);
    directions_.reserve(pixels);
    ordered_.reserve(pixels);
  }
  /// Points of the reference under `edges`, an image of the same size.
  void Select(const ReferenceLevel& reference, const cv::Mat& edges,
              const geo::CameraIntrinsics& camera, const PointSelection& selection,
              EdgePoints& points);
  /// Every pixel, as if at one metre: for rotations, which depth does not matter to.
  void SelectAll(const cv::Mat& grey, const geo::CameraIntrinsics& camera, EdgePoints& points);

 private:
  void FindDirections(const cv::Mat& grey);
  void Thin(std::size_t most);
  void OrderByLines(cv::Size size);
  void SelectAtRandom(const ReferenceLevel& reference, const geo::CameraIntrinsics& camera,
                      const PointSelection& selection, EdgePoints& points);

  std::vector<Pixel> candidates_;
  std::vector<std::uint8_t> directions_;  // Of the candidates.
  std::vector<Pixel> ordered_;
  std::mt19937 random_;
};

}  // namespace livemap::odometry
