#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "evaluation/trajectory/trajectory_metrics.h"

namespace livemap::evaluation {

/// "none", "se3", "sim3" or "origin".
std::string AlignmentName(AlignmentKind kind);
/// None for any other name.
std::optional<AlignmentKind> ParseAlignmentKind(const std::string& name);

/// docs/reference/measures.md names the keys; figures that are not defined (no pairs a delta apart,
/// a path under 100 m) are null, `scale` and those over frames are there only when asked for.
/// Relative errors over time are divided by their delta: m/s and deg/s.
nlohmann::ordered_json ToJson(const TrajectoryFigures& figures);

/// The keys of TrajectoryConfig' defaults without figures: all of them null.
nlohmann::ordered_json NullFigures();

/// A table for people.
std::string ToText(const TrajectoryFigures& figures);

}  // namespace livemap::evaluation
