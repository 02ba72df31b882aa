#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/point_loops.h"
#include "odometry/edge/point_selector.h"
#include "odometry/edge/surface_points.h"
#include "odometry/se3.h"

namespace livemap::odometry {

/// Residuals up to this are the noise of any camera, and are explained on any edge, grey levels;
/// less by the gain where the light fades, which takes the contrast with it.
inline constexpr double kNoiseGrey = 8;

/// What brings the reference's points and grey values into a new image.
struct AlignmentState {
  Eigen::Isometry3d new_from_reference = Eigen::Isometry3d::Identity();
  double gain = 1;  ///< Grey value in the new image = gain * reference + bias.
  double bias = 0;
};

struct AlignmentConfig {
  int max_iterations = 12;  ///< Per level.
  double huber_k = 2.0;     ///< In standard deviations of the residuals.
  double min_sigma = 1.5;   ///< Noise below which no residual counts as an outlier, grey levels.
  double grey_sigma = 2.0;  ///< Of residuals of gentle slopes whose depth is exact.
  /// Of the place of an edge, px, as of a pixel that sees one ray (1/sqrt(12)): what is steep errs
  /// by more grey levels.
  double place_sigma_px = 0.3;
  double converged_px = 0.03;  ///< A step that moves points less than this is the last.
  bool estimate_illumination = true;
  bool rotation_only = false;
};

struct AlignmentResult {
  AlignmentState state;
  /// Inverse covariance of the right-hand perturbation delta: new_from_reference * Exp(delta), for
  /// residuals of variance 1 that are independent of each other.
  Matrix6d information = Matrix6d::Zero();
  /// Covariance of delta by how much parts of the image contradict each other: edge pixels that err
  /// together, by a depth or by aliasing, count once, and exact ones err little. Movements that
  /// neither edge nor surface shows, or only the noise of the gradients, have a variance of 100
  /// square metres or radians.
  Matrix6d covariance = Matrix6d::Zero();
  double sigma = 0;  ///< Robust standard deviation of the residuals, grey levels.
  /// That of the distances to the surfaces, see SurfaceDistances; infinite without surfaces.
  double surface_sigma = std::numeric_limits<double>::infinity();
  double cost = 0;          ///< Mean robust cost with that of the surfaces, squared grey levels.
  std::size_t points = 0;   ///< Of the reference.
  std::size_t visible = 0;  ///< Of them, those that fall into the new image.
  std::size_t inliers = 0;  ///< Of them, those with full weight.
  /// Of them, those whose residual is at most what 0.75 px along the gradient would make of it, or
  /// noise. At a false minimum most edges lie beside each other, however large
  /// sigma has grown.
  std::size_t explained = 0;
  int iterations = 0;
  double Overlap() const {
    return points == 0 ? 0 : static_cast<double>(visible) / static_cast<double>(points);
  }
  /// Share of the visible points that are explained.
  double Agreement() const {
    return visible == 0 ? 0 : static_cast<double>(explained) / static_cast<double>(visible);
  }
};

/// Minimises the photometric error of edge points, and the distances of surfaces where there are
/// some, by inverse compositional Gauss-Newton with Huber weights (thesis, section 5.2.4; Baker and
/// Matthews 2004); a step that does not lower the robust
/// cost is rolled back and damped (Levenberg). docs/explanation/odometry.md derives it. Keeps its
/// buffers from call to call; not thread-safe.
class Aligner {
 public:
  explicit Aligner(const AlignmentConfig& config) : config_(config) {}

  /// Memory for so many points.
  void Reserve(std::size_t points);

  /// Aligns on one level from `start` on. Of the surfaces every `every`-th point takes part, 1:
  /// all.
  AlignmentResult Align(const EdgePoints& points, const cv::Mat& grey,
                        const geo::CameraIntrinsics& camera, const AlignmentState& start,
                        const SurfaceConstraint& surfaces = {}, std::size_t every = 1);

  /// Mean robust cost of the edges at `state` for residuals of this sigma; infinite when
  /// less than a tenth of the points is visible.
  double CostAt(const EdgePoints& points, const cv::Mat& grey, const geo::CameraIntrinsics& camera,
                const AlignmentState& state, double sigma);

  /// How many of the points `state` explains, see AlignmentResult, if residuals up to `noise` grey
  /// levels in full light are noise, instead of kNoiseGrey.
  std::size_t ExplainedAt(const EdgePoints& points, const cv::Mat& grey,
                          const geo::CameraIntrinsics& camera, const AlignmentState& state,
                          double noise);

 private:
  static constexpr int kUnknowns = kAlignmentUnknowns;
  using Normal = NormalSums::Normal;
  using Step = NormalSums::Step;

  struct Residuals : PointResiduals {
    SurfaceDistances distances;  // To the surfaces.
  };

  void Evaluate(const EdgePoints& points, const cv::Mat& grey, const geo::CameraIntrinsics& camera,
                const AlignmentState& state, Residuals& residuals) const;
  double RobustSigma(const Residuals& residuals) const;
  double RobustCost(const Residuals& residuals, double sigma) const;
  double RobustSurfaceCost(const Residuals& residuals, double sigma) const;
  void MeasureSurfaces(const AlignmentState& state, Residuals& residuals) const;
  void UpdateSurfaceSigma();
  void AddSurfaces(double sigma, double gain);
  void Whiten(const EdgePoints& points, const Eigen::Isometry3d& new_from_reference);
  void BuildNormalEquations(const EdgePoints& points, double sigma, double gain);
  bool Solve(double damping, Step& step) const;
  AlignmentState Moved(const AlignmentState& state, const Step& step) const;
  float PerSlope(const EdgePoints& points) const;
  std::size_t CountExplained(const EdgePoints& points, const Residuals& residuals, double gain,
                             double noise) const;
  /// What the noise of the gradients alone adds to the pose's part of the normal equations, that
  /// of so large a share of each gradient included.
  Matrix6d NoiseInformation(const EdgePoints& points, const geo::CameraIntrinsics& camera,
                            double sigma, float jagged_share) const;
  /// The pose's part of the normal equations without what gain and bias could explain.
  Matrix6d PoseInformation() const;
  void Summarise(const EdgePoints& points, const geo::CameraIntrinsics& camera, double sigma,
                 AlignmentResult& result) const;

  AlignmentConfig config_;
  SurfaceConstraint surfaces_;  // Of this alignment.
  std::size_t surfaces_every_ = 1;
  double surface_sigma_ = 1;       // Of the distances.
  std::size_t surface_parts_ = 0;  // Of scatter_.
  Residuals current_, candidate_;
  std::vector<float> whitening_;  // Factors of the residuals.
  Normal normal_;
  Normal scatter_;  // Sum over parts of the image of their gradient's square.
  Step gradient_;
};

}  // namespace livemap::odometry
