#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/error.h"
#include "drives/text.h"
#include "simulation/dataset.h"
#include "simulation/depth_sensor.h"
#include "simulation/vehicle_motion.h"
#include "tools/command_line.h"
#include "tools/simulation_bag.h"

namespace livemap {
namespace {

constexpr double kDefaultFieldOfViewDeg = 66;
constexpr std::size_t kPreviewPictures = 12;

std::vector<Flag> Flags() {
  return {{"seed", "N", "of the world; the same seed gives the same bytes (1)"},
          {"condition", "NAME", "day, dusk, rain or snow (day)"},
          {"seconds", "S", "length of the drive (20)"},
          {"rate", "HZ", "pictures per second (10)"},
          {"size", "WxH", "of the pictures, pixels (640x480)"},
          {"camera", "FILE", "camera file, see config/cameras; instead of --size"},
          {"distortion", "K1,K2", "radial distortion of the camera (0,0)"},
          {"blur", "N", "pictures averaged over the exposure of 8 ms (0: no motion blur)"},
          {"speed", "MPS", "mean speed, m/s (8)"},
          {"start", "LAT,LON", "of the world's origin, degrees (48.8566,9.0)"},
          {"world", "FILE", "street and hazards, see docs/simulation.md (drawn by the seed)"},
          {"threads", "N", "that render (2)"},
          {"one-ray", "", "one ray per pixel: twice as fast, jagged edges"},
          {"stereo", "M", "baseline of a second eye to the right, for --tum (none)"},
          {"depth", "SENSOR", "exact, kinect or stereo: how --tum measures depth (exact)"},
          {"preview", "FILE.png", "contact sheet of twelve moments"},
          {"truth-preview", "FILE.png", "contact sheet of pictures, boxes, classes and depth"},
          {"tum", "DIR", "TUM RGB-D folder"},
          {"yolo", "DIR", "labelled drive, as livemap evaluate detection reads it"},
          {"video", "FILE.mp4", "MPEG-4 at the pictures' rate"},
          {"bag", "FILE.bag", "rosbag with the topics of a real vehicle and truth"},
          {"hazards", "FILE", "the true hazards that were in view, GeoJSON"}};
}

/// "a<separator>b" as two numbers.
std::pair<double, double> ReadPair(const CommandLine& line, const std::string& flag,
                                   const std::string& otherwise, char separator,
                                   const std::string& accepted) {
  const std::string text = line.Text(flag, otherwise);
  const std::vector<std::string> parts = Split(text, separator);
  if (parts.size() == 2) {
    const auto a = ParseFinite(parts[0]);
    const auto b = ParseFinite(parts[1]);
    if (a && b) return {*a, *b};
  }
  throw Error("--" + flag + " is '" + text + "', accepted is " + accepted);
}

constexpr double kDefaultBaselineM = 0.25;

struct Setup {
  SimulatedCamera camera;
  DepthSensor depth = DepthSensor::kExact;
  double baseline_m = 0;  ///< 0: one eye.
  CameraMounting mounting;
  GeoPoint datum;
};

Setup ReadSetup(const CommandLine& line) {
  Setup setup;
  setup.mounting.height_m = 1.45;
  setup.mounting.pitch_deg = 4;
  CameraIntrinsics& k = setup.camera.intrinsics;
  if (line.Has("camera")) {
    if (line.Has("size")) throw Error("--size and --camera exclude each other");
    const CameraFile file = ReadCameraFile(line.Text("camera", ""));
    k = file.intrinsics;
    setup.mounting = file.mounting;
  } else {
    const std::string accepted = "WxH in whole pixels from 64 to 4096, such as 640x480";
    const auto [width, height] = ReadPair(line, "size", "640x480", 'x', accepted);
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
  const auto [k1, k2] = ReadPair(line, "distortion", "0,0", ',', "K1,K2 from -0.4 to 0.4");
  if (std::abs(k1) > 0.4 || std::abs(k2) > 0.4) {
    throw Error("--distortion is '" + line.Text("distortion", "") +
                "', accepted is K1,K2 from -0.4 to 0.4");
  }
  setup.camera.k1 = k1;
  setup.camera.k2 = k2;
  setup.baseline_m = line.Has("stereo") ? line.Number("stereo", 0, 0.02, 2) : 0;
  const std::optional<DepthSensor> depth = ParseDepthSensor(line.Text("depth", "exact"));
  if (!depth) {
    throw Error("--depth is '" + line.Text("depth", "") + "', accepted are: exact, kinect, stereo");
  }
  setup.depth = *depth;
  for (const char* flag : {"stereo", "depth"}) {
    if (line.Has(flag) && !line.Has("tum")) {
      throw Error("--" + std::string(flag) + " needs --tum, which writes what it makes");
    }
  }
  setup.camera.blur_samples = static_cast<int>(line.Number("blur", 0, 0, 64));
  const std::string place = "LAT,LON in degrees";
  const auto [latitude, longitude] = ReadPair(line, "start", "48.8566,9.0", ',', place);
  setup.datum = {latitude, longitude};
  if (!IsValid(setup.datum)) {
    throw Error("--start is '" + line.Text("start", "") + "', accepted is " + place);
  }
  return setup;
}

Condition ReadCondition(const CommandLine& line) {
  const std::string name = line.Text("condition", "day");
  const std::optional<Condition> condition = ParseCondition(name);
  if (!condition) {
    throw Error("--condition is '" + name + "', accepted are: day, dusk, rain, snow");
  }
  return *condition;
}

void WriteSheet(const std::string& path, const std::vector<cv::Mat>& pictures, int columns) {
  if (!cv::imwrite(path, ContactSheet(pictures, columns))) {
    throw Error("the contact sheet '" + path + "' cannot be written");
  }
}

/// Everything that a run writes; what was not asked for stays null.
class Outputs {
 public:
  Outputs(const CommandLine& line, const Setup& setup, double rate_hz, std::size_t frames)
      : setup_(setup),
        preview_path_(line.Text("preview", "")),
        truth_path_(line.Text("truth-preview", "")),
        every_(std::max<std::size_t>(1, frames / kPreviewPictures)) {
    for (const std::string& path : {preview_path_, truth_path_}) {
      if (!path.empty() && !cv::haveImageWriter(path)) {
        throw Error("the contact sheet '" + path + "' must end in .png or .jpg");
      }
    }
    if (line.Has("tum")) tum_ = std::make_unique<TumWriter>(line.Text("tum", ""), setup.camera);
    if (line.Has("yolo")) yolo_ = std::make_unique<YoloWriter>(line.Text("yolo", ""));
    if (!line.Has("video")) return;
    const std::string path = line.Text("video", "");
    const CameraIntrinsics& k = setup.camera.intrinsics;
    if (!video_.open(path, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), rate_hz,
                     cv::Size(k.width, k.height))) {
      throw Error("the video '" + path + "' cannot be written, accepted is a file .mp4");
    }
  }

  void Add(std::size_t index, double time_s, double along_m, const SimulatedFrame& frame,
           const cv::Mat& right) {
    const std::vector<HazardInView> hazards = FindHazards(frame.instances, LabelLimits());
    for (const HazardInView& hazard : hazards) ++frames_seen_[hazard.instance];
    if (tum_) {
      SimulatedFrame sensed = frame;
      sensed.depth = SenseDepth(frame.depth, setup_.camera.intrinsics, setup_.depth,
                                setup_.baseline_m > 0 ? setup_.baseline_m : kDefaultBaselineM,
                                static_cast<std::uint32_t>(index));
      tum_->Add(time_s, sensed, right);
    }
    if (video_.isOpened()) video_.write(frame.bgr);
    if (bag_) bag_->Add(time_s, frame, hazards);
    if (yolo_) yolo_->Add(along_m, frame, hazards);
    if (index % every_ != every_ / 2) return;
    if (!preview_path_.empty() && preview_.size() < kPreviewPictures) {
      cv::Mat small;
      cv::resize(frame.bgr, small, cv::Size(), 480.0 / frame.bgr.cols, 480.0 / frame.bgr.cols,
                 cv::INTER_AREA);
      preview_.push_back(small);
    }
    if (!truth_path_.empty() && truth_.size() < 12 && index % (3 * every_) == every_ / 2) {
      cv::Mat boxes = frame.bgr.clone();
      DrawHazards(hazards, boxes);
      truth_.push_back(boxes);
      truth_.push_back(ColourClasses(frame.classes));
      truth_.push_back(ColourDepth(frame.depth));
    }
  }

  /// `place` is the vehicle's position at a time.
  void OpenBag(const std::string& path, std::uint64_t seed, std::function<GeoPoint(double)> place) {
    if (setup_.camera.k1 != 0 || setup_.camera.k2 != 0) {
      throw Error("--bag and --distortion exclude each other: a bag's camera has none");
    }
    SimulationBag::Setup setup;
    setup.camera = {"simulated", setup_.camera.intrinsics, setup_.mounting};
    setup.place = std::move(place);
    setup.seed = seed;
    bag_ = OpenSimulationBag(path, setup);
  }

  void Finish(const CommandLine& line, const Street& street, double end_s) {
    if (bag_) bag_->Finish(end_s);
    if (tum_) tum_->Finish();
    if (yolo_) yolo_->Finish();
    if (!preview_path_.empty()) WriteSheet(preview_path_, preview_, 4);
    if (!truth_path_.empty()) WriteSheet(truth_path_, truth_, 3);
    if (line.Has("hazards"))
      WriteHazards(line.Text("hazards", ""), street, setup_.datum, frames_seen_);
  }

  std::size_t hazards() const { return frames_seen_.size(); }

 private:
  Setup setup_;
  cv::VideoWriter video_;
  std::unique_ptr<SimulationBag> bag_;
  std::string preview_path_;
  std::string truth_path_;
  std::size_t every_;
  std::unique_ptr<TumWriter> tum_;
  std::unique_ptr<YoloWriter> yolo_;
  std::vector<cv::Mat> preview_;
  std::vector<cv::Mat> truth_;
  std::map<std::uint32_t, int> frames_seen_;
};

int Run(int argc, char** argv) {
  CommandLine line(
      "livemap_simulate [flags]",
      "Renders a drive through a generated street with the truth about everything in it.", 0,
      Flags());
  if (!line.Parse(argc, argv)) return 0;
  const std::uint64_t seed = line.Seed("seed", 1);
  const Condition condition = ReadCondition(line);
  const double seconds = line.Number("seconds", 20, 0.1, 7200);
  const double rate_hz = line.Number("rate", 10, 0.1, 100);
  const double speed_mps = line.Number("speed", 8, 0.5, 30);
  const Setup setup = ReadSetup(line);
  RenderOptions options;
  options.threads = static_cast<int>(line.Number("threads", 2, 1, 64));
  options.smooth_edges = !line.Has("one-ray");
  const WorldDescription world =
      line.Has("world") ? ReadWorldFile(line.Text("world", "")) : WorldDescription();

  const Street street(world, seed, seconds * speed_mps * 1.1 + 300, condition != Condition::kSnow);
  const VehicleMotion motion(street, speed_mps, 0);
  StreetRenderer renderer(street, setup.camera, MakeLighting(condition, seed), options);
  const auto frames =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::floor(seconds * rate_hz)));
  Outputs outputs(line, setup, rate_hz, frames);
  if (line.Has("bag")) {
    const LocalFrame map(setup.datum);
    outputs.OpenBag(line.Text("bag", ""), seed, [&motion, map](double time_s) {
      return map.ToGeo(motion.WorldFromBase(time_s).translation().head<2>());
    });
  }
  Progress progress("frame", frames);
  const auto begin = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < frames; ++i) {
    const double time_s = static_cast<double>(i) / rate_hz;
    CameraMotion camera;
    const Eigen::Isometry3d base_from_optical = setup.mounting.BaseFromOptical();
    camera.world_from_optical = motion.WorldFromBase(time_s) * base_from_optical;
    camera.world_from_optical_end =
        motion.WorldFromBase(time_s + setup.camera.exposure_s) * base_from_optical;
    camera.along_m = motion.AlongM(time_s);
    const auto number = static_cast<std::uint32_t>(i);
    const SimulatedFrame frame = renderer.Render(camera, number);
    cv::Mat right;
    if (setup.baseline_m > 0) {
      const Eigen::Translation3d beside(setup.baseline_m, 0, 0);
      camera.world_from_optical = camera.world_from_optical * beside;
      camera.world_from_optical_end = camera.world_from_optical_end * beside;
      // The eyes' sensors have noise of their own.
      right = renderer.Render(camera, number + 0x40000000U).bgr;
    }
    outputs.Add(i, time_s, camera.along_m, frame, right);
    progress.At(i + 1);
  }
  outputs.Finish(line, street, static_cast<double>(frames) / rate_hz);
  const double took_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("%zu frames, %.1f s of driving, %zu hazards seen, %.1f frames/s\n", frames, seconds,
              outputs.hazards(), static_cast<double>(frames) / took_s);
  return 0;
}

}  // namespace
}  // namespace livemap

int main(int argc, char** argv) {
  return livemap::RunProgram("livemap_simulate", argc, argv, livemap::Run);
}
