#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "datasets/sequences.h"
#include "odometry/monocular/monocular_odometry.h"
#include "tools/odometry/vo_method.h"

namespace livemap::tools {

/// What tells a single camera metres in a recorded sequence.
struct MonocularOptions {
  odometry::ScaleSource scale_source = odometry::ScaleSource::kSpeed;
  double speed_sigma_mps = 0;  ///< Noise added to the true speed, standard deviation.
  std::uint64_t seed = 1;      ///< Of that noise.
  double camera_height_m = 1.65;
  /// Positive looks down; none: as it sees the direction of travel.
  std::optional<double> camera_pitch_rad{};
  int keyframe_delay = 0;  ///< Frames until a keyframe is taken over, as on board.
};

/// Follows the sequence, of which every `step`th frame comes, by monocular odometry; depth is not
/// looked at. The speed is that between the true poses before and after a frame, as a satellite
/// receiver would measure it. Throws Error when the speed is asked for and there are no true poses.
std::unique_ptr<VoMethod> MakeMonocularMethod(const MonocularOptions& options,
                                              const odometry::EdgeOdometry::Config& config,
                                              const geo::CameraIntrinsics& intrinsics,
                                              const datasets::Sequence& sequence, std::size_t step);

}  // namespace livemap::tools
