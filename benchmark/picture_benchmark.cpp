// What a picture costs the zone: made anew for people, and as a thumbnail for drivers.
#include <benchmark/benchmark.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "run_benchmarks.h"
#include "zone/pictures/picture_recoder.h"

namespace livemap::bench {
namespace {

/// Blurred noise: about as hard to code as a street.
std::vector<std::uint8_t> MakePicture(int width, int height, const char* extension) {
  cv::Mat image(height, width, CV_8UC3);
  cv::RNG(3).fill(image, cv::RNG::NORMAL, 120, 120);
  cv::GaussianBlur(image, image, {0, 0}, 2.0);
  std::vector<std::uint8_t> file;
  cv::imencode(extension, image, file);
  return file;
}

const std::vector<std::uint8_t>& Picture(benchmark::State& state) {
  static std::vector<std::uint8_t> file;
  const char* extension = state.range(2) == 0 ? ".jpg" : ".png";
  file = MakePicture(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)), extension);
  state.counters["file_bytes"] = static_cast<double>(file.size());
  state.SetLabel(extension);
  return file;
}

void Recode(benchmark::State& state) {
  const std::vector<std::uint8_t>& file = Picture(state);
  for (auto _ : state) benchmark::DoNotOptimize(zone::RecodePicture(file));
}

void Thumbnail(benchmark::State& state) {
  const std::vector<std::uint8_t>& file = Picture(state);
  const auto width = static_cast<std::uint32_t>(state.range(0));
  const auto height = static_cast<std::uint32_t>(state.range(1));
  const auto x = static_cast<float>(width);
  const auto y = static_cast<float>(height);
  const imaging::Box box{x * 0.4F, y * 0.5F, x * 0.55F, y * 0.65F};
  for (auto _ : state)
    benchmark::DoNotOptimize(zone::SmallPicture(file, box, {0, 0, width, height}));
}

void Sizes(benchmark::internal::Benchmark* benchmark) {
  benchmark->Unit(benchmark::kMillisecond);
  benchmark->Args({640, 480, 0})->Args({1280, 720, 0})->Args({3840, 2160, 0})->Args({640, 480, 1});
}
BENCHMARK(Recode)->Apply(Sizes);
BENCHMARK(Thumbnail)->Apply(Sizes);

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  return livemap::bench::RunBenchmarks(
      argc, argv, "livemap_picture_benchmark",
      "What it costs to encode a vehicle's picture anew for people, and "
      "to make a thumbnail of it for drivers.");
}
