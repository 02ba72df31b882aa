// Visual odometry on 640x480 frames of the simulated room, one thread: a frame that is tracked, a
// frame that becomes a keyframe, OpenCV's RgbdOdometry for the same pair, and the edges alone.
#include <benchmark/benchmark.h>

#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include "odometry/edge/canny_detector.h"
#include "odometry/edge/edge_odometry.h"
#include "run_benchmarks.h"
#include "simulation/room/room_motion.h"
#include "simulation/room/simulated_room.h"
#include "tools/odometry/vo_method.h"

namespace livemap::bench {
namespace {

constexpr int kFrames = 6;

const geo::CameraIntrinsics& Camera() {
  static const geo::CameraIntrinsics camera = simulation::SimulatedCamera().intrinsics;
  return camera;
}

const std::vector<odometry::RgbdFrame>& Frames() {
  static const std::vector<odometry::RgbdFrame> frames = [] {
    cv::setNumThreads(1);
    const simulation::SimulatedRoom room(1);
    std::vector<odometry::RgbdFrame> made;
    for (int i = 0; i < kFrames; ++i) {
      const simulation::SimulatedFrame seen =
          room.Render(simulation::SimulatedCamera(),
                      RoomCameraPose(room.plan(), simulation::RoomMotion::kHand, i / 30.0, 1),
                      static_cast<std::uint32_t>(i), 1.3F, 1, 2);
      odometry::RgbdFrame frame;
      cv::cvtColor(seen.bgr, frame.grey, cv::COLOR_BGR2GRAY);
      seen.depth.convertTo(frame.depth, CV_16U, 5000);
      frame.depth_units_per_m = 5000;
      made.push_back(frame);
    }
    return made;
  }();
  return frames;
}

/// Forwards and backwards through the frames, so that the motion stays that of a hand.
void TrackFrames(benchmark::State& state, tools::VoMethod& method) {
  const std::vector<odometry::RgbdFrame>& frames = Frames();
  std::int64_t stamp_ns = 0;
  int at = 0, step = 1;
  for (auto _ : state) {
    odometry::RgbdFrame frame = frames[static_cast<std::size_t>(at)];
    frame.stamp_ns = stamp_ns += 33'333'333;
    benchmark::DoNotOptimize(method.Track(frame));
    if (at + step < 0 || at + step >= kFrames) step = -step;
    at += step;
  }
}

void BM_TrackFrame(benchmark::State& state) {
  odometry::EdgeOdometry::Config config;
  config.keyframe_motion = 1;
  TrackFrames(state, *tools::MakeVoMethod("edge", config, Camera()));
}

void BM_TrackFrameThatBecomesAKeyframe(benchmark::State& state) {
  odometry::EdgeOdometry::Config config;
  config.keyframe_every = 1;
  TrackFrames(state, *tools::MakeVoMethod("edge", config, Camera()));
}

void BM_OpenCvRgbdOdometry(benchmark::State& state) {
  TrackFrames(state, *tools::MakeVoMethod("rgbd", {}, Camera()));
}

void BM_CannyDetector(benchmark::State& state) {
  odometry::CannyDetector canny;
  const cv::Mat& grey = Frames().front().grey;
  for (auto _ : state) benchmark::DoNotOptimize(canny.ExtractAbove(grey, 40, 100).data);
}

void BM_OpenCvCanny(benchmark::State& state) {
  const cv::Mat& grey = Frames().front().grey;
  cv::Mat edges;
  for (auto _ : state) {
    cv::Canny(grey, edges, 40, 100);
    benchmark::DoNotOptimize(edges.data);
  }
}

BENCHMARK(BM_TrackFrame)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_TrackFrameThatBecomesAKeyframe)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_OpenCvRgbdOdometry)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_CannyDetector)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_OpenCvCanny)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::bench::RunBenchmarks(
      argc, argv, "livemap_edge_vo_benchmark",
      "A 640x480 frame that is tracked, one that becomes a keyframe, "
      "OpenCV's RgbdOdometry, Canny.");
}
