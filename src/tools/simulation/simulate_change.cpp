#include "tools/simulation/simulate_change.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "common/error.h"
#include "simulation/datasets/change_dataset_writer.h"
#include "simulation/motion/pass_drive.h"
#include "simulation/objects/counter_random.h"
#include "tools/common/contact_sheet.h"
#include "tools/common/progress.h"
#include "tools/simulation/simulation_flags.h"
#include "tools/simulation/simulation_outputs.h"
#include "tools/simulation/simulation_setup.h"

namespace livemap::tools {
namespace {

constexpr std::uint64_t kSecondLight = 43;
/// The second pass's pictures have sensor noise of their own.
constexpr std::uint32_t kSecondNoise = 0x20000000U;
constexpr double kFirstRateHz = 10;
constexpr std::size_t kPreviewRows = 6;
constexpr double kDiagramWidth = 400;

struct ChangeRun {
  std::uint64_t seed = 1;
  simulation::Condition first = simulation::Condition::kDay;
  simulation::Condition second = simulation::Condition::kDay;
  double changes = 0.25;
  double speed_mps = 8;
  double rate_hz = 10;
  double seconds = 20;
  std::size_t pairs = 1;
  double length_m = 0;  ///< Of the road that both passes may need.
  simulation::WorldDescription world;
  SimulationSetup setup;
  simulation::RenderConfig options;
  std::string preview;
};

ChangeRun ReadChangeRun(const CommandLine& line) {
  for (const char* flag :
       {"tum", "yolo", "video", "bag", "hazards", "truth-preview", "stops", "stereo", "knock"}) {
    if (line.Has(flag)) {
      throw Error("--" + std::string(flag) + " and --change exclude each other");
    }
  }
  ChangeRun run;
  run.seed = line.Seed("seed", 1);
  run.first = ReadCondition(line, "first-condition", "day");
  run.second = ReadCondition(line, "condition", "day");
  run.changes = line.Number("changes", 0.25, 0, 1);
  run.speed_mps = line.Number("speed", 8, 0.5, 30);
  run.rate_hz = line.Number("rate", 10, 0.1, 100);
  run.seconds = line.Number("seconds", 20, 0.1, 7200);
  run.pairs =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::floor(run.seconds * run.rate_hz)));
  if (run.pairs > simulation::ChangeDatasetWriter::kMaxPairs) {
    throw Error("--seconds times --rate is " + std::to_string(run.pairs) +
                " pairs, accepted are up to " +
                std::to_string(simulation::ChangeDatasetWriter::kMaxPairs));
  }
  run.length_m = run.seconds * run.speed_mps * 1.4 + 320;
  run.setup = ReadSimulationSetup(line);
  run.options.threads = static_cast<int>(line.Number("threads", 2, 1, 64));
  run.options.smooth_edges = !line.Has("one-ray");
  run.world = ReadSimulatedWorld(line, run.setup);
  run.preview = ReadSheetPath(line, "preview");
  return run;
}

simulation::Street MakeChangedStreet(const ChangeRun& run, simulation::StreetPass::Which which) {
  const simulation::Condition condition =
      which == simulation::StreetPass::Which::kFirst ? run.first : run.second;
  return {run.world,
          run.seed,
          run.length_m,
          condition != simulation::Condition::kSnow,
          {which, run.changes}};
}

/// The first pass, of which only the pictures are rendered that a pair wants.
class FirstChangePass {
 public:
  explicit FirstChangePass(const ChangeRun& run)
      : street_(MakeChangedStreet(run, simulation::StreetPass::Which::kFirst)),
        drive_(street_, Manner(run), run.setup.mounting, run.setup.camera.exposure_s),
        renderer_(street_, run.setup.camera, simulation::MakeLighting(run.first, run.seed),
                  run.options) {}

  const simulation::PassPicture& Near(double along_m) {
    const std::size_t frame = drive_.Nearest(along_m);
    if (frame != rendered_) {
      const simulation::CameraExposure camera = drive_.Camera(frame);
      picture_ = {renderer_.Render(camera, static_cast<std::uint32_t>(frame)), camera.along_m};
      rendered_ = frame;
    }
    return picture_;
  }

 private:
  static simulation::PassManner Manner(const ChangeRun& run) {
    simulation::PassManner manner;
    manner.speed_mps = run.speed_mps;
    manner.rate_hz = kFirstRateHz;
    // The second may be a fifth faster.
    manner.seconds = 1.3 * run.seconds + 10;
    return manner;
  }

  simulation::Street street_;
  simulation::PassDrive drive_;
  simulation::StreetRenderer renderer_;
  std::optional<std::size_t> rendered_;
  simulation::PassPicture picture_;
};

void AddChangeToSheet(const simulation::PassPicture& first, const simulation::PassPicture& second,
                      const cv::Mat& mask, std::vector<cv::Mat>& sheet) {
  const double scale = kDiagramWidth / second.frame.bgr.cols;
  for (const cv::Mat& picture :
       {first.frame.bgr, second.frame.bgr, simulation::OverlayChanges(second.frame.bgr, mask)}) {
    cv::Mat small;
    cv::resize(picture, small, cv::Size(), scale, scale, cv::INTER_AREA);
    sheet.push_back(small);
  }
}

}  // namespace

std::vector<Flag> ChangeFlags() {
  return {{"change", "DIR", "two passes of the street and what changed, as VL-CMU-CD"},
          {"changes", "SHARE", "of the objects that may change, 0 to 1, for --change (0.25)"},
          {"first-condition", "NAME", "of --change's first pass; --condition: the second's (day)"}};
}

void RefuseChangeFlags(const CommandLine& line) {
  for (const Flag& flag : ChangeFlags()) {
    if (flag.name != "change" && line.Has(flag.name)) {
      throw Error("--" + flag.name + " needs --change, which writes what it makes");
    }
  }
}

int SimulateChange(const CommandLine& line) {
  const ChangeRun run = ReadChangeRun(line);
  FirstChangePass first(run);
  const simulation::Street street = MakeChangedStreet(run, simulation::StreetPass::Which::kSecond);
  const simulation::PassDrive drive(
      street, simulation::DrawSecondManner(run.seed, run.speed_mps, run.rate_hz, run.seconds),
      run.setup.mounting, run.setup.camera.exposure_s);
  CheckRouteHolds(line, street.line().length_m(), drive.AlongM(run.pairs));
  const std::uint64_t light = simulation::CounterRandom(run.seed, kSecondLight).Bits();
  simulation::StreetRenderer renderer(street, run.setup.camera,
                                      simulation::MakeLighting(run.second, light), run.options);
  simulation::ChangeTruth truth(run.world, run.seed, run.length_m,
                                run.second != simulation::Condition::kSnow, run.changes,
                                run.setup.camera, run.options.threads);
  simulation::ChangeDatasetWriter writer(line.Text("change", ""), run.setup.camera);
  std::vector<cv::Mat> sheet;
  const std::size_t every = std::max<std::size_t>(1, run.pairs / kPreviewRows);
  Progress progress("pair", run.pairs);
  const auto begin = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < run.pairs; ++i) {
    const simulation::CameraExposure camera = drive.Camera(i);
    const auto number = static_cast<std::uint32_t>(i) + kSecondNoise;
    const simulation::PassPicture second{renderer.Render(camera, number), camera.along_m};
    const simulation::PassPicture& near = first.Near(camera.along_m);
    const simulation::ChangeView view = truth.Look(camera);
    writer.Add(near, second, view);
    const bool shown = i % every == every / 2 && sheet.size() < 3 * kPreviewRows;
    if (!run.preview.empty() && shown) AddChangeToSheet(near, second, view.mask, sheet);
    progress.At(i + 1);
  }
  writer.Finish(street, run.setup.datum, truth.changes());
  if (!run.preview.empty() && !cv::imwrite(run.preview, ContactSheet(sheet, 3))) {
    throw Error("the contact sheet '" + run.preview + "' cannot be written");
  }
  const double took_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("%zu pairs, %zu changes within sight, %zu seen, %.1f pairs/s\n", writer.pairs(),
              truth.changes().size(), writer.seen(), static_cast<double>(run.pairs) / took_s);
  return 0;
}

}  // namespace livemap::tools
