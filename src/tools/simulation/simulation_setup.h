#pragma once

#include <optional>

#include "datasets/camera_file.h"
#include "geo/wgs84.h"
#include "simulation/render/lighting.h"
#include "simulation/render/simulated_camera.h"
#include "simulation/sensors/depth_sensor.h"
#include "tools/common/command_line.h"

namespace livemap::tools {

/// A blow that turns the camera.
struct CameraKnock {
  double time_s = 0;
  datasets::CameraMounting after;
};

/// The sensors of a simulated drive and where the world lies.
struct SimulationSetup {
  simulation::SimulatedCamera camera;
  simulation::DepthSensor depth = simulation::DepthSensor::kExact;
  double baseline_m = 0;  ///< 0: monocular.
  datasets::CameraMounting mounting;
  std::optional<CameraKnock> knock;
  geo::GeoPoint datum;  ///< Of the world's origin.

  datasets::CameraMounting MountingAt(double time_s) const;
};

/// --camera, --size, --camera-yaw-deg and its likes, --knock, --distortion, --stereo, --depth,
/// --blur, --start. Throws Error naming the flag.
SimulationSetup ReadSimulationSetup(const CommandLine& line);
/// Value of `flag`; throws Error naming what is accepted.
simulation::Condition ReadCondition(const CommandLine& line, const std::string& flag,
                                    const std::string& otherwise);

}  // namespace livemap::tools
