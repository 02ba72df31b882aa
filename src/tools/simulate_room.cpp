#include "tools/simulate_room.h"

#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "base/error.h"
#include "simulation/dataset.h"
#include "simulation/room.h"
#include "tools/simulation_outputs.h"
#include "tools/simulation_setup.h"

namespace livemap {
namespace {

constexpr int kPreviewPictures = 12;
constexpr float kGain = 1.3F;

}  // namespace

std::vector<Flag> RoomFlags() {
  return {{"room", "", "instead of a street: a hand-held camera in a furnished room, for --tum"},
          {"vigour", "X", "of --room's hand; 1 is calm, about 0.15 m/s and 8 deg/s (1)"},
          {"flicker", "X", "of --room's light: gain swings by this share, once a second (0)"}};
}

void RefuseRoomFlags(const CommandLine& line) {
  for (const Flag& flag : RoomFlags()) {
    if (flag.name != "room" && line.Has(flag.name)) {
      throw Error("--" + flag.name + " needs --room, whose camera it is about");
    }
  }
}

int SimulateRoom(const CommandLine& line) {
  for (const char* street :
       {"condition", "speed", "stops", "route", "world", "start", "blur", "yolo", "video", "bag",
        "hazards", "truth-preview", "change", "stereo"}) {
    if (line.Has(street)) throw Error("--" + std::string(street) + " is a street's, not --room's");
  }
  if (!line.Has("tum")) throw Error("--room needs --tum DIR, where the sequence goes");
  const double rate_hz = line.Number("rate", 30, 0.1, 100);
  const double vigour = line.Number("vigour", 1, 0, 20);
  const double flicker = line.Number("flicker", 0, 0, 0.9);
  const int rays = line.Has("one-ray") ? 1 : 2;
  const auto threads = static_cast<int>(line.Number("threads", 2, 1, 64));
  const auto frames = static_cast<int>(line.Number("seconds", 5, 0.1, 600) * rate_hz);
  const std::string preview = ReadSheetPath(line, "preview");
  const SimulationSetup setup = ReadSimulationSetup(line);
  const SimulatedRoom room(line.Seed("seed", 1));
  TumWriter writer(line.Text("tum", ""), setup.camera,
                   line.Number("depth-scale", kTumDepthScale, 100, 10000));
  std::vector<cv::Mat> pictures;
  Progress progress("frame", static_cast<std::size_t>(frames));
  for (int i = 0; i < frames; ++i) {
    const double time_s = i / rate_hz;
    const auto gain = static_cast<float>(kGain * (1 + flicker * std::sin(2 * M_PI * time_s)));
    SimulatedFrame frame = room.Render(setup.camera, room.WorldFromOptical(time_s, vigour),
                                       static_cast<std::uint32_t>(i), gain, rays, threads);
    frame.depth = SenseDepth(frame.depth, setup.camera.intrinsics, setup.depth, setup.baseline_m,
                             static_cast<std::uint32_t>(i));
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

}  // namespace livemap
