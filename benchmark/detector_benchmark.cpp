// How fast frames become detections: the whole detector with a model, and decoding with suppression
// alone at several numbers of candidates.
//
//     livemap_detector_benchmark [--benchmark_filter=REGEX] [Google Benchmark's flags]
//
// LIVEMAP_MODEL names another manifest than models/hazards-first.yaml, LIVEMAP_THREADS the threads
// of OpenCV (default: all cores).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <random>
#include <string>

#include "base/error.h"
#include "detection/annotation.h"
#include "detection/hazard_detector.h"
#include "detection/yolox_decoder.h"
#include "run_benchmarks.h"
#include "tools/detection_tool_support.h"

namespace livemap {
namespace {

std::string ModelPath() {
  const char* path = std::getenv("LIVEMAP_MODEL");
  return path != nullptr ? path : DefaultModelPath();
}

int Threads() {
  const char* threads = std::getenv("LIVEMAP_THREADS");
  if (threads == nullptr) return 0;
  return static_cast<int>(std::clamp(std::strtol(threads, nullptr, 10), 0L, 256L));
}

/// A frame of noise: what a convolution costs does not depend on the picture.
cv::Mat NoiseFrame(int width, int height) {
  cv::Mat frame(height, width, CV_8UC3);
  cv::RNG random(1);
  random.fill(frame, cv::RNG::UNIFORM, 0, 256);
  return frame;
}

/// A head's output with `candidates` boxes above the threshold, at random cells.
cv::Mat Predictions(const ModelManifest& manifest, int candidates) {
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

ModelManifest CandidateManifest() {
  ModelManifest manifest;
  manifest.classes = {"pothole", "traffic_cone"};
  manifest.input.width = 640;
  manifest.input.height = 400;
  manifest.head.strides = {4, 8, 16};
  manifest.thresholds = {0.4F, 0.4F};
  return manifest;
}

void BM_FrameToDetections(benchmark::State& state) {
  try {
    HazardDetector detector(ReadModelManifest(ModelPath()), Threads());
    const cv::Mat frame =
        NoiseFrame(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
    for ([[maybe_unused]] auto _ : state) benchmark::DoNotOptimize(detector.Detect(frame));
    state.SetLabel(detector.manifest().name + ", " + std::to_string(cv::getNumThreads()) +
                   " threads");
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

void BM_DecodeAndSuppress(benchmark::State& state) {
  const ModelManifest manifest = CandidateManifest();
  const cv::Mat predictions = Predictions(manifest, static_cast<int>(state.range(0)));
  std::size_t kept = 0;
  for ([[maybe_unused]] auto _ : state) {
    const auto found = DecodeYolox(predictions, manifest, 1.0, {640, 400});
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
  const std::vector<HazardDetection> found(static_cast<std::size_t>(state.range(0)),
                                           {"pothole", 0, 0.83F, {300, 200, 80, 60}});
  for ([[maybe_unused]] auto _ : state) {
    cv::Mat copy = frame.clone();
    AnnotateImage(copy, found);
    benchmark::DoNotOptimize(copy.data);
  }
}
BENCHMARK(BM_Annotate)->Arg(1)->Arg(10)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace livemap

int main(int argc, char** argv) {
  return livemap::RunBenchmarks(argc, argv, "livemap_detector_benchmark",
                                "The parts of a frame's detection, from decoding to annotation.");
}
