#include "evaluation/detection/detection_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace livemap::evaluation {
namespace {

nlohmann::ordered_json OrNull(const std::optional<double>& value) {
  if (!value) return nullptr;
  return *value;
}

/// Figures that depend on the threshold.
void AddThresholdFigures(const ClassFigures& figures, nlohmann::ordered_json& json) {
  json["precision"] = OrNull(figures.precision);
  json["recall"] = OrNull(figures.recall);
  json["events"] = figures.events;
  json["event_recall"] = OrNull(figures.event_recall);
  json["event_recall_iou30"] = OrNull(figures.event_recall_iou30);
  json["false_per_km"] = OrNull(figures.false_per_km);
  json["false_reports"] = figures.false_reports;
  json["false_detections"] = figures.false_detections;
}

nlohmann::ordered_json ClassJson(const ClassReport& report) {
  const ClassFigures& figures = report.figures;
  nlohmann::ordered_json json;
  json["labels"] = figures.labels;
  json["ap50"] = OrNull(figures.ap50);
  AddThresholdFigures(figures, json);
  json["ap30"] = OrNull(figures.ap30);
  // The detector compares in single precision: 0.4 there is 0.4000000059604645.
  json["threshold"] = std::round(figures.threshold * 1e6) / 1e6;
  json["n"] = figures.frames;
  json["km"] = figures.km;
  json["missed_by_cause"] = report.missed_by_cause;
  json["false_by_cause"] = report.false_by_cause;
  for (const ClassFigures& at : report.sweep) {
    nlohmann::ordered_json entry;
    entry["threshold"] = std::round(at.threshold * 1e6) / 1e6;
    AddThresholdFigures(at, entry);
    json["sweep"].push_back(entry);
  }
  for (const ClassFigures& at : report.tracking) {
    json["tracking"].push_back({{"sure", std::round(at.threshold * 1e6) / 1e6},
                                {"events", at.events},
                                {"event_recall", OrNull(at.event_recall)},
                                {"event_recall_iou30", OrNull(at.event_recall_iou30)},
                                {"false_per_km", OrNull(at.false_per_km)},
                                {"false_reports", at.false_reports},
                                {"false_detections", at.false_detections}});
  }
  return json;
}

std::string Number(const std::optional<double>& value, int width, int digits) {
  std::array<char, 64> text{};
  if (value) {
    std::snprintf(text.data(), text.size(), "%*.*f", width, digits, *value);
  } else {
    std::snprintf(text.data(), text.size(), "%*s", width, "-");
  }
  return text.data();
}

std::string Whole(std::size_t value, int width) {
  return Number(static_cast<double>(value), width, 0);
}

std::string ThresholdColumns(const ClassFigures& figures) {
  return Number(figures.threshold, 10, 2) + Number(figures.precision, 10, 3) +
         Number(figures.recall, 8, 3) + Number(figures.event_recall, 13, 3) +
         Number(figures.event_recall_iou30, 8, 3) + Number(figures.false_per_km, 10, 2);
}

constexpr char kThresholdHeader[] = " threshold precision  recall event recall  IoU .3  false/km";

}  // namespace

nlohmann::ordered_json ToJson(const DetectionReport& report) {
  nlohmann::ordered_json json;
  json["frames"] = report.frames;
  json["classes"] = nlohmann::ordered_json::object();
  for (const ClassReport& entry : report.classes) {
    json["classes"][entry.class_name] = ClassJson(entry);
  }
  json["model"] = report.model;
  json["inference_ms_p50"] = report.inference_ms_p50;
  json["inference_ms_p95"] = report.inference_ms_p95;
  return json;
}

std::string ToText(const DetectionReport& report) {
  std::string text = "model " + report.model + ", " + std::to_string(report.frames) +
                     " frames, detection " + Number(report.inference_ms_p50, 0, 1) +
                     " ms (median), " + Number(report.inference_ms_p95, 0, 1) + " ms (95 %)\n\n" +
                     "class            frames  labels    AP50    AP30" + kThresholdHeader +
                     "  events      km\n";
  for (const ClassReport& entry : report.classes) {
    const ClassFigures& figures = entry.figures;
    std::string name = entry.class_name;
    name.resize(std::max<std::size_t>(name.size(), 15), ' ');
    text += name + Whole(figures.frames, 8) + Whole(figures.labels, 8) +
            Number(figures.ap50, 8, 3) + Number(figures.ap30, 8, 3) + ThresholdColumns(figures) +
            Whole(figures.events, 8) + Number(figures.km, 8, 2) + "\n";
  }
  for (const ClassReport& entry : report.classes) {
    if (entry.sweep.empty()) continue;
    text += "\n" + entry.class_name + "\n" + kThresholdHeader + "\n";
    for (const ClassFigures& at : entry.sweep) text += ThresholdColumns(at) + "\n";
  }
  for (const ClassReport& entry : report.classes) {
    if (entry.tracking.empty()) continue;
    text += "\n" + entry.class_name + ", tracked\n      sure event recall  IoU .3  false/km\n";
    for (const ClassFigures& at : entry.tracking) {
      text += Number(at.threshold, 10, 2) + Number(at.event_recall, 13, 3) +
              Number(at.event_recall_iou30, 8, 3) + Number(at.false_per_km, 10, 2) + "\n";
    }
  }
  return text;
}

}  // namespace livemap::evaluation
