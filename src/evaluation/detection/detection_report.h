#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "evaluation/detection/detection_metrics.h"

namespace livemap::evaluation {

/// The figures of one class as they are printed.
struct ClassReport {
  std::string class_name;
  ClassFigures figures;
  std::vector<ClassFigures> sweep;  ///< Empty unless asked for.
  /// The tracker's events instead of single detections, by how sure it must be (`threshold`, a
  /// multiple of the class's). Empty unless asked for.
  std::vector<ClassFigures> tracking = {};
  /// Events of drives that are missed and false reports at the threshold, by CauseName.
  std::map<std::string, std::size_t> missed_by_cause = {};
  std::map<std::string, std::size_t> false_by_cause = {};
};

/// The result of `livemap evaluate detection`.
struct DetectionReport {
  std::string model;
  std::size_t frames = 0;
  /// Wall time of a detection, ms: median and 95th percentile; none where no detector ran.
  std::optional<double> inference_ms_p50;
  std::optional<double> inference_ms_p95;
  std::vector<ClassReport> classes;
};

/// Why nothing was measured: there is neither a label nor a driven road. None where there is one.
std::optional<std::string> WhyNothingMeasured(const DetectionReport& report);

/// docs/reference/measures.md names the keys; figures that are not defined (no events, no drive)
/// are null, and where nothing was measured "reason" says so.
nlohmann::ordered_json ToJson(const DetectionReport& report);

/// A table for people.
std::string ToText(const DetectionReport& report);

}  // namespace livemap::evaluation
