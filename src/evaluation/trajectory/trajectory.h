#pragma once

#include <string>
#include <vector>

#include "datasets/sequences.h"

namespace livemap::evaluation {

/// Trajectory files: where a camera was, as a benchmark's truth or an odometry's estimate.
///
/// TUM RGB-D layout, a pose per line, "stamp tx ty tz qx qy qz qw": s, m, unit quaternion, camera
/// to world; stamps increase, lines that begin with '#' and empty ones do not count. KITTI odometry
/// layout, a pose per line, the 12 numbers of the row-major 3x4 matrix camera to world, in m; the
/// line number is the frame, which here stands for frame / `kitti_rate_hz` s. Which of the two a
/// file has is told by its first line's columns.

/// The whole file, at least one pose. Throws Error naming file, line and what is accepted: other
/// numbers of columns, what is no finite number or no rotation, stamps that do not increase, more
/// than 256 MiB or a million lines.
std::vector<datasets::StampedPose> ReadTrajectory(const std::string& path, double kitti_rate_hz);

/// The same for a file's text; `name` is for messages.
std::vector<datasets::StampedPose> ParseTrajectory(const std::string& text, const std::string& name,
                                                   double kitti_rate_hz);

}  // namespace livemap::evaluation
