// What one question to the vehicle's duplicate filter costs, at 1e3 to 1e6 known hazards, and how
// the cost grows with their number.

#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "protocol/duplicate_filter.h"
#include "run_benchmarks.h"

namespace livemap::bench {
namespace {

constexpr geo::GeoPoint kZone{40.4433, -79.9436};
constexpr double kSpacingM = 30.0;  // One hazard per 30 m x 30 m: a dense city.
constexpr std::size_t kQuestions = 1 << 16;

Uuid Id(std::uint64_t number) {
  Uuid id;
  for (std::size_t i = 0; i < 8; ++i) id.bytes[i] = static_cast<std::uint8_t>(number >> (8 * i));
  return id;
}

/// A zone full of hazards and questions about it, made once per number of hazards.
struct World {
  explicit World(std::int64_t hazards) : filter{protocol::HazardCatalogue()} {
    const geo::LocalFrame frame(kZone);
    std::mt19937_64 random(42);
    const double side_m = kSpacingM * std::sqrt(static_cast<double>(hazards));
    std::uniform_real_distribution<double> place(-side_m / 2, side_m / 2);
    std::uniform_real_distribution<double> nearby(-2.0, 2.0);
    std::vector<Eigen::Vector2d> known_m;
    for (std::int64_t i = 0; i < hazards; ++i) {
      known_m.emplace_back(place(random), place(random));
      filter.Put(Id(static_cast<std::uint64_t>(i)), "pothole", frame.ToGeo(known_m.back()));
    }
    for (std::size_t i = 0; i < kQuestions; ++i) {
      anywhere.push_back(frame.ToGeo({place(random), place(random)}));
      const Eigen::Vector2d& known = known_m[random() % known_m.size()];
      at_known.push_back(frame.ToGeo(known + Eigen::Vector2d(nearby(random), nearby(random))));
    }
  }

  protocol::DuplicateFilter filter;
  std::vector<geo::GeoPoint> anywhere;  // Mostly new.
  std::vector<geo::GeoPoint> at_known;  // All known.
};

World& WorldOf(std::int64_t hazards) {
  static std::map<std::int64_t, std::unique_ptr<World>> worlds;
  auto& world = worlds[hazards];
  if (world == nullptr) world = std::make_unique<World>(hazards);
  return *world;
}

void Ask(benchmark::State& state, std::vector<geo::GeoPoint> World::*questions) {
  World& world = WorldOf(state.range(0));
  std::size_t next = 0;
  std::size_t known = 0;
  for (auto _ : state) {
    const geo::GeoPoint& position = (world.*questions)[next++ % kQuestions];
    known += world.filter.Find("pothole", position) ? 1 : 0;
  }
  state.counters["known_share"] =
      static_cast<double>(known) / static_cast<double>(state.iterations());
}

void AskAnywhere(benchmark::State& state) { Ask(state, &World::anywhere); }
void AskAtKnown(benchmark::State& state) { Ask(state, &World::at_known); }

void LearnAndForget(benchmark::State& state) {
  World& world = WorldOf(state.range(0));
  const Uuid id = Id(~std::uint64_t{0});
  std::size_t next = 0;
  for (auto _ : state) {
    world.filter.Put(id, "pothole", world.anywhere[next++ % kQuestions]);
    world.filter.Remove(id);
  }
}

BENCHMARK(AskAnywhere)->RangeMultiplier(10)->Range(1000, 1000000);
BENCHMARK(AskAtKnown)->RangeMultiplier(10)->Range(1000, 1000000);
BENCHMARK(LearnAndForget)->RangeMultiplier(10)->Range(1000, 1000000);

/// The usual table, and below it how each cost grows from its first to its last line.
class GrowthReporter : public benchmark::ConsoleReporter {
 public:
  GrowthReporter() : ConsoleReporter(isatty(STDOUT_FILENO) != 0 ? OO_ColorTabular : OO_Tabular) {}

  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      costs_[run.run_name.function_name].push_back(run.GetAdjustedCPUTime());
    }
  }

  void PrintGrowth() const {
    for (const auto& [name, costs] : costs_) {
      std::printf("growth %s from 1e3 to 1e6 known hazards: %.2f times\n", name.c_str(),
                  costs.back() / costs.front());
    }
  }

 private:
  std::map<std::string, std::vector<double>> costs_;
};

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  livemap::bench::GrowthReporter reporter;
  const int status = livemap::bench::RunBenchmarks(
      argc, argv, "livemap_duplicate_filter_benchmark",
      "Cost of a question to the vehicle's duplicate filter at 1e3 to 1e6 known hazards.",
      &reporter);
  reporter.PrintGrowth();
  return status;
}
