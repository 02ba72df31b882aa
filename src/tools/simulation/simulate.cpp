#include <malloc.h>

#include <chrono>
#include <cmath>
#include <cstdio>

#include "simulation/motion/vehicle_motion.h"
#include "tools/common/command_line.h"
#include "tools/common/progress.h"
#include "tools/simulation/simulate_change.h"
#include "tools/simulation/simulate_room.h"
#include "tools/simulation/simulation_flags.h"
#include "tools/simulation/simulation_outputs.h"

namespace livemap::tools {
namespace {

std::vector<Flag> SimulateFlags() {
  return {
      {"seed", "N", "of the world; the same seed gives the same bytes (1)"},
      {"condition", "NAME", "day, dusk, rain or snow (day)"},
      {"seconds", "S", "length of the drive (20; --room: 5)"},
      {"rate", "HZ", "pictures per second (10; --room: 30)"},
      {"size", "WxH", "of the pictures, pixels (640x480)"},
      {"camera", "FILE", "camera file, see config/cameras; instead of --size"},
      {"camera-yaw-deg", "DEG", "of the camera; positive looks left (0, or --camera's)"},
      {"camera-pitch-deg", "DEG", "of the camera; positive looks down (4, or --camera's)"},
      {"camera-roll-deg", "DEG", "of the camera; positive: right side down (0, or --camera's)"},
      {"camera-height-m", "M", "of the camera over the road (1.45, or --camera's)"},
      {"knock", "S,YAW,PITCH,ROLL", "the camera turns by so many degrees after S seconds (none)"},
      {"distortion", "K1,K2", "radial distortion of the camera (0,0)"},
      {"blur", "N", "pictures averaged over the exposure of 8 ms (0: no motion blur)"},
      {"speed", "MPS", "aimed at on an open road, m/s (8)"},
      {"stops", "", "wait two seconds at every second crossing"},
      {"route", "FILE.geojson", "a LineString that the road follows, instead of --start"},
      {"start", "LAT,LON", "of the world's origin, degrees (48.8566,9.0)"},
      {"world", "FILE", "street and hazards: docs/reference/simulator.md (by the seed)"},
      {"threads", "N", "that render (2)"},
      {"one-ray", "", "one ray per pixel: twice as fast, jagged edges"},
      {"stereo", "M", "baseline of a right camera to the right, for --tum and --bag (none)"},
      {"depth", "SENSOR",
       "exact, kinect, stereo or rough: how --tum and --bag-depth measure (exact)"},
      {"preview", "FILE.png", "contact sheet of twelve moments"},
      {"truth-preview", "FILE.png", "contact sheet of pictures, boxes, classes and depth"},
      {"tum", "DIR", "TUM RGB-D folder"},
      {"depth-scale", "N", "of --tum's depth, units per metre; 1000 reaches 65 m (5000)"},
      {"yolo", "DIR", "labelled drive, as livemap evaluate detection reads it"},
      {"video", "FILE.mp4", "MPEG-4 at the pictures' rate"},
      {"hazards", "FILE", "the true hazards that were in view, GeoJSON"}};
}

simulation::DrivingStyle ReadDrivingStyle(const CommandLine& line) {
  simulation::DrivingStyle style;
  style.speed_mps = line.Number("speed", style.speed_mps, 0.5, 30);
  style.seconds = line.Number("seconds", 20, 0.1, 7200);
  style.stops = line.Has("stops");
  return style;
}

/// The camera's view at a time, and where it will be when the exposure ends.
simulation::CameraExposure SimulatedViewAt(const simulation::VehicleMotion& motion,
                                           const SimulationSetup& setup, double time_s) {
  const Eigen::Isometry3d base_from_optical = setup.MountingAt(time_s).BaseFromOptical();
  simulation::CameraExposure camera;
  camera.world_from_optical = motion.WorldFromBase(time_s) * base_from_optical;
  camera.world_from_optical_end =
      motion.WorldFromBase(time_s + setup.camera.exposure_s) * base_from_optical;
  camera.along_m = motion.AlongM(time_s);
  return camera;
}

/// A street's blocks come and go by megabytes. What they give back shall go back to the system, not
/// stay in pieces between what lives on: glibc would raise its bound for that with every block.
void KeepSimulateMemoryFlat() {
  mallopt(M_MMAP_THRESHOLD, 64 * 1024);
  mallopt(M_TRIM_THRESHOLD, 128 * 1024);
}

int Simulate(int argc, char** argv) {
  std::vector<Flag> flags = SimulateFlags();
  for (const Flag& flag : SimulationBagFlags()) flags.push_back(flag);
  for (const Flag& flag : ChangeFlags()) flags.push_back(flag);
  for (const Flag& flag : RoomFlags()) flags.push_back(flag);
  CommandLine line(
      "livemap_simulate [flags]",
      "Renders a drive through a generated street with the truth about everything in it.", 0,
      flags);
  if (!line.Parse(argc, argv)) return 0;
  KeepSimulateMemoryFlat();
  if (WantsRoom(line)) return SimulateRoom(line);
  RefuseRoomFlags(line);
  if (line.Has("change")) return SimulateChange(line);
  RefuseChangeFlags(line);
  RefuseNoOutput(line);
  const std::uint64_t seed = line.Seed("seed", 1);
  const simulation::Condition condition = ReadCondition(line, "condition", "day");
  const simulation::DrivingStyle style = ReadDrivingStyle(line);
  const double seconds = style.seconds;
  const double rate_hz = line.Number("rate", 10, 0.1, 100);
  SimulationSetup setup = ReadSimulationSetup(line);
  simulation::RenderConfig options;
  options.threads = static_cast<int>(line.Number("threads", 2, 1, 64));
  options.smooth_edges = !line.Has("one-ray");
  const simulation::WorldDescription world = ReadSimulatedWorld(line, setup);

  const simulation::Street street(world, seed, seconds * style.speed_mps * 1.1 + 300,
                                  condition != simulation::Condition::kSnow);
  const simulation::VehicleMotion motion(street, style, 0);
  CheckRouteHolds(line, street.line().length_m(), motion.AlongM(seconds));
  simulation::StreetRenderer renderer(street, setup.camera,
                                      simulation::MakeLighting(condition, seed), options);
  const auto frames =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::floor(seconds * rate_hz)));
  SimulationOutputs outputs(line, setup, rate_hz, frames);
  outputs.OpenBag(line, street, motion);
  Progress progress("frame", frames);
  const auto begin = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < frames; ++i) {
    const double time_s = static_cast<double>(i) / rate_hz;
    simulation::CameraExposure camera = SimulatedViewAt(motion, setup, time_s);
    const auto number = static_cast<std::uint32_t>(i);
    const simulation::SimulatedFrame frame = renderer.Render(camera, number);
    cv::Mat right;
    if (setup.baseline_m > 0) {
      const Eigen::Translation3d beside(setup.baseline_m, 0, 0);
      camera.world_from_optical = camera.world_from_optical * beside;
      camera.world_from_optical_end = camera.world_from_optical_end * beside;
      // The cameras' sensors have noise of their own.
      right = renderer.Render(camera, number + 0x40000000U).bgr;
    }
    outputs.Add(i, time_s, camera.along_m, frame, right);
    progress.At(i + 1);
  }
  outputs.Finish(street, static_cast<double>(frames) / rate_hz);
  const double took_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("%zu frames, %.1f s of driving, %zu hazards seen, %.1f frames/s\n", frames, seconds,
              outputs.hazards(), static_cast<double>(frames) / took_s);
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_simulate", argc, argv, livemap::tools::Simulate);
}
