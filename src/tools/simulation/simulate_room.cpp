#include "tools/simulation/simulate_room.h"

#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "common/error.h"
#include "simulation/datasets/tum_writer.h"
#include "simulation/room/patterned_wall.h"
#include "simulation/room/simulated_room.h"
#include "tools/common/contact_sheet.h"
#include "tools/common/progress.h"
#include "tools/simulation/simulation_outputs.h"
#include "tools/simulation/simulation_setup.h"

namespace livemap::tools {
namespace {

constexpr int kPreviewPictures = 12;
constexpr float kGain = 1.3F;

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
          {"flicker", "X", "of their light: gain swings by this share, once a second (0)"}};
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
        "hazards", "truth-preview", "change", "stereo"}) {
    if (line.Has(street))
      throw Error("--" + std::string(street) + " is a street's, not " + name + "'s");
  }
  if (!line.Has("tum")) throw Error(name + " needs --tum DIR, where the sequence goes");
  const double rate_hz = line.Number("rate", 30, 0.1, 100);
  const double vigour = line.Number("vigour", 1, 0, 20);
  const double flicker = line.Number("flicker", 0, 0, 0.9);
  const int rays = line.Has("one-ray") ? 1 : 2;
  const auto threads = static_cast<int>(line.Number("threads", 2, 1, 64));
  const auto frames = static_cast<int>(line.Number("seconds", 5, 0.1, 600) * rate_hz);
  const std::string preview = ReadSheetPath(line, "preview");
  const SimulationSetup setup = ReadSimulationSetup(line);
  const simulation::SimulatedRoom room(line.Seed("seed", 1));
  simulation::TumWriter writer(line.Text("tum", ""), setup.camera,
                               line.Number("depth-scale", simulation::kTumDepthScale, 100, 10000));
  const Eigen::Isometry3d first_pose = room.WorldFromOptical(0, vigour);
  std::vector<cv::Mat> pictures;
  Progress progress("frame", static_cast<std::size_t>(frames));
  for (int i = 0; i < frames; ++i) {
    const double time_s = i / rate_hz;
    const double gain = 1 + flicker * std::sin(2 * M_PI * time_s);
    const Eigen::Isometry3d pose = room.WorldFromOptical(time_s, vigour);
    simulation::SimulatedFrame frame =
        wall ? SeeRoomWall(setup.camera, first_pose.inverse() * pose, gain)
             : room.Render(setup.camera, pose, static_cast<std::uint32_t>(i),
                           static_cast<float>(kGain * gain), rays, threads);
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
