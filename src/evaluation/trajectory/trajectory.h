#pragma once

#include <string>
#include <vector>

#include "datasets/sequences.h"

namespace livemap::evaluation {

/// Trajectory files: where a camera was, as a benchmark's truth or an odometry's estimate.
///
/// TUM RGB-D layout, a pose per line, "stamp tx ty tz qx qy qz qw": s, m, unit quaternion, camera
/// to world; stamps increase, lines that begin with '#' and empty ones do not count, and a line
/// that repeats the stamp before with nearly the same pose is left out. KITTI odometry layout, a
/// pose per line, the 12 numbers of the row-major 3x4 matrix camera to world, in m; the line number
/// is the frame, which here stands for frame / `kitti_rate_hz` s. Which of the two a file has is
/// told by its first line's columns.

/// The whole file, at least one pose. Throws Error naming file, line and what is accepted: other
/// numbers of columns, what is no finite number or no rotation, stamps that do not increase, more
/// than 256 MiB or a million lines.
/// `notes` receives sentences about lines that were left out.
std::vector<datasets::StampedPose> ReadTrajectory(const std::string& path, double kitti_rate_hz,
                                                  std::vector<std::string>* notes = nullptr);

/// The same for a file's text; `name` is for messages.
std::vector<datasets::StampedPose> ParseTrajectory(const std::string& text, const std::string& name,
                                                   double kitti_rate_hz,
                                                   std::vector<std::string>* notes = nullptr);

/// Whether the file has KITTI's layout, in which a pose's frame is its line. Throws Error where it
/// cannot be read.
bool HasKittiLayout(const std::string& path);

}  // namespace livemap::evaluation
