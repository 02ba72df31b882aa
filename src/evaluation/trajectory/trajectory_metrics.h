#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "datasets/sequences.h"
#include "evaluation/trajectory/trajectory_alignment.h"

namespace livemap::evaluation {

/// Figures of an estimated trajectory against the true one, as the TUM RGB-D benchmark's
/// evaluate_ate.py and evaluate_rpe.py and the KITTI odometry devkit define them;
/// docs/reference/measures.md has the formulas. Trajectories are in the order of their stamps, each
/// stamp once; poses are camera to world, in m.

/// What is said about a set of errors, in their unit; zeros without errors.
struct ErrorFigures {
  std::size_t n = 0;
  double rmse = 0;
  double mean = 0;
  double median = 0;  ///< The mean of the two in the middle for an even number.
  double std = 0;     ///< Of the population.
  double min = 0;
  double max = 0;
};
ErrorFigures Summarise(std::vector<double> errors);

/// Absolute trajectory error (ATE): per pair the distance in m of the true position and the aligned
/// estimated one.
std::vector<double> AbsoluteErrors(const TrajectoryPairs& pairs, const Alignment& alignment);

/// Relative pose errors (RPE): the motion between two poses of the estimate against the true
/// motion.
struct RelativeErrors {
  std::vector<double> translation_m;
  std::vector<double> rotation_rad;  ///< 0..pi
};

struct RelativeErrorConfig {
  double offset_s = 0;  ///< Added to the estimate's stamps.
  double scale = 1;     ///< Of the estimate's translations.
};

/// As evaluate_rpe.py with a fixed delta, but all pairs instead of at most 10000 drawn ones: every
/// pose of the estimate with the one whose stamp is nearest to its own plus `delta_s`, unless that
/// is the last pose. To each of the two belongs the true pose with the nearest stamp; a pair is
/// left out when one of them is farther than twice the median interval of the true stamps. As in
/// the script, after a gap in the estimate the nearest pose may be another time away than
/// `delta_s`, or the pose itself with no error. Empty when there is no such pair, or none but of
/// poses with themselves.
RelativeErrors RelativeErrorsOverTime(const std::vector<datasets::StampedPose>& truth,
                                      const std::vector<datasets::StampedPose>& estimate,
                                      double delta_s, const RelativeErrorConfig& options);

/// The same between each pose and the one `delta_frames` later in the estimate (delta unit "f"),
/// again without pairs that end at the last pose.
RelativeErrors RelativeErrorsOverFrames(const std::vector<datasets::StampedPose>& truth,
                                        const std::vector<datasets::StampedPose>& estimate,
                                        std::size_t delta_frames,
                                        const RelativeErrorConfig& options);

/// Means over segments of the true path, their error relative to their length.
struct SegmentErrors {
  std::size_t n = 0;  ///< Segments.
  double translation_percent = 0;
  double rotation_rad_per_m = 0;
};

/// As the KITTI odometry devkit: from every 10th pose the segments of 100, 200, ... 800 m. None
/// when the true path is not longer than 100 m. `scale` is that of the estimate's translations.
std::optional<SegmentErrors> KittiSegmentErrors(const TrajectoryPairs& pairs, double scale);

/// The same for drives that are shorter than KITTI's: from every pose the segments of 10, 20, ...
/// 50 m. None when the true path is not longer than 10 m.
std::optional<SegmentErrors> ShortSegmentErrors(const TrajectoryPairs& pairs, double scale);

struct TrajectoryConfig {
  AssociationConfig association;
  AlignmentKind alignment = AlignmentKind::kSe3;
  double rpe_delta_s = 1;
  std::size_t rpe_delta_frames = 0;  ///< 0: no relative errors over frames.
};

/// All figures of a trajectory.
struct TrajectoryFigures {
  std::size_t truth_poses = 0;
  std::size_t estimate_poses = 0;
  std::size_t pairs = 0;
  double duration_s = 0;     ///< Between the true stamps of the first and the last pair.
  double length_m = 0;       ///< Of the true path from pair to pair.
  double longest_gap_s = 0;  ///< Between the true stamps of neighbouring pairs.
  AlignmentKind alignment = AlignmentKind::kSe3;
  double scale = 1;                  ///< Not 1 with kSim3 only.
  ErrorFigures ate_m;                ///< m
  double rpe_delta_s = 1;            ///< As asked for.
  ErrorFigures rpe_m;                ///< m over rpe_delta_s; n is 0 without pairs.
  ErrorFigures rpe_rad;              ///< rad over rpe_delta_s
  std::size_t rpe_delta_frames = 0;  ///< As asked for, 0 when it was not.
  ErrorFigures rpe_frames_m;         ///< m over rpe_delta_frames
  ErrorFigures rpe_frames_rad;       ///< rad over rpe_delta_frames
  std::optional<SegmentErrors> kitti;
  std::optional<SegmentErrors> short_segments;
  /// Error of the last pose where the first ones agree, % of the path; none without a path.
  std::optional<double> end_error_percent;
};

/// ATE and KITTI's errors are of the associated pairs, RPE of all poses of the estimate that have a
/// true one. The scale found with kSim3 is applied everywhere. Throws NothingMeasured when
/// fewer than two pairs are found, and Error as Align() does.
TrajectoryFigures EvaluateTrajectory(const std::vector<datasets::StampedPose>& truth,
                                     const std::vector<datasets::StampedPose>& estimate,
                                     const TrajectoryConfig& options);

}  // namespace livemap::evaluation
