#include "simulation/motion/pass_drive.h"

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {
namespace {

constexpr std::uint64_t kManner = 42;

DrivingStyle PassStyleOf(const PassManner& manner) {
  DrivingStyle style;
  style.speed_mps = manner.speed_mps;
  style.seconds = manner.seconds;
  return style;
}

}  // namespace

PassManner DrawSecondManner(std::uint64_t seed, double speed_mps, double rate_hz, double seconds) {
  CounterRandom random(seed, kManner);
  PassManner manner;
  manner.speed_mps = speed_mps * random.Uniform(0.8, 1.2);
  manner.rate_hz = rate_hz;
  manner.seconds = seconds;
  manner.start_m = random.Uniform(0.0, 6.0);
  manner.left_m = (random.Chance(0.5) ? 1 : -1) * random.Uniform(0.3, 0.8);
  return manner;
}

PassDrive::PassDrive(const Street& street, const PassManner& manner,
                     const datasets::CameraMounting& mounting, double exposure_s)
    : manner_(manner),
      base_from_optical_(mounting.BaseFromOptical()),
      exposure_s_(exposure_s),
      motion_(street, PassStyleOf(manner), manner.start_m) {}

double PassDrive::TimeS(std::size_t frame) const {
  return static_cast<double>(frame) / manner_.rate_hz;
}

double PassDrive::AlongM(std::size_t frame) const { return motion_.AlongM(TimeS(frame)); }

Eigen::Isometry3d PassDrive::WorldFromOptical(double time_s) const {
  return motion_.WorldFromBase(time_s) * Eigen::Translation3d(0, manner_.left_m, 0) *
         base_from_optical_;
}

CameraExposure PassDrive::Camera(std::size_t frame) const {
  CameraExposure camera;
  camera.world_from_optical = WorldFromOptical(TimeS(frame));
  camera.world_from_optical_end = WorldFromOptical(TimeS(frame) + exposure_s_);
  camera.along_m = AlongM(frame);
  return camera;
}

std::size_t PassDrive::Nearest(double along_m) const {
  std::size_t beyond = 1;
  while (AlongM(beyond) < along_m) beyond *= 2;
  // The first picture that is not before the place lies in [low, beyond].
  std::size_t low = 0;
  while (low < beyond) {
    const std::size_t middle = (low + beyond) / 2;
    if (AlongM(middle) < along_m) {
      low = middle + 1;
    } else {
      beyond = middle;
    }
  }
  if (low > 0 && along_m - AlongM(low - 1) < AlongM(low) - along_m) --low;
  return low;
}

}  // namespace livemap::simulation
