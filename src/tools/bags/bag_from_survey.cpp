#include <algorithm>
#include <cstdio>

#include "datasets/image_file.h"
#include "datasets/survey.h"
#include "tools/bags/drive_bag.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"
#include "tools/common/progress.h"
#include "tools/common/share_path.h"

namespace livemap::tools {
namespace {

std::vector<Detection> SurveyBoxes(const std::vector<datasets::LabelledBox>& labels,
                                   const geo::CameraIntrinsics& camera) {
  std::vector<Detection> boxes;
  for (const datasets::LabelledBox& label : labels) {
    const auto edge = [](double centre, double size, double side, int pixels) {
      return static_cast<float>(std::clamp(centre + side * size / 2, 0.0, 1.0) * pixels);
    };
    Detection box;
    // The survey's labels know one class.
    box.class_name =
        label.class_index == 0 ? "pothole" : "class_" + std::to_string(label.class_index);
    box.confidence = 1;
    box.x_min = edge(label.centre_x, label.width, -1, camera.width);
    box.y_min = edge(label.centre_y, label.height, -1, camera.height);
    box.x_max = edge(label.centre_x, label.width, 1, camera.width);
    box.y_max = edge(label.centre_y, label.height, 1, camera.height);
    boxes.push_back(box);
  }
  return boxes;
}

int BagFromSurvey(int argc, char** argv) {
  std::vector<Flag> flags = DriveFlags();
  flags.push_back(
      {"max-gap-s", "S", "cut stretches without frames down to this time (0: keep all)"});
  CommandLine line("livemap_bag_from_survey DIR OUT.bag [flags]",
                   "Makes a bag of a road survey section: DIR holds frames.csv, images/ and "
                   "labels/. Frames are\n"
                   "stamped by chainage over speed (16 m/s).",
                   2, flags);
  if (!line.Parse(argc, argv)) return 0;
  CheckOutputFile("OUT.bag", line.Positional(1), {line.Positional(0)});
  const DriveSetup setup = ReadDriveSetup(line, SharePath("config/cameras/road_survey.yaml"), 16);
  const datasets::SurveyDrive drive = datasets::ReadSurveyDrive(line.Positional(0));
  const std::vector<datasets::FramePlace> places =
      datasets::PlaceFrames(drive, setup.speed_mps, line.Number("max-gap-s", 0, 0, 1e6));
  CheckRouteLength(setup.route, places.back().distance_m);

  DriveBag bag(line.Positional(1), setup);
  Progress progress("frame", drive.frames.size());
  double last_s = -1;
  for (std::size_t i = 0; i < drive.frames.size(); ++i) {
    const datasets::SurveyFrame& frame = drive.frames[i];
    // Chainage is rounded to metres: two frames at one place still follow one another.
    last_s = std::max(places[i].time_s, last_s + 1e-3);
    const geo::CameraIntrinsics& camera = setup.camera.intrinsics;
    const datasets::ImageFile image =
        datasets::ReadImageFile(frame.image_path, camera.width, camera.height);
    bag.AddFrame(last_s, image.bytes, SurveyBoxes(frame.boxes, camera));
    progress.At(i + 1);
  }
  bag.Finish(last_s);
  std::printf("%s: %zu frames, %.1f s, %.0f m\n", line.Positional(1).c_str(), drive.frames.size(),
              last_s, places.back().distance_m);
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_bag_from_survey", argc, argv,
                                    livemap::tools::BagFromSurvey);
}
