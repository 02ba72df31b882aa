// What one fix costs the vehicle's localisation once its window is full, at 1, 10 and 20 fixes per
// second with odometry at 100 Hz, and what a question for the fused pose costs.

#include <benchmark/benchmark.h>

#include <cmath>

#include "localization/geo_localizer.h"
#include "run_benchmarks.h"

namespace livemap::bench {
namespace {

constexpr std::int64_t kStepNs = 10'000'000;  // Of the odometry.
constexpr geo::GeoPoint kDatum{48.1, 11.5};

/// A vehicle that drives a wavy road at changing speed.
class Drive {
 public:
  Drive() : localizer_(Config()) {}

  const localization::GeoLocalizer& localizer() const { return localizer_; }
  std::int64_t now_ns() const { return now_ns_; }

  void StepOdometry() {
    now_ns_ += kStepNs;
    const double time_s = static_cast<double>(now_ns_) * 1e-9;
    const double way_m = 0.01 * (12 + 5 * std::sin(0.3 * time_s));
    yaw_rad_ += 0.01 * 0.2 * std::sin(0.2 * time_s);
    place_m_ += way_m * Eigen::Vector2d(std::cos(yaw_rad_), std::sin(yaw_rad_));
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(yaw_rad_, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    pose.translation().head<2>() = place_m_;
    localizer_.AddOdometry(now_ns_, pose);
  }

  geo::Fix Fix() {
    // Errors without a random generator: the same in every run.
    const double turn = 2.4 * static_cast<double>(++fixes_);
    geo::Fix fix;
    fix.stamp_ns = now_ns_;
    fix.position = frame_.ToGeo(place_m_ + 0.7 * Eigen::Vector2d(std::cos(turn), std::sin(turn)));
    fix.covariance_m2 = 0.5 * Eigen::Matrix2d::Identity();
    return fix;
  }

  void AddFix(const geo::Fix& fix) { localizer_.AddFix(fix); }

 private:
  static localization::LocalizerConfig Config() {
    localization::LocalizerConfig config;
    config.datum = kDatum;
    return config;
  }

  const geo::LocalFrame frame_{kDatum};
  localization::GeoLocalizer localizer_;
  std::int64_t now_ns_ = 1'000'000'000;
  std::uint64_t fixes_ = 0;
  Eigen::Vector2d place_m_ = Eigen::Vector2d::Zero();
  double yaw_rad_ = 0;
};

void Fill(Drive& drive, int steps_per_fix) {
  for (int step = 0; step < 4000; ++step) {
    drive.StepOdometry();
    if (step % steps_per_fix == 0) drive.AddFix(drive.Fix());
  }
}

void AddFix(benchmark::State& state) {
  Drive drive;
  const int steps_per_fix = 100 / static_cast<int>(state.range(0));
  Fill(drive, steps_per_fix);
  for (auto _ : state) {
    state.PauseTiming();
    for (int step = 0; step < steps_per_fix; ++step) drive.StepOdometry();
    const geo::Fix fix = drive.Fix();
    state.ResumeTiming();
    drive.AddFix(fix);
  }
  state.counters["used_share"] = static_cast<double>(drive.localizer().counters().fixes_used) /
                                 static_cast<double>(drive.localizer().counters().fixes_used +
                                                     drive.localizer().counters().fixes_refused);
}

void AskFused(benchmark::State& state) {
  Drive drive;
  Fill(drive, 10);
  for (auto _ : state) benchmark::DoNotOptimize(drive.localizer().Fused(drive.now_ns()));
}

BENCHMARK(AddFix)->Arg(1)->Arg(10)->Arg(20)->Unit(benchmark::kMillisecond);
BENCHMARK(AskFused)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::bench::RunBenchmarks(
      argc, argv, "livemap_localization_benchmark",
      "Cost of a fix at 1, 10 and 20 fixes per second, and of asking for the fused pose.");
}
