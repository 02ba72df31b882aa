#pragma once

#include <cstddef>
#include <string>

#include "geo/camera_intrinsics.h"
#include "odometry/mounting/mounting_estimator.h"

namespace livemap::odometry {

/// A mounting as it is kept on disk, and the rectified camera that it was found with.
struct MountingRecord {
  geo::CameraIntrinsics camera;
  MountingEstimate estimate;
};

constexpr std::size_t kMaxMountingFileBytes = 1U << 14U;

/// Lines "key: value" (YAML) in degrees and metres, with `version` first and `end: true` last, so
/// that a torn file is known. What is not known is left out.
std::string FormatMountingFile(const MountingRecord& record);

/// Throws Error naming the file, the line, its value and what is accepted: for another version, an
/// unknown or a repeated key, what is no number or out of its range, a key that is missing, and a
/// file that ends too soon.
MountingRecord ParseMountingFile(const std::string& text, const std::string& name);

/// Throws Error as ParseMountingFile does, and when the file cannot be read.
MountingRecord ReadMountingFile(const std::string& path);

}  // namespace livemap::odometry
