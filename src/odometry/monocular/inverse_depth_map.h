#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geo/camera_intrinsics.h"
#include "odometry/monocular/epipolar_search.h"

namespace livemap::odometry {

/// What is known of an edge pixel's distance: a Gaussian over its inverse depth (Engel, Sturm,
/// Cremers 2013).
struct EdgeDepth {
  std::int16_t u = 0, v = 0;
  std::uint8_t misses = 0;  ///< Searches in a row that contradicted it or found nothing.
  bool known = false;
  float inverse_depth = 0;  ///< 1/m
  float variance = 0;       ///< 1/m^2
};

/// The inverse-depth map on the edges of one keyframe after another (thesis, section 5.2.1:
/// "keeping a depth map and updating at each new time step"). Metres are those of the poses it is
/// given. Keeps its buffers; not thread-safe.
class InverseDepthMap {
 public:
  struct Config {
    float min_depth_m = 1.0F;
    float max_depth_m = 150.0F;
    EpipolarConfig search;
    /// More edge pixels than these are thinned evenly.
    int max_edges = 8000;
    /// An unknown depth is first searched near those of its neighbours: between the least and the
    /// greatest of them, and this share beyond.
    float neighbour_margin = 0.25F;
    /// A known depth is searched so many standard deviations around,
    float search_sigmas = 2.5F;
    /// and only when they move it further than this, px: else the view has nothing to add.
    float min_line_px = 0.3F;
    /// A measurement this many standard deviations off contradicts what is known.
    float gate_sigmas = 3.0F;
    /// So many contradictions in a row make a depth unknown.
    int max_misses = 2;
    /// Growth of the standard deviation from keyframe to keyframe, a share of it.
    float growth = 0.2F;
    /// The depths of one keyframe err together, by the error of its pose. Handed out, their
    /// standard deviations are multiplied by this: else such an error would confirm itself, and
    /// grow from keyframe to keyframe.
    float shared_error = 8.0F;
    /// Depths less certain than this are not handed out, standard deviation of the inverse depth
    /// as a share of it.
    float worst_relative_sigma = 0.2F;
  };

  InverseDepthMap(const Config& config, const geo::CameraIntrinsics& camera);

  /// Depths to look for from now on, m.
  void SetRange(double min_depth_m, double max_depth_m);

  /// Forgets all depths.
  void Clear();

  /// Goes on to a new keyframe with these edges (CV_8UC1, non-zero), and brings over what is known
  /// of the last one's.
  void MoveTo(const cv::Mat& edges, const Eigen::Isometry3d& new_from_last);

  /// Learns from another view of the keyframe's scene; both images smooth and CV_8UC1. Unknown
  /// depths are searched too if `find_new`: a view from close by has short lines without doubles.
  void Measure(const cv::Mat& keyframe, const cv::Mat& other,
               const Eigen::Isometry3d& other_from_keyframe, bool find_new);

  /// Drops depths that contradict their neighbours along the edge, and smooths the others.
  void Regularise();

  /// Depth in m of what is known well enough, CV_32FC1, 0 elsewhere; an edge is three pixels wide,
  /// because coarser images see it beside its place. Valid until the next call.
  const cv::Mat& DepthImage();
  /// Standard deviations of the inverse depths (1/m) that the last DepthImage() has, same places.
  const cv::Mat& SigmaImage() const { return sigma_; }

  const std::vector<EdgeDepth>& edges() const { return edges_; }
  std::size_t CountKnown() const;

 private:
  void PlaceEdges(const cv::Mat& edges);
  EdgeDepth* NearestEdge(float u, float v);
  void Bring(const EdgeDepth& from, const Eigen::Isometry3d& new_from_last);
  struct Interval {
    float low, high;  // 1/m
  };
  void MeasureOne(EdgeDepth& edge, const EpipolarSearch& search) const;
  void FindNew(EdgeDepth& edge, const EpipolarSearch& search) const;
  std::optional<Interval> NeighboursInterval(const EdgeDepth& edge) const;
  bool IsCertain(const EdgeDepth& edge) const;

  Config config_;
  geo::CameraIntrinsics camera_;
  std::vector<EdgeDepth> edges_, last_edges_;
  cv::Mat index_;  // CV_32SC1: which of edges_ a pixel is, -1 none.
  std::vector<float> smoothed_;
  cv::Mat depth_, sigma_;
};

}  // namespace livemap::odometry
