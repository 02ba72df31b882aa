// Trajectory files and the figures made of them: the input is a true trajectory, a NUL and an
// estimate (without it the truth again), compared with every alignment.
#include <cmath>
#include <cstdint>
#include <string>

#include "common/error.h"
#include "evaluation/trajectory/trajectory.h"
#include "evaluation/trajectory/trajectory_report.h"

namespace {

void Evaluate(const std::vector<livemap::StampedPose>& truth,
              const std::vector<livemap::StampedPose>& estimate, livemap::AlignmentKind kind) {
  livemap::TrajectoryConfig options;
  options.alignment = kind;
  options.rpe_delta_frames = 2;
  try {
    const livemap::TrajectoryFigures figures =
        livemap::EvaluateTrajectory(truth, estimate, options);
    if (!std::isfinite(figures.ate_m.rmse) || !std::isfinite(figures.rpe_m.rmse)) __builtin_trap();
    livemap::ToJson(figures).dump();
    livemap::ToText(figures);
  } catch (const livemap::Error&) {
    // Too few pairs, no scale.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t divider = text.find('\0');
  try {
    const auto truth = livemap::ParseTrajectory(text.substr(0, divider), "truth", 10);
    const auto estimate = divider == std::string::npos
                              ? truth
                              : livemap::ParseTrajectory(text.substr(divider + 1), "estimate", 10);
    for (const auto kind : {livemap::AlignmentKind::kNone, livemap::AlignmentKind::kSe3,
                            livemap::AlignmentKind::kSim3, livemap::AlignmentKind::kOrigin}) {
      Evaluate(truth, estimate, kind);
    }
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the reader promises.
  }
  return 0;
}
