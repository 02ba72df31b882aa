// What it costs to find the pictures of a place: the 15 nearest of 1e3 to 1e6 remembered frames,
// and the best of them by their features. And what it costs to compare a pair of pictures.

#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "change/memory/place_index.h"
#include "change/methods/change_network.h"
#include "change/registration/edge_registration.h"
#include "change/registration/image_features.h"
#include "change/registration/registration.h"
#include "run_benchmarks.h"
#include "simulation/render/street_renderer.h"
#include "test/change/simulated_pairs.h"
#include "tools/common/shipped_model.h"

namespace livemap::bench {
namespace {

constexpr geo::GeoPoint kTown{40.4433, -79.9436};
constexpr double kBlockM = 100;     // Between streets that run north, and those that run east.
constexpr double kFrameEveryM = 2;  // Of each drive.
constexpr int kDrives = 4;          // Down every street, two each way.
constexpr std::size_t kQuestions = 1 << 14;
constexpr double kQuarterTurn = 1.5707963267948966;

/// A town's streets, driven down and up, and questions from on its streets.
struct Town {
  explicit Town(std::int64_t frames) : index(change::PlaceReach()) {
    const geo::LocalFrame local(kTown);
    std::mt19937_64 random(42);
    const double share = static_cast<double>(frames) / kDrives;
    // A square of `side` blocks has 2 side (side + 1) sides of blocks.
    const double per_side = kBlockM / kFrameEveryM;
    const double side = std::max(1.0, std::sqrt(share / per_side / 2));
    std::normal_distribution<double> beside(0, 1);
    std::uniform_real_distribution<double> along(0, side * kBlockM);
    const auto streets = static_cast<std::uint64_t>(std::ceil(side));
    const auto draw = [&](double& heading_rad) {
      const double street_m = kBlockM * static_cast<double>(random() % streets);
      const bool north = random() % 2 == 0;
      heading_rad = (north ? 0 : kQuarterTurn) + (random() % 2 == 0 ? 0 : 2 * kQuarterTurn);
      const Eigen::Vector2d place(along(random), street_m + beside(random));
      return local.ToGeo(north ? Eigen::Vector2d(place.y(), place.x()) : place);
    };
    for (std::int64_t i = 0; i < frames; ++i) {
      double heading_rad = 0;
      const geo::GeoPoint place = draw(heading_rad);
      index.Insert(i, place, heading_rad, std::to_string(random() % kDrives));
    }
    for (std::size_t i = 0; i < kQuestions; ++i) {
      change::PlaceQuery query;
      query.position = draw(query.heading_rad);
      query.exclude_drive = "today";
      questions.push_back(query);
    }
  }

  change::PlaceIndex index;
  std::vector<change::PlaceQuery> questions;
};

Town& TownOf(std::int64_t frames) {
  static std::map<std::int64_t, std::unique_ptr<Town>> towns;
  auto& town = towns[frames];
  if (town == nullptr) town = std::make_unique<Town>(frames);
  return *town;
}

void NearestFifteen(benchmark::State& state) {
  Town& town = TownOf(state.range(0));
  std::size_t next = 0;
  std::size_t found = 0;
  for (auto _ : state) found += town.index.Nearest(town.questions[next++ % kQuestions]).size();
  state.counters["found"] = static_cast<double>(found) / static_cast<double>(state.iterations());
}

change::ImageFeatures RandomFeatures(std::uint64_t seed, int count) {
  change::ImageFeatures features;
  cv::RNG random(seed);
  features.descriptors = cv::Mat(count, 128, CV_8UC1);
  random.fill(features.descriptors, cv::RNG::UNIFORM, 0, 100);
  for (int i = 0; i < count; ++i) features.points.emplace_back(0.0F, 0.0F);
  return features;
}

/// Of one picture with 15 others, all features at hand.
void MatchFifteen(benchmark::State& state) {
  const int count = static_cast<int>(state.range(0));
  const change::ImageFeatures now = RandomFeatures(1, count);
  std::vector<change::ImageFeatures> others;
  for (std::uint64_t i = 0; i < 15; ++i) others.push_back(RandomFeatures(2 + i, count));
  for (auto _ : state) {
    for (const change::ImageFeatures& other : others) {
      benchmark::DoNotOptimize(change::MatchFeatures(other, now, 0.8).size());
    }
  }
}

constexpr int kThreads = 2;

/// Pictures of one street on two days, of the network's size.
struct SmallPair {
  cv::Mat before;
  cv::Mat after;
};

const std::vector<SmallPair>& SmallPairs() {
  static const std::vector<SmallPair> pairs = [] {
    std::vector<SmallPair> made;
    for (const change::SimulatedPair& pair : change::MakePairs({})) {
      SmallPair small;
      cv::resize(pair.before.bgr, small.before, cv::Size(320, 256), 0, 0, cv::INTER_AREA);
      cv::resize(pair.after.bgr, small.after, cv::Size(320, 256), 0, 0, cv::INTER_AREA);
      made.push_back(small);
    }
    return made;
  }();
  return pairs;
}

/// Of all of them in turn; rendered before a clock runs.
class PairsInTurn {
 public:
  PairsInTurn() : pairs_(SmallPairs()) {}
  const SmallPair& Next() { return pairs_[next_++ % pairs_.size()]; }

 private:
  const std::vector<SmallPair>& pairs_;
  std::size_t next_ = 0;
};

change::WarpedPicture RegisteredByEdges(const SmallPair& pair) {
  const change::Registration found =
      change::RegisterByEdges(pair.before, pair.after, change::RegistrationConfig());
  return change::WarpByHomography(pair.before, found.after_from_before);
}

void RegisterByItsEdges(benchmark::State& state) {
  cv::setNumThreads(kThreads);
  PairsInTurn pairs;
  for (auto _ : state) benchmark::DoNotOptimize(RegisteredByEdges(pairs.Next()).picture.data);
}

void RegisterByItsFeatures(benchmark::State& state) {
  cv::setNumThreads(kThreads);
  PairsInTurn pairs;
  for (auto _ : state) {
    const SmallPair& pair = pairs.Next();
    const change::Registration found = change::RegisterByHomography(
        {pair.before.size(), change::ExtractFeatures(pair.before)},
        {pair.after.size(), change::ExtractFeatures(pair.after)}, change::RegistrationConfig(), 1);
    benchmark::DoNotOptimize(
        change::WarpByHomography(pair.before, found.after_from_before).picture.data);
  }
}

/// The network that ships; with its registration when the argument is 1.
void ComparePair(benchmark::State& state) {
  const auto network = change::MakeChangeNetwork(tools::ShippedModel("change-small"), kThreads);
  const cv::Mat everywhere(256, 320, CV_8UC1, cv::Scalar(255));
  PairsInTurn pairs;
  for (auto _ : state) {
    const SmallPair& pair = pairs.Next();
    const change::WarpedPicture warped = state.range(0) == 1
                                             ? RegisteredByEdges(pair)
                                             : change::WarpedPicture{pair.before, everywhere};
    const auto found = network->Run({warped.picture, pair.after, warped.valid});
    benchmark::DoNotOptimize(found.of_class[0].data);
  }
  state.counters["pairs/s"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

BENCHMARK(RegisterByItsEdges)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(RegisterByItsFeatures)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(ComparePair)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(NearestFifteen)->RangeMultiplier(10)->Range(1000, 1000000);
BENCHMARK(MatchFifteen)->Arg(300)->Arg(600)->Unit(benchmark::kMillisecond);

/// The usual table, and below it how the search's cost grows from its first to its last line.
class GrowthReporter : public benchmark::ConsoleReporter {
 public:
  GrowthReporter() : ConsoleReporter(isatty(STDOUT_FILENO) != 0 ? OO_ColorTabular : OO_Tabular) {}

  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_name.function_name == "NearestFifteen")
        costs_.push_back(run.GetAdjustedCPUTime());
    }
  }

  void PrintGrowth() const {
    if (costs_.size() < 2) return;
    std::printf("growth NearestFifteen from 1e3 to 1e6 frames: %.2f times\n",
                costs_.back() / costs_.front());
  }

 private:
  std::vector<double> costs_;
};

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  livemap::bench::GrowthReporter reporter;
  const int status = livemap::bench::RunBenchmarks(
      argc, argv, "livemap_change_benchmark",
      "Cost of comparing a pair of 320x256 on two threads, with and without its registration; of\n"
      "finding the pictures of a place among 1e3 to 1e6, and of matching 15 of them.",
      &reporter);
  reporter.PrintGrowth();
  return status;
}
