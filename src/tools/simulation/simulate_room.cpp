#include "tools/simulation/simulate_room.h"

#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>

#include "common/error.h"
#include "simulation/datasets/tum_writer.h"
#include "simulation/room/patterned_wall.h"
#include "simulation/room/room_motion.h"
#include "simulation/room/simulated_room.h"
#include "tools/common/contact_sheet.h"
#include "tools/common/progress.h"
#include "tools/simulation/simulation_outputs.h"
#include "tools/simulation/simulation_setup.h"

namespace livemap::tools {
namespace {

constexpr int kPreviewPictures = 12;
constexpr float kGain = 1.3F;
constexpr double kExposureStepS = 0.4;

/// Camera and light of --room and --wall.
struct RoomView {
  simulation::RoomMotion motion = simulation::RoomMotion::kHand;
  double vigour = 1;
  double flicker = 0;
  double exposure_steps = 0;
  double rolling_s = 0;

  double GainAt(double time_s) const {
    const bool brighter = std::fmod(time_s, 2 * kExposureStepS) >= kExposureStepS;
    return (1 + flicker * std::sin(2 * M_PI * time_s)) * (brighter ? 1 + exposure_steps : 1);
  }
};

RoomView ReadRoomView(const CommandLine& line) {
  RoomView view;
  const std::string name = line.Text("motion", "hand");
  const auto motion = simulation::ParseRoomMotion(name);
  if (!motion) {
    throw Error("--motion is '" + name +
                "', accepted are: hand, walking, fast-turn, shake, car, from-speed");
  }
  view.motion = *motion;
  view.vigour = line.Number("vigour", 1, 0, 20);
  view.flicker = line.Number("flicker", 0, 0, 0.9);
  view.exposure_steps = line.Number("exposure-steps", 0, 0, 1);
  view.rolling_s = line.Number("rolling-shutter", 0, 0, 0.1);
  return view;
}

simulation::RoomPlan ReadRoomPlan(const CommandLine& line, simulation::RoomMotion motion) {
  const std::uint64_t seed = line.Seed("seed", 1);
  if (!line.Has("varied")) {
    if (motion == simulation::RoomMotion::kCar) {
      throw Error("--motion car needs --varied: the standard room is too small for one");
    }
    return simulation::StandardRoomPlan(seed);
  }
  return simulation::VariedRoomPlan(seed, motion == simulation::RoomMotion::kCar
                                              ? simulation::RoomScale::kHall
                                              : simulation::RoomScale::kRoom);
}

/// The wall has neither a plan nor a sensor.
void RefuseRoomOnlyFlags(const CommandLine& line) {
  for (const char* flag : {"varied", "motion", "noise", "rolling-shutter"}) {
    if (line.Has(flag)) throw Error("--" + std::string(flag) + " is --room's, not --wall's");
  }
}

/// The wall as the simulator's other pictures are: with depth, grey in all three channels.
simulation::SimulatedFrame SeeRoomWall(const simulation::SimulatedCamera& camera,
                                       const Eigen::Isometry3d& world_from_optical, double gain) {
  const simulation::PatternedWall::View view =
      simulation::PatternedWall::See(camera.intrinsics, world_from_optical, gain, 0);
  simulation::SimulatedFrame frame;
  cv::cvtColor(view.grey, frame.bgr, cv::COLOR_GRAY2BGR);
  frame.depth = view.depth;
  frame.world_from_optical = world_from_optical;
  return frame;
}

}  // namespace

std::vector<Flag> RoomFlags() {
  return {{"room", "", "instead of a street: a hand-held camera in a furnished room, for --tum"},
          {"wall", "", "as --room, but a wall with a smooth pattern: exact to the grey level"},
          {"vigour", "X",
           "of the hand of --room and --wall; 1 is calm, about 0.15 m/s and 8 deg/s (1)"},
          {"flicker", "X", "of their light: gain swings by this share, once a second (0)"},
          {"exposure-steps", "X", "their gain jumps up by this share and back, every 0.4 s (0)"},
          {"varied", "", "a --room whose size, clutter and patterns --seed draws, too"},
          {"motion", "NAME",
           "of --room's camera: hand, walking, fast-turn, shake, car or from-speed (hand)"},
          {"noise", "X", "of --room's sensor, times the usual (1)"},
          {"rolling-shutter", "S", "time from --room's first row to the last (0)"}};
}

void RefuseRoomFlags(const CommandLine& line) {
  for (const Flag& flag : RoomFlags()) {
    if (line.Has(flag.name)) {
      throw Error("--" + flag.name + " needs --room or --wall, whose camera it is about");
    }
  }
}

bool WantsRoom(const CommandLine& line) { return line.Has("room") || line.Has("wall"); }

int SimulateRoom(const CommandLine& line) {
  const bool wall = line.Has("wall");
  const std::string name = wall ? "--wall" : "--room";
  if (wall && line.Has("room")) throw Error("--room and --wall are two worlds; give one of them");
  for (const char* street :
       {"condition", "speed", "stops", "route", "world", "start", "blur", "yolo", "video", "bag",
        "hazards", "truth-preview", "change", "stereo", "knock", "camera-yaw-deg",
        "camera-pitch-deg", "camera-roll-deg", "camera-height-m"}) {
    if (line.Has(street))
      throw Error("--" + std::string(street) + " is a street's, not " + name + "'s");
  }
  if (!line.Has("tum")) throw Error(name + " needs --tum DIR, where the sequence goes");
  const double rate_hz = line.Number("rate", 30, 0.1, 100);
  const RoomView view = ReadRoomView(line);
  if (wall) RefuseRoomOnlyFlags(line);
  const int rays = line.Has("one-ray") ? 1 : 2;
  const auto threads = static_cast<int>(line.Number("threads", 2, 1, 64));
  const auto frames = static_cast<int>(line.Number("seconds", 5, 0.1, 600) * rate_hz);
  const std::string preview = ReadSheetPath(line, "preview");
  SimulationSetup setup = ReadSimulationSetup(line);
  const auto noise = static_cast<float>(line.Number("noise", 1, 0, 20));
  setup.camera.shot_noise *= noise;
  setup.camera.read_noise *= noise;
  const simulation::SimulatedRoom room(ReadRoomPlan(line, view.motion));
  const auto pose_at = [&](double time_s) {
    return RoomCameraPose(room.plan(), view.motion, time_s, view.vigour);
  };
  simulation::TumWriter writer(line.Text("tum", ""), setup.camera,
                               line.Number("depth-scale", simulation::kTumDepthScale, 100, 10000));
  const Eigen::Isometry3d first_pose = pose_at(0);
  std::vector<cv::Mat> pictures;
  Progress progress("frame", static_cast<std::size_t>(frames));
  for (int i = 0; i < frames; ++i) {
    const double time_s = i / rate_hz;
    const double gain = view.GainAt(time_s);
    const Eigen::Isometry3d pose = pose_at(time_s);
    std::optional<Eigen::Isometry3d> last_row;
    if (view.rolling_s > 0) last_row = pose_at(time_s + view.rolling_s);
    simulation::SimulatedFrame frame =
        wall ? SeeRoomWall(setup.camera, first_pose.inverse() * pose, gain)
             : room.Render(setup.camera, pose, static_cast<std::uint32_t>(i),
                           static_cast<float>(kGain * gain), rays, threads, last_row);
    frame.depth = simulation::SenseDepth(frame.depth, setup.camera.intrinsics, setup.depth,
                                         setup.baseline_m, static_cast<std::uint32_t>(i));
    if (i * kPreviewPictures / frames != (i - 1) * kPreviewPictures / frames || i == 0) {
      pictures.push_back(frame.bgr.clone());
    }
    writer.Add(time_s, frame);
    progress.At(static_cast<std::size_t>(i) + 1);
  }
  writer.Finish();
  if (!preview.empty() && !cv::imwrite(preview, ContactSheet(pictures, 4))) {
    throw Error("the contact sheet '" + preview + "' cannot be written");
  }
  std::printf("%d frames\n", frames);
  return 0;
}

}  // namespace livemap::tools
