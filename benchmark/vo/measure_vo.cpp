// livemap_measure_vo: what ./livemap bench vo makes its page of, one measurement of one sequence.

#include <iostream>
#include <opencv2/core/utility.hpp>

#include "common/error.h"
#include "measurements.h"
#include "tools/common/command_line.h"

namespace livemap::bench {
namespace {

nlohmann::ordered_json Measure(const std::string& what, const Recording& recording,
                               const tools::CommandLine& line) {
  if (what == "tables") return MeasureTables(recording, line.Text("edge-model", ""));
  if (what == "ablation") {
    return MeasureAblation(recording, static_cast<std::size_t>(line.Number("runs", 5, 1, 1000)));
  }
  if (what == "pixels") return MeasurePixels(recording);
  if (what == "world") {
    return MeasureWorld(recording, static_cast<std::size_t>(line.Whole("step", 1, 1, 1000)));
  }
  BasinOptions options;
  options.pairs = static_cast<std::size_t>(line.Number("pairs", 30, 1, 100000));
  return MeasureBasin(recording, options);
}

int Run(int argc, char** argv) {
  tools::CommandLine line(
      "livemap_measure_vo [FLAGS] tables|ablation|pixels|basin|world SEQ",
      "Measures visual odometry on an RGB-D sequence in TUM layout, one thread, and "
      "prints one line of JSON.\n"
      "  tables    every kind of edges and rule for keyframes beside OpenCV's methods\n"
      "  ablation  shares of the edge pixels against as many random pixels\n"
      "  pixels    time against the number of pixels\n"
      "  basin     how wrong the first guess may be\n"
      "  world     errors of the default and of the covariance it states",
      2,
      {{"camera", "FILE",
        "the camera, laid out as camera.yaml, default the "
        "sequence's own or TUM's"},
       {"frames", "N", "the first N frames only, default all"},
       {"edge-model", "FILE", "tables: OpenCV's model of structured edges (left out)"},
       {"runs", "N", "ablation: draws of each share, default 5"},
       {"pairs", "N", "basin: pairs of neighbouring frames, default 30"},
       {"step", "N", "world: every Nth frame only, default 1"}});
  if (!line.Parse(argc, argv)) return 0;
  const std::string& what = line.Positional(0);
  if (what != "tables" && what != "ablation" && what != "pixels" && what != "basin" &&
      what != "world") {
    throw Error("'" + what +
                "' is no measurement; accepted are tables, ablation, pixels, basin, world");
  }
  cv::setNumThreads(1);
  const Recording recording(line.Positional(1), line.Text("camera", ""),
                            static_cast<std::size_t>(line.Number("frames", 1e6, 2, 1e6)));
  std::cout << Measure(what, recording, line).dump() << "\n";
  return 0;
}

}  // namespace
}  // namespace livemap::bench

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_measure_vo", argc, argv, livemap::bench::Run);
}
