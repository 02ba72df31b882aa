#pragma once

#include <cstddef>
#include <cstdint>

#include "datasets/camera_file.h"
#include "simulation/motion/vehicle_motion.h"
#include "simulation/render/street_renderer.h"

namespace livemap::simulation {

/// How one of several drives down a lane is driven.
struct PassManner {
  double speed_mps = 8;  ///< Aimed at on an open road.
  double rate_hz = 10;   ///< Pictures per second.
  double start_m = 0;    ///< Along the road, of the first picture.
  double seconds = 60;   ///< Length of the drive.
  double left_m = 0;     ///< Beside the lane's usual line.
};

/// The second drive of a lane that was first driven at `speed_mps`: 0.3 to 0.8 m to one side, 0.8
/// to 1.2 times as fast, begun up to 6 m later. Drawn by the seed.
PassManner DrawSecondManner(std::uint64_t seed, double speed_mps, double rate_hz, double seconds);

/// The camera of a drive, picture by picture.
class PassDrive {
 public:
  /// `street` must outlive the drive; `exposure_s` is the shutter's time.
  PassDrive(const Street& street, const PassManner& manner,
            const datasets::CameraMounting& mounting, double exposure_s);

  /// Of the picture `frame`, metres along the road's middle line; grows with `frame`.
  double AlongM(std::size_t frame) const;
  CameraExposure Camera(std::size_t frame) const;
  /// The picture whose place along the road is the nearest to `along_m`.
  std::size_t Nearest(double along_m) const;

 private:
  double TimeS(std::size_t frame) const;
  Eigen::Isometry3d WorldFromOptical(double time_s) const;

  PassManner manner_;
  Eigen::Isometry3d base_from_optical_;
  double exposure_s_;
  VehicleMotion motion_;
};

}  // namespace livemap::simulation
