#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "base/error.h"
#include "drives/generated_drive.h"
#include "tools/command_line.h"
#include "tools/drive_bag.h"
#include "tools/share_path.h"

namespace livemap {
namespace {

constexpr double kPi = 3.14159265358979323846;

std::vector<Detection> ToBoxes(const std::vector<VisibleHazard>& hazards) {
  std::vector<Detection> boxes;
  for (const VisibleHazard& hazard : hazards) {
    Detection box;
    box.class_name = hazard.class_name;
    box.confidence = 1;
    box.x_min = static_cast<float>(hazard.box.x);
    box.y_min = static_cast<float>(hazard.box.y);
    box.x_max = static_cast<float>(hazard.box.br().x);
    box.y_max = static_cast<float>(hazard.box.br().y);
    boxes.push_back(box);
  }
  return boxes;
}

/// The hazards that at least one picture shows, as GeoJSON points, for counting found and missed.
void WriteTruth(const std::string& path, const GeneratedWorld& world, const Route& route,
                const std::map<int, int>& frames_seen) {
  nlohmann::json features = nlohmann::json::array();
  for (const GeneratedHazard& hazard : world.hazards) {
    const auto seen = frames_seen.find(hazard.id);
    if (seen == frames_seen.end()) continue;
    const RoutePose pose = route.At(hazard.along_m);
    const GeoPoint position =
        GeodesicDestination(pose.position, pose.bearing_rad - kPi / 2, hazard.left_m);
    features.push_back(
        {{"type", "Feature"},
         {"geometry",
          {{"type", "Point"}, {"coordinates", {position.longitude_deg, position.latitude_deg}}}},
         {"properties",
          {{"id", hazard.id},
           {"class", hazard.class_name},
           {"radius_m", hazard.radius_m},
           {"frames_seen", seen->second}}}});
  }
  const nlohmann::json truth = {{"type", "FeatureCollection"}, {"features", features}};
  const std::string unfinished = path + ".unfinished";
  std::ofstream file(unfinished);
  file << truth.dump(1) << "\n";
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(unfinished, path, error);
  if (!file || error) throw Error("the hazards' file '" + path + "' cannot be written");
}

/// DRIVE.bag -> DRIVE.geojson.
std::string TruthPath(const std::string& bag_path) {
  return std::filesystem::path(bag_path).replace_extension(".geojson").string();
}

int Run(int argc, char** argv) {
  std::vector<Flag> flags = DriveFlags();
  flags.push_back({"seconds", "S", "length of the drive (30)"});
  flags.push_back({"rate-hz", "HZ", "pictures per second (10)"});
  flags.push_back({"frames-dir", "DIR", "write the pictures there as well"});
  CommandLine line("livemap_bag_generate OUT.bag [flags]",
                   "Draws a drive along a country road with potholes and traffic cones at known\n"
                   "places (10 m/s) and writes OUT.bag with OUT.geojson, the true hazards.",
                   1, flags);
  if (!line.Parse(argc, argv)) return 0;
  const DriveSetup setup = ReadDriveSetup(line, SharePath("config/cameras/generated.yaml"), 10);
  const double seconds = line.Number("seconds", 30, 0.1, 7200);
  const double rate_hz = line.Number("rate-hz", 10, 0.1, 100);
  const double length_m = seconds * setup.speed_mps;
  CheckRouteLength(setup.route, length_m);
  const std::string frames_dir = line.Text("frames-dir", "");
  if (!frames_dir.empty() && !std::filesystem::is_directory(frames_dir)) {
    throw Error("--frames-dir '" + frames_dir + "' is no folder");
  }

  const GeneratedWorld world = PlanWorld(setup.seed, length_m);
  GeneratedDriveRenderer renderer(world, setup.camera);
  DriveBag bag(line.Positional(0), setup);
  const auto frames = static_cast<std::size_t>(std::floor(seconds * rate_hz));
  Progress progress("frame", frames);
  std::map<int, int> frames_seen;
  for (std::size_t i = 0; i < frames; ++i) {
    const double time_s = static_cast<double>(i) / rate_hz;
    const double along_m = time_s * setup.speed_mps;
    std::vector<std::uint8_t> jpeg;
    cv::imencode(".jpg", renderer.Render(along_m), jpeg, {cv::IMWRITE_JPEG_QUALITY, 88});
    const std::vector<VisibleHazard> visible = renderer.Visible(along_m);
    for (const VisibleHazard& hazard : visible) ++frames_seen[hazard.id];
    bag.AddFrame(time_s, jpeg, ToBoxes(visible));
    if (!frames_dir.empty()) {
      char name[32];
      std::snprintf(name, sizeof(name), "/%06zu.jpg", i);
      std::ofstream(frames_dir + name, std::ios::binary)
          .write(reinterpret_cast<const char*>(jpeg.data()),
                 static_cast<std::streamsize>(jpeg.size()));
    }
    progress.At(i + 1);
  }
  WriteTruth(TruthPath(line.Positional(0)), world, setup.route, frames_seen);
  bag.Finish(static_cast<double>(frames) / rate_hz);
  std::printf("%s: %zu frames, %.1f s, %.0f m, %zu hazards\n", line.Positional(0).c_str(), frames,
              seconds, length_m, frames_seen.size());
  return 0;
}

}  // namespace
}  // namespace livemap

int main(int argc, char** argv) {
  return livemap::RunProgram("livemap_bag_generate", argc, argv, livemap::Run);
}
