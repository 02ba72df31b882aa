// Trajectory files and the figures made of them: the input is a true trajectory, a NUL and an
// estimate (without it the truth again), compared with every alignment.
#include <cmath>
#include <cstdint>
#include <string>

#include "common/error.h"
#include "evaluation/trajectory/trajectory.h"
#include "evaluation/trajectory/trajectory_report.h"

namespace {

void Evaluate(const std::vector<livemap::datasets::StampedPose>& truth,
              const std::vector<livemap::datasets::StampedPose>& estimate,
              livemap::evaluation::AlignmentKind kind) {
  livemap::evaluation::TrajectoryConfig options;
  options.alignment = kind;
  options.rpe_delta_frames = 2;
  try {
    const livemap::evaluation::TrajectoryFigures figures =
        livemap::evaluation::EvaluateTrajectory(truth, estimate, options);
    if (!std::isfinite(figures.ate_m.rmse) || !std::isfinite(figures.rpe_m.rmse)) __builtin_trap();
    livemap::evaluation::ToJson(figures).dump();
    livemap::evaluation::ToText(figures);
  } catch (const livemap::Error&) {
    // Too few pairs, no scale.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t divider = text.find('\0');
  try {
    const auto truth = livemap::evaluation::ParseTrajectory(text.substr(0, divider), "truth", 10);
    const auto estimate =
        divider == std::string::npos
            ? truth
            : livemap::evaluation::ParseTrajectory(text.substr(divider + 1), "estimate", 10);
    for (const auto kind :
         {livemap::evaluation::AlignmentKind::kNone, livemap::evaluation::AlignmentKind::kSe3,
          livemap::evaluation::AlignmentKind::kSim3, livemap::evaluation::AlignmentKind::kOrigin}) {
      Evaluate(truth, estimate, kind);
    }
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the reader promises.
  }
  return 0;
}
