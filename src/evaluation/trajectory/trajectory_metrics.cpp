#include "evaluation/trajectory/trajectory_metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <sstream>

#include "common/error.h"
#include "evaluation/nothing_measured.h"

namespace livemap::evaluation {
namespace {

constexpr std::array<double, 8> kKittiLengthsM = {100, 200, 300, 400, 500, 600, 700, 800};
constexpr std::size_t kKittiStep = 10;
constexpr std::array<double, 5> kShortLengthsM = {10, 20, 30, 40, 50};

/// The median of sorted values.
double MedianMetric(const std::vector<double>& sorted) {
  const std::size_t half = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

/// The index of the value nearest to `wanted` among ascending values (not empty). The bisection is
/// that of evaluate_rpe.py, so that of two equally near values the same one is taken.
std::size_t FindClosestStamp(const std::vector<std::int64_t>& values, std::int64_t wanted) {
  std::size_t best = 0;
  std::int64_t least = std::abs(values[0] - wanted);
  std::size_t begin = 0;
  std::size_t end = values.size();
  while (begin < end) {
    const std::size_t middle = (begin + end) / 2;
    const std::int64_t difference = std::abs(values[middle] - wanted);
    if (difference < least) {
      least = difference;
      best = middle;
    }
    if (difference == 0) return middle;
    if (values[middle] > wanted) {
      end = middle;
    } else {
      begin = middle + 1;
    }
  }
  return best;
}

/// Twice the median interval between the stamps: a true pose farther from its estimate is none.
double GreatestStampDistanceNs(const std::vector<std::int64_t>& stamps) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    intervals.push_back(static_cast<double>(stamps[i] - stamps[i - 1]));
  }
  std::sort(intervals.begin(), intervals.end());
  return intervals.empty() ? 0 : 2 * MedianMetric(intervals);
}

Eigen::Isometry3d ScaledMotion(Eigen::Isometry3d motion, double scale) {
  motion.translation() *= scale;
  return motion;
}

double MotionAngle(const Eigen::Isometry3d& motion) {
  return Eigen::AngleAxisd(motion.linear()).angle();
}

/// `keys` are what the delta counts in, one per pose of the estimate, ascending: stamps or indices.
RelativeErrors CompareTrajectoryMotions(const std::vector<datasets::StampedPose>& truth,
                                        const std::vector<datasets::StampedPose>& estimate,
                                        const std::vector<std::int64_t>& keys, std::int64_t delta,
                                        const RelativeErrorConfig& options) {
  RelativeErrors errors;
  if (truth.empty() || estimate.empty()) return errors;
  const std::vector<std::int64_t> true_stamps = StampsOf(truth, 0);
  const std::vector<std::int64_t> stamps = StampsOf(estimate, std::llround(options.offset_s * 1e9));
  const double greatest_ns = GreatestStampDistanceNs(true_stamps);
  // For each pose of the estimate its true pose, null when that is too far.
  std::vector<const Eigen::Isometry3d*> true_poses;
  for (const std::int64_t stamp : stamps) {
    const std::size_t closest = FindClosestStamp(true_stamps, stamp);
    const auto distance_ns = static_cast<double>(std::abs(true_stamps[closest] - stamp));
    true_poses.push_back(distance_ns > greatest_ns ? nullptr : &truth[closest].world_from_camera);
  }
  bool any_motion = false;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const std::size_t j = FindClosestStamp(keys, keys[i] + delta);
    if (j + 1 == estimate.size() || true_poses[i] == nullptr || true_poses[j] == nullptr) continue;
    any_motion = any_motion || i != j;
    const Eigen::Isometry3d motion =
        estimate[j].world_from_camera.inverse() * estimate[i].world_from_camera;
    const Eigen::Isometry3d true_motion = true_poses[j]->inverse() * *true_poses[i];
    const Eigen::Isometry3d error = ScaledMotion(motion, options.scale).inverse() * true_motion;
    errors.translation_m.push_back(error.translation().norm());
    errors.rotation_rad.push_back(MotionAngle(error));
  }
  // A pose has no error against itself: where that is all, nothing was measured.
  if (!any_motion) return {};
  return errors;
}

/// Length of the true path up to each pair, in m.
std::vector<double> TrajectoryPathLengths(const TrajectoryPairs& pairs) {
  std::vector<double> lengths_m(pairs.truth.size());
  for (std::size_t i = 1; i < lengths_m.size(); ++i) {
    lengths_m[i] = lengths_m[i - 1] + (pairs.truth[i].world_from_camera.translation() -
                                       pairs.truth[i - 1].world_from_camera.translation())
                                          .norm();
  }
  return lengths_m;
}

/// "1305031102.160 to 1305031128.576"
std::string TrajectorySpan(const std::vector<datasets::StampedPose>& poses) {
  if (poses.empty()) return "nowhere";
  std::ostringstream text;
  text.precision(3);
  text << std::fixed << static_cast<double>(poses.front().stamp_ns) / 1e9 << " to "
       << static_cast<double>(poses.back().stamp_ns) / 1e9 << " s";
  return text.str();
}

TrajectoryPairs AssociateTrajectoriesOrThrow(const std::vector<datasets::StampedPose>& truth,
                                             const std::vector<datasets::StampedPose>& estimate,
                                             const AssociationConfig& options) {
  TrajectoryPairs pairs = Associate(truth, estimate, options);
  if (pairs.truth.size() >= 2) return pairs;
  std::ostringstream sentence;
  sentence << pairs.truth.size() << " of the " << estimate.size()
           << " estimated poses have a true pose nearer than " << options.max_difference_s
           << " s, at least 2 are needed: the true stamps reach from " << TrajectorySpan(truth)
           << ", the estimate's from " << TrajectorySpan(estimate) << ", an offset of "
           << options.offset_s << " s is added to them";
  throw NothingMeasured(sentence.str());
}

}  // namespace

ErrorFigures Summarise(std::vector<double> errors) {
  ErrorFigures figures;
  figures.n = errors.size();
  if (errors.empty()) return figures;
  std::sort(errors.begin(), errors.end());
  const auto n = static_cast<double>(errors.size());
  figures.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / n;
  double squares = 0;
  double deviations = 0;
  for (const double error : errors) {
    squares += error * error;
    deviations += (error - figures.mean) * (error - figures.mean);
  }
  figures.rmse = std::sqrt(squares / n);
  figures.std = std::sqrt(deviations / n);
  figures.median = MedianMetric(errors);
  figures.min = errors.front();
  figures.max = errors.back();
  return figures;
}

std::vector<double> AbsoluteErrors(const TrajectoryPairs& pairs, const Alignment& alignment) {
  std::vector<double> errors_m;
  for (std::size_t i = 0; i < pairs.truth.size(); ++i) {
    errors_m.push_back((pairs.truth[i].world_from_camera.translation() -
                        alignment(pairs.estimate[i].world_from_camera.translation()))
                           .norm());
  }
  return errors_m;
}

RelativeErrors RelativeErrorsOverTime(const std::vector<datasets::StampedPose>& truth,
                                      const std::vector<datasets::StampedPose>& estimate,
                                      double delta_s, const RelativeErrorConfig& options) {
  return CompareTrajectoryMotions(truth, estimate, StampsOf(estimate, 0),
                                  std::llround(delta_s * 1e9), options);
}

RelativeErrors RelativeErrorsOverFrames(const std::vector<datasets::StampedPose>& truth,
                                        const std::vector<datasets::StampedPose>& estimate,
                                        std::size_t delta_frames,
                                        const RelativeErrorConfig& options) {
  std::vector<std::int64_t> indices(estimate.size());
  std::iota(indices.begin(), indices.end(), 0);
  return CompareTrajectoryMotions(truth, estimate, indices, static_cast<std::int64_t>(delta_frames),
                                  options);
}

namespace {

/// Of the estimate's motion from one pair to another, against the true one.
Eigen::Isometry3d TrajectoryMotionError(const TrajectoryPairs& pairs, std::size_t first,
                                        std::size_t last, double scale) {
  const Eigen::Isometry3d true_motion =
      pairs.truth[first].world_from_camera.inverse() * pairs.truth[last].world_from_camera;
  const Eigen::Isometry3d motion =
      pairs.estimate[first].world_from_camera.inverse() * pairs.estimate[last].world_from_camera;
  return ScaledMotion(motion, scale).inverse() * true_motion;
}

/// Segments of the lengths, which ascend, from every `step`th pose.
template <typename Lengths>
std::optional<SegmentErrors> MeanTrajectorySegmentErrors(const TrajectoryPairs& pairs, double scale,
                                                         const Lengths& segment_lengths_m,
                                                         std::size_t step) {
  const std::vector<double> lengths_m = TrajectoryPathLengths(pairs);
  SegmentErrors sums;
  for (std::size_t first = 0; first < lengths_m.size(); first += step) {
    for (const double length_m : segment_lengths_m) {
      const auto end =
          std::upper_bound(lengths_m.begin(), lengths_m.end(), lengths_m[first] + length_m);
      if (end == lengths_m.end()) break;
      const auto last = static_cast<std::size_t>(end - lengths_m.begin());
      const Eigen::Isometry3d error = TrajectoryMotionError(pairs, first, last, scale);
      ++sums.n;
      sums.translation_percent += 100 * error.translation().norm() / length_m;
      sums.rotation_rad_per_m += MotionAngle(error) / length_m;
    }
  }
  if (sums.n == 0) return std::nullopt;
  sums.translation_percent /= static_cast<double>(sums.n);
  sums.rotation_rad_per_m /= static_cast<double>(sums.n);
  return sums;
}

}  // namespace

std::optional<SegmentErrors> KittiSegmentErrors(const TrajectoryPairs& pairs, double scale) {
  return MeanTrajectorySegmentErrors(pairs, scale, kKittiLengthsM, kKittiStep);
}

std::optional<SegmentErrors> ShortSegmentErrors(const TrajectoryPairs& pairs, double scale) {
  return MeanTrajectorySegmentErrors(pairs, scale, kShortLengthsM, 1);
}

TrajectoryFigures EvaluateTrajectory(const std::vector<datasets::StampedPose>& truth,
                                     const std::vector<datasets::StampedPose>& estimate,
                                     const TrajectoryConfig& options) {
  const TrajectoryPairs pairs = AssociateTrajectoriesOrThrow(truth, estimate, options.association);
  const Alignment alignment = Align(pairs, options.alignment);
  TrajectoryFigures figures;
  figures.truth_poses = truth.size();
  figures.estimate_poses = estimate.size();
  figures.pairs = pairs.truth.size();
  for (std::size_t i = 1; i < pairs.truth.size(); ++i) {
    const std::int64_t gap_ns = pairs.truth[i].stamp_ns - pairs.truth[i - 1].stamp_ns;
    figures.longest_gap_s = std::max(figures.longest_gap_s, static_cast<double>(gap_ns) / 1e9);
  }
  const std::int64_t duration_ns = pairs.truth.back().stamp_ns - pairs.truth.front().stamp_ns;
  figures.duration_s = static_cast<double>(duration_ns) / 1e9;
  figures.length_m = TrajectoryPathLengths(pairs).back();
  figures.alignment = options.alignment;
  figures.scale = alignment.scale;
  figures.ate_m = Summarise(AbsoluteErrors(pairs, alignment));

  const RelativeErrorConfig relative{options.association.offset_s, alignment.scale};
  figures.rpe_delta_s = options.rpe_delta_s;
  const RelativeErrors over_time =
      RelativeErrorsOverTime(truth, estimate, options.rpe_delta_s, relative);
  figures.rpe_m = Summarise(over_time.translation_m);
  figures.rpe_rad = Summarise(over_time.rotation_rad);
  figures.rpe_delta_frames = options.rpe_delta_frames;
  if (options.rpe_delta_frames > 0) {
    const RelativeErrors over_frames =
        RelativeErrorsOverFrames(truth, estimate, options.rpe_delta_frames, relative);
    figures.rpe_frames_m = Summarise(over_frames.translation_m);
    figures.rpe_frames_rad = Summarise(over_frames.rotation_rad);
  }
  figures.kitti = KittiSegmentErrors(pairs, alignment.scale);
  figures.short_segments = ShortSegmentErrors(pairs, alignment.scale);
  if (figures.length_m > 0) {
    const Eigen::Isometry3d error =
        TrajectoryMotionError(pairs, 0, pairs.truth.size() - 1, alignment.scale);
    figures.end_error_percent = 100 * error.translation().norm() / figures.length_m;
  }
  return figures;
}

}  // namespace livemap::evaluation
