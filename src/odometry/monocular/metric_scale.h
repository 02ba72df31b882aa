#pragma once

#include <optional>

namespace livemap::odometry {

/// Follows how many metres one unit of a monocular map is: the logarithm of that scale is a
/// Gaussian that drifts with every keyframe and is measured by what is known in metres.
class MetricScale {
 public:
  struct Config {
    /// Drift of the map's own scale per unit of keyframes, standard deviation of its logarithm.
    double drift_per_keyframe = 0.01;
    /// Errors of the way that visual odometry measures, standard deviation as a share of it.
    double way_sigma = 0.02;
    /// A measurement this many standard deviations off is refused,
    double gate_sigmas = 4.0;
    /// unless so many in a row are.
    int max_refused = 5;
  };

  explicit MetricScale(const Config& config) : config_(config) {}

  /// Metres per unit; 1 before the first measurement.
  double metres_per_unit() const;
  /// Standard deviation of its logarithm; none before the first measurement.
  std::optional<double> log_sigma() const;

  void Reset();
  /// A keyframe went by: the map's scale may have changed.
  void Drift();
  /// `metres` with this standard deviation are `units` of the map. Ignored unless all are finite
  /// and positive.
  void Measure(double metres, double sigma_m, double units);
  /// What has measured it so far was wrong by this factor. Ignored unless finite and positive.
  void Stretch(double factor);

 private:
  Config config_;
  double log_scale_ = 0;
  double variance_ = 0;
  bool known_ = false;
  int refused_ = 0;
};

}  // namespace livemap::odometry
