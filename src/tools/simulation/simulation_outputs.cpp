#include "tools/simulation/simulation_outputs.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "datasets/sensors/gnss_multipath.h"
#include "simulation/datasets/hazard_geojson.h"
#include "simulation/datasets/output_files.h"
#include "simulation/datasets/truth_pictures.h"
#include "simulation/world/skyline.h"
#include "tools/common/contact_sheet.h"
#include "tools/simulation/simulation_flags.h"

namespace livemap::tools {
namespace {

constexpr std::size_t kMaxPreviews = 12;
constexpr double kPreviewWidth = 480;
/// Of depth as a stereo camera gives it, when the drive has no right camera.
constexpr double kDefaultBaselineM = 0.25;
/// Keeps these numbers apart from the receiver's.
constexpr std::uint64_t kMultipathStream = 0x6d756c7469706174ULL;

void WriteOutputSheet(const std::string& path, const std::vector<cv::Mat>& pictures, int columns) {
  if (!cv::imwrite(path, ContactSheet(pictures, columns))) {
    throw Error("the contact sheet '" + path + "' cannot be written");
  }
}

/// As a camera file; of a camera that was knocked, the mounting at the end.
void WriteTrueMounting(const std::string& path, const SimulationSetup& setup) {
  std::ofstream file = simulation::OpenFile(path);
  file << datasets::FormatCameraFile(
      {"simulated", setup.camera.intrinsics, setup.knock ? setup.knock->after : setup.mounting});
  simulation::CloseFile(file, path);
}

}  // namespace

void RefuseNoOutput(const CommandLine& line) {
  std::string accepted;
  for (const char* flag : {"preview", "truth-preview", "tum", "yolo", "video", "bag", "hazards"}) {
    if (line.Has(flag)) return;
    accepted += (accepted.empty() ? "--" : ", --") + std::string(flag);
  }
  throw Error("nothing would be written: accepted is at least one of " + accepted +
              ", --change, --room");
}

std::string ReadSheetPath(const CommandLine& line, const std::string& flag) {
  std::string path = line.Text(flag, "");
  if (!line.Has(flag)) return path;
  if (!cv::haveImageWriter(path)) {
    throw Error("the contact sheet '" + path + "' must end in .png or .jpg");
  }
  simulation::CheckWritable(path);
  return path;
}

SimulationOutputs::SimulationOutputs(const CommandLine& line, const SimulationSetup& setup,
                                     double rate_hz, std::size_t frames)
    : setup_(setup),
      preview_path_(ReadSheetPath(line, "preview")),
      truth_path_(ReadSheetPath(line, "truth-preview")),
      hazards_path_(line.Text("hazards", "")),
      frames_(frames) {
  if (line.Has("hazards")) simulation::CheckWritable(hazards_path_);
  if (line.Has("tum")) {
    const double scale = line.Number("depth-scale", simulation::kTumDepthScale, 100, 10000);
    const std::string folder = line.Text("tum", "");
    tum_ = std::make_unique<simulation::TumWriter>(folder, setup.camera, scale, setup.baseline_m);
    WriteTrueMounting(folder + "/mounting.yaml", setup);
  }
  if (line.Has("yolo")) yolo_ = std::make_unique<simulation::YoloWriter>(line.Text("yolo", ""));
  if (!line.Has("video")) return;
  const std::string path = line.Text("video", "");
  const geo::CameraIntrinsics& k = setup.camera.intrinsics;
  if (!video_.open(path, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), rate_hz,
                   cv::Size(k.width, k.height))) {
    throw Error("the video '" + path + "' cannot be written, accepted is a file .mp4");
  }
}

void SimulationOutputs::OpenBag(const CommandLine& line, const simulation::Street& street,
                                const simulation::VehicleMotion& motion) {
  SimulationBag::Setup setup;
  setup.options = ReadBagOptions(line);
  if (!line.Has("bag")) return;
  if (setup_.camera.k1 != 0 || setup_.camera.k2 != 0) {
    throw Error("--bag and --distortion exclude each other: a bag's camera has none");
  }
  setup.camera = {"simulated", setup_.camera.intrinsics, setup_.mounting};
  setup.baseline_m = setup_.baseline_m;
  setup.datum = setup_.datum;
  setup.seed = street.seed();
  setup.state = [&motion](double time_s) { return motion.StateAt(time_s); };
  const auto multipath = std::make_shared<datasets::GnssMultipath>(
      setup.options.multipath_m, street.seed() ^ kMultipathStream);
  setup.multipath_m = [&street, &motion, multipath](double time_s) {
    const double along = motion.AlongM(time_s);
    return multipath->ErrorAt(time_s, along, street.line().HeadingRad(along),
                              simulation::SkyOver(street, along, street.lane_left_m()));
  };
  bag_depth_ = setup.options.depth;
  bag_ = OpenSimulationBag(line.Text("bag", ""), setup);
}

cv::Mat SimulationOutputs::Sense(std::size_t index, const simulation::SimulatedFrame& frame) const {
  return simulation::SenseDepth(frame.depth, setup_.camera.intrinsics, setup_.depth,
                                setup_.baseline_m > 0 ? setup_.baseline_m : kDefaultBaselineM,
                                static_cast<std::uint32_t>(index));
}

void SimulationOutputs::Add(std::size_t index, double time_s, double along_m,
                            const simulation::SimulatedFrame& frame, const cv::Mat& right) {
  const std::vector<simulation::HazardInView> hazards =
      simulation::FindHazards(frame.instances, frame.outlines);
  for (const simulation::HazardInView& hazard : hazards) ++frames_seen_[hazard.instance];
  const cv::Mat depth = tum_ || bag_depth_ ? Sense(index, frame) : cv::Mat();
  if (tum_) {
    simulation::SimulatedFrame sensed = frame;
    sensed.depth = depth;
    tum_->Add(time_s, sensed, right);
  }
  if (video_.isOpened()) video_.write(frame.bgr);
  if (bag_) bag_->Add(time_s, frame, bag_depth_ ? depth : cv::Mat(), right, hazards);
  if (yolo_) yolo_->Add(along_m, frame, hazards);
  along_m_ = along_m;
  // Evenly over the whole drive.
  const std::size_t moment = index * kMaxPreviews / frames_;
  if (moment >= preview_moments_) {
    preview_moments_ = moment + 1;
    AddToSheets(frame, hazards);
  }
}

void SimulationOutputs::AddToSheets(const simulation::SimulatedFrame& frame,
                                    const std::vector<simulation::HazardInView>& hazards) {
  if (!preview_path_.empty()) {
    const double scale = kPreviewWidth / frame.bgr.cols;
    cv::Mat small;
    cv::resize(frame.bgr, small, cv::Size(), scale, scale, cv::INTER_AREA);
    preview_.push_back(small);
  }
  if (!truth_path_.empty() && preview_moments_ % 3 == 1) {
    cv::Mat boxes = frame.bgr.clone();
    simulation::DrawHazards(hazards, boxes);
    truth_.push_back(boxes);
    truth_.push_back(simulation::ColourClasses(frame.classes));
    truth_.push_back(simulation::ColourDepth(frame.depth));
  }
}

void SimulationOutputs::Finish(const simulation::Street& street, double end_s) {
  const std::string hazards =
      simulation::HazardsAsGeoJson(street, setup_.datum, frames_seen_, along_m_);
  if (bag_) bag_->Finish(end_s, hazards);
  if (tum_) tum_->Finish();
  if (yolo_) yolo_->Finish();
  if (!preview_path_.empty()) WriteOutputSheet(preview_path_, preview_, 4);
  if (!truth_path_.empty()) WriteOutputSheet(truth_path_, truth_, 3);
  if (hazards_path_.empty()) return;
  std::ofstream file = simulation::OpenFile(hazards_path_);
  file << hazards;
  simulation::CloseFile(file, hazards_path_);
}

}  // namespace livemap::tools
