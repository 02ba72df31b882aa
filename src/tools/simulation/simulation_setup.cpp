#include "tools/simulation/simulation_setup.h"

#include <cmath>

#include "common/error.h"
#include "datasets/text_parsing.h"

namespace livemap::tools {
namespace {

constexpr double kDefaultFieldOfViewDeg = 66;

/// "a<separator>b" as two numbers.
std::pair<double, double> ReadSetupPair(const CommandLine& line, const std::string& flag,
                                        const std::string& otherwise, char separator,
                                        const std::string& accepted) {
  const std::string text = line.Text(flag, otherwise);
  const std::vector<std::string> parts = datasets::Split(text, separator);
  if (parts.size() == 2) {
    const auto a = datasets::ParseFinite(parts[0]);
    const auto b = datasets::ParseFinite(parts[1]);
    if (a && b) return {*a, *b};
  }
  throw Error("--" + flag + " is '" + text + "', accepted is " + accepted);
}

/// Over what the camera's file says.
void ReadMountingFlags(const CommandLine& line, datasets::CameraMounting& mounting) {
  mounting.yaw_deg = line.Number("camera-yaw-deg", mounting.yaw_deg, -180, 180);
  mounting.pitch_deg = line.Number("camera-pitch-deg", mounting.pitch_deg, -30, 89);
  mounting.roll_deg = line.Number("camera-roll-deg", mounting.roll_deg, -45, 45);
  mounting.height_m = line.Number("camera-height-m", mounting.height_m, 0.1, 10);
}

std::optional<CameraKnock> ReadKnock(const CommandLine& line,
                                     const datasets::CameraMounting& mounting) {
  if (!line.Has("knock")) return std::nullopt;
  if (line.Has("bag")) throw Error("--knock and --bag exclude each other: a bag has one mounting");
  const std::string text = line.Text("knock", "");
  std::vector<double> numbers;
  for (const std::string& part : datasets::Split(text, ',')) {
    const std::optional<double> number = datasets::ParseFinite(part);
    if (number && std::abs(*number) <= 7200) numbers.push_back(*number);
  }
  if (numbers.size() != 4 || numbers[0] < 0 || std::abs(numbers[1]) > 30 ||
      std::abs(numbers[2]) > 30 || std::abs(numbers[3]) > 30) {
    throw Error("--knock is '" + text +
                "', accepted is S,YAW,PITCH,ROLL: seconds, and degrees from -30 to 30");
  }
  CameraKnock knock{numbers[0], mounting};
  knock.after.yaw_deg += numbers[1];
  knock.after.pitch_deg += numbers[2];
  knock.after.roll_deg += numbers[3];
  return knock;
}

}  // namespace

datasets::CameraMounting SimulationSetup::MountingAt(double time_s) const {
  return knock && time_s >= knock->time_s ? knock->after : mounting;
}

SimulationSetup ReadSimulationSetup(const CommandLine& line) {
  SimulationSetup setup;
  setup.mounting.height_m = 1.45;
  setup.mounting.pitch_deg = 4;
  geo::CameraIntrinsics& k = setup.camera.intrinsics;
  if (line.Has("camera")) {
    if (line.Has("size")) throw Error("--size and --camera exclude each other");
    const datasets::CameraFile file = datasets::ReadCameraFile(line.Text("camera", ""));
    k = file.intrinsics;
    setup.mounting = file.mounting;
  } else {
    const std::string accepted = "WxH in whole pixels from 64 to 4096, such as 640x480";
    const auto [width, height] = ReadSetupPair(line, "size", "640x480", 'x', accepted);
    for (const double side : {width, height}) {
      if (side < 64 || side > 4096 || side != std::floor(side)) {
        throw Error("--size is '" + line.Text("size", "") + "', accepted is " + accepted);
      }
    }
    k.width = static_cast<int>(width);
    k.height = static_cast<int>(height);
    k.fx = k.fy = 0.5 * width / std::tan(0.5 * kDefaultFieldOfViewDeg * M_PI / 180);
    k.cx = 0.5 * (width - 1);
    k.cy = 0.5 * (height - 1);
  }
  ReadMountingFlags(line, setup.mounting);
  setup.knock = ReadKnock(line, setup.mounting);
  const auto [k1, k2] = ReadSetupPair(line, "distortion", "0,0", ',', "K1,K2 from -0.4 to 0.4");
  if (std::abs(k1) > 0.4 || std::abs(k2) > 0.4) {
    throw Error("--distortion is '" + line.Text("distortion", "") +
                "', accepted is K1,K2 from -0.4 to 0.4");
  }
  setup.camera.k1 = k1;
  setup.camera.k2 = k2;
  setup.baseline_m = line.Has("stereo") ? line.Number("stereo", 0, 0.02, 2) : 0;
  const std::optional<simulation::DepthSensor> depth =
      simulation::ParseDepthSensor(line.Text("depth", "exact"));
  if (!depth) {
    throw Error("--depth is '" + line.Text("depth", "") +
                "', accepted are: exact, kinect, stereo, rough");
  }
  setup.depth = *depth;
  if (line.Has("stereo") && !line.Has("tum") && !line.Has("bag")) {
    throw Error("--stereo needs --tum or --bag, which write what it makes");
  }
  if (line.Has("depth") && !line.Has("tum") && !line.Has("bag-depth")) {
    throw Error("--depth needs --tum or --bag-depth, which write what it makes");
  }
  setup.camera.blur_samples = static_cast<int>(line.Number("blur", 0, 0, 64));
  const std::string place = "LAT,LON in degrees";
  const auto [latitude, longitude] = ReadSetupPair(line, "start", "48.8566,9.0", ',', place);
  setup.datum = {latitude, longitude};
  if (!geo::IsValid(setup.datum)) {
    throw Error("--start is '" + line.Text("start", "") + "', accepted is " + place);
  }
  return setup;
}

simulation::Condition ReadCondition(const CommandLine& line, const std::string& flag,
                                    const std::string& otherwise) {
  const std::string name = line.Text(flag, otherwise);
  const std::optional<simulation::Condition> condition = simulation::ParseCondition(name);
  if (!condition) {
    throw Error("--" + flag + " is '" + name + "', accepted are: day, dusk, rain, snow");
  }
  return *condition;
}

}  // namespace livemap::tools
