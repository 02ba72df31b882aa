// How fast frames become detections: the whole detector with a model, pools of both engines, and
// decoding with suppression alone at several numbers of candidates. And what masking costs before a
// picture leaves the car.
//
//     livemap_detector_benchmark [--benchmark_filter=REGEX] [Google Benchmark's flags]
//
// LIVEMAP_MODEL names another manifest than models/hazards-base.yaml, LIVEMAP_THREADS the threads
// of the engine (default: all cores), LIVEMAP_ENGINE the engine and LIVEMAP_PRECISION fp32 or int8
// (default: the manifest's).
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <thread>

#include "common/error.h"
#include "perception/detection/annotation.h"
#include "perception/detection/detector_pool.h"
#include "perception/detection/hazard_detector.h"
#include "perception/detection/yolox_decoder.h"
#include "perception/privacy/privacy_mask.h"
#include "run_benchmarks.h"
#include "simulation/render/street_renderer.h"
#include "test/change/simulated_pairs.h"
#include "tools/common/shipped_model.h"

namespace livemap::bench {
namespace {

std::string ModelPath() {
  const char* path = std::getenv("LIVEMAP_MODEL");
  return path != nullptr ? path : tools::ShippedModel(tools::kDefaultDetector);
}

int Threads() {
  const char* threads = std::getenv("LIVEMAP_THREADS");
  if (threads == nullptr) return 0;
  return static_cast<int>(std::clamp(std::strtol(threads, nullptr, 10), 0L, 256L));
}

std::optional<perception::EngineKind> Engine() {
  const char* engine = std::getenv("LIVEMAP_ENGINE");
  return perception::ParseEngineChoice(engine != nullptr ? engine : "auto", "LIVEMAP_ENGINE");
}

/// The model's manifest in the precision that is asked for.
perception::ModelManifest Manifest() {
  perception::ModelManifest manifest = perception::ReadModelManifest(ModelPath());
  const char* asked = std::getenv("LIVEMAP_PRECISION");
  if (asked == nullptr) return manifest;
  for (const auto precision : {perception::Precision::kFp32, perception::Precision::kInt8}) {
    if (perception::NameOf(precision) != asked) continue;
    manifest.precision = precision;
    return manifest;
  }
  throw Error("LIVEMAP_PRECISION is '" + std::string(asked) + "', accepted are fp32 and int8");
}

/// Memory of this process that is in RAM, MiB.
double ResidentMib() {
  std::ifstream file("/proc/self/statm");
  double size = 0;
  double resident = 0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1024 * 1024);
}

/// A frame of noise: what a convolution costs does not depend on the picture.
cv::Mat NoiseFrame(int width, int height) {
  cv::Mat frame(height, width, CV_8UC3);
  cv::RNG random(1);
  random.fill(frame, cv::RNG::UNIFORM, 0, 256);
  return frame;
}

/// A head's output with `candidates` boxes above the threshold, at random cells.
cv::Mat Predictions(const perception::ModelManifest& manifest, int candidates) {
  const int columns = 5 + static_cast<int>(manifest.classes.size());
  const int shape[] = {1, manifest.AnchorCount(), columns};
  cv::Mat predictions(3, shape, CV_32F, cv::Scalar(0));
  std::mt19937 generator(1);
  std::uniform_int_distribution<int> row(0, manifest.AnchorCount() - 1);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int made = 0; made < candidates;) {
    float* values = predictions.ptr<float>(0, row(generator));
    if (values[4] > 0) continue;
    values[0] = unit(generator);
    values[1] = unit(generator);
    values[2] = 3 * unit(generator);
    values[3] = 2 * unit(generator);
    values[4] = 1;
    values[5] = 0.5F + 0.5F * unit(generator);
    ++made;
  }
  return predictions;
}

perception::ModelManifest CandidateManifest() {
  perception::ModelManifest manifest;
  manifest.classes = {"pothole", "traffic_cone"};
  manifest.input.width = 640;
  manifest.input.height = 400;
  manifest.head.strides = {4, 8, 16};
  manifest.thresholds = {0.4F, 0.4F};
  return manifest;
}

void BM_FrameToDetections(benchmark::State& state) {
  try {
    perception::HazardDetector detector(Manifest(), Threads(), Engine());
    const cv::Mat frame =
        NoiseFrame(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
    for ([[maybe_unused]] auto _ : state) benchmark::DoNotOptimize(detector.Detect(frame));
    state.SetLabel(detector.manifest().name + ", " + perception::NameOf(detector.Engine()) + ", " +
                   perception::NameOf(detector.ComputesIn()));
    state.SetItemsProcessed(state.iterations());
  } catch (const Error& error) {
    state.SkipWithError(error.what());
  }
}
BENCHMARK(BM_FrameToDetections)
    ->Args({640, 400})
    ->Args({1280, 720})
    ->Args({1920, 1080})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

/// Frames of 640 x 400 through a pool: engine (0 OpenCV, 1 torch), number of engines, threads each.
void BM_Pool(benchmark::State& state) {
  const perception::EngineKind kind =
      state.range(0) == 0 ? perception::EngineKind::kOpenCv : perception::EngineKind::kTorch;
  const auto threads = static_cast<int>(state.range(2));
  constexpr int kFrames = 16;
  try {
    const perception::ModelManifest manifest = Manifest();
    const double before_mib = ResidentMib();
    using Pool = perception::DetectorPool<cv::Mat, std::vector<perception::HazardDetection>>;
    std::vector<Pool::Engine> engines;
    for (int i = 0; i < state.range(1); ++i) {
      const auto detector = std::make_shared<perception::HazardDetector>(manifest, threads, kind);
      engines.emplace_back(
          [detector](const cv::Mat& frame, std::size_t) { return detector->Detect(frame); });
    }
    Pool pool(std::move(engines), kFrames, [](const Pool::Outcome&) {});
    const cv::Mat frame = NoiseFrame(640, 400);
    for ([[maybe_unused]] auto _ : state) {
      for (int i = 0; i < kFrames; ++i) pool.Push(frame);
      while (pool.counters().waiting > 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
    if (pool.counters().dropped > 0) throw Error("the pool dropped frames");
    state.counters["pool_mib"] = ResidentMib() - before_mib;
    state.SetItemsProcessed(state.iterations() * kFrames);
    state.SetLabel(perception::NameOf(kind));
  } catch (const Error& error) {
    state.SkipWithError(error.what());
  }
}
BENCHMARK(BM_Pool)
    ->ArgNames({"torch", "engines", "threads"})
    ->ArgsProduct({{0, 1}, {1, 2}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

/// Street pictures of 640 x 400: a part of so many pixels' width, 3 to 2, as a report's picture of
/// a hazard shows (imaging::kMinCropPx), or all of them.
void BM_Mask(benchmark::State& state) {
  std::vector<cv::Mat> streets;
  for (const change::SimulatedPair& pair : change::MakePairs({})) {
    cv::resize(pair.after.bgr, streets.emplace_back(), {640, 400}, 0, 0, cv::INTER_AREA);
  }
  const int width = static_cast<int>(state.range(0));
  const int height = std::min(400, width * 2 / 3);
  // On the road before the vehicle, at the image's foot.
  const cv::Rect part(320 - width / 2, 400 - height, width, height);
  perception::PrivacyMask mask({});
  std::uint64_t frame = 0;
  for ([[maybe_unused]] auto _ : state) {
    cv::Mat picture = streets[frame % streets.size()].clone();
    mask.Apply(picture, ++frame, part);
    benchmark::DoNotOptimize(picture.data);
  }
}
BENCHMARK(BM_Mask)->ArgName("width")->Arg(240)->Arg(480)->Arg(640)->Unit(benchmark::kMillisecond);

/// Boxes of one class all over an image.
std::vector<perception::HazardDetection> Candidates(int count) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<perception::HazardDetection> candidates;
  for (int i = 0; i < count; ++i) {
    candidates.push_back({"pothole",
                          0,
                          unit(generator),
                          {600 * unit(generator), 370 * unit(generator), 10 + 30 * unit(generator),
                           5 + 20 * unit(generator)}});
  }
  return candidates;
}

void BM_Suppress(benchmark::State& state) {
  const std::vector<perception::HazardDetection> candidates =
      Candidates(static_cast<int>(state.range(0)));
  for ([[maybe_unused]] auto _ : state) {
    benchmark::DoNotOptimize(perception::SuppressOverlaps(candidates, 0.5F));
  }
}
BENCHMARK(BM_Suppress)->Arg(100)->Arg(1000)->Arg(3000)->Unit(benchmark::kMicrosecond);

/// What suppression costs when every candidate is compared with every kept one.
void BM_SuppressAllWithAll(benchmark::State& state) {
  const std::vector<perception::HazardDetection> candidates =
      Candidates(static_cast<int>(state.range(0)));
  for ([[maybe_unused]] auto _ : state) {
    std::vector<perception::HazardDetection> sorted = candidates;
    std::stable_sort(sorted.begin(), sorted.end(),
                     [](const auto& a, const auto& b) { return a.confidence > b.confidence; });
    std::vector<perception::HazardDetection> kept;
    for (perception::HazardDetection& candidate : sorted) {
      const bool overlaps = std::any_of(kept.begin(), kept.end(), [&](const auto& better) {
        return perception::IntersectionOverUnion(better.box, candidate.box) > 0.5F;
      });
      if (!overlaps) kept.push_back(std::move(candidate));
    }
    benchmark::DoNotOptimize(kept.data());
  }
}
BENCHMARK(BM_SuppressAllWithAll)->Arg(100)->Arg(1000)->Arg(3000)->Unit(benchmark::kMicrosecond);

void BM_DecodeAndSuppress(benchmark::State& state) {
  const perception::ModelManifest manifest = CandidateManifest();
  const cv::Mat predictions = Predictions(manifest, static_cast<int>(state.range(0)));
  std::size_t kept = 0;
  for ([[maybe_unused]] auto _ : state) {
    const auto found = perception::DecodeYolox(predictions, manifest, 1.0, {640, 400});
    kept = found.size();
    benchmark::DoNotOptimize(found.data());
  }
  state.counters["kept"] = static_cast<double>(kept);
  state.SetComplexityN(state.range(0));
}
BENCHMARK(BM_DecodeAndSuppress)
    ->Arg(0)
    ->Arg(10)
    ->Arg(100)
    ->Arg(1000)
    ->Arg(10000)
    ->Unit(benchmark::kMicrosecond);

void BM_Annotate(benchmark::State& state) {
  const cv::Mat frame = NoiseFrame(640, 400);
  const std::vector<perception::HazardDetection> found(static_cast<std::size_t>(state.range(0)),
                                                       {"pothole", 0, 0.83F, {300, 200, 80, 60}});
  for ([[maybe_unused]] auto _ : state) {
    cv::Mat copy = frame.clone();
    perception::AnnotateImage(copy, found);
    benchmark::DoNotOptimize(copy.data);
  }
}
BENCHMARK(BM_Annotate)->Arg(1)->Arg(10)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::bench::RunBenchmarks(
      argc, argv, "livemap_detector_benchmark",
      "The parts of a frame's detection, from decoding to annotation.");
}
