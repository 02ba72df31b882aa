#include "evaluation/detection/detection_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace livemap::evaluation {
namespace {

nlohmann::ordered_json ReportValueOrNull(const std::optional<double>& value) {
  if (!value) return nullptr;
  return *value;
}

/// Figures that depend on the threshold.
void AddThresholdsToReport(const ClassFigures& figures, nlohmann::ordered_json& json) {
  json["precision"] = ReportValueOrNull(figures.precision);
  json["recall"] = ReportValueOrNull(figures.recall);
  json["events"] = figures.events;
  json["event_recall"] = ReportValueOrNull(figures.event_recall);
  json["event_recall_iou30"] = ReportValueOrNull(figures.event_recall_iou30);
  json["false_per_km"] = ReportValueOrNull(figures.false_per_km);
  json["false_reports"] = figures.false_reports;
  json["false_detections"] = figures.false_detections;
}

nlohmann::ordered_json ReportClassJson(const ClassReport& report) {
  const ClassFigures& figures = report.figures;
  nlohmann::ordered_json json;
  json["labels"] = figures.labels;
  json["ap50"] = ReportValueOrNull(figures.ap50);
  AddThresholdsToReport(figures, json);
  json["ap30"] = ReportValueOrNull(figures.ap30);
  // The detector compares in single precision: 0.4 there is 0.4000000059604645.
  json["threshold"] = std::round(figures.threshold * 1e6) / 1e6;
  json["n"] = figures.frames;
  json["km"] = figures.km;
  json["missed_by_cause"] = report.missed_by_cause;
  json["false_by_cause"] = report.false_by_cause;
  for (const ClassFigures& at : report.sweep) {
    nlohmann::ordered_json entry;
    entry["threshold"] = std::round(at.threshold * 1e6) / 1e6;
    AddThresholdsToReport(at, entry);
    json["sweep"].push_back(entry);
  }
  for (const ClassFigures& at : report.tracking) {
    json["tracking"].push_back({{"sure", std::round(at.threshold * 1e6) / 1e6},
                                {"events", at.events},
                                {"event_recall", ReportValueOrNull(at.event_recall)},
                                {"event_recall_iou30", ReportValueOrNull(at.event_recall_iou30)},
                                {"false_per_km", ReportValueOrNull(at.false_per_km)},
                                {"false_reports", at.false_reports},
                                {"false_detections", at.false_detections}});
  }
  return json;
}

std::string ReportNumber(const std::optional<double>& value, int width, int digits) {
  std::array<char, 64> text{};
  if (value) {
    std::snprintf(text.data(), text.size(), "%*.*f", width, digits, *value);
  } else {
    std::snprintf(text.data(), text.size(), "%*s", width, "-");
  }
  return text.data();
}

std::string ReportWholeNumber(std::size_t value, int width) {
  return ReportNumber(static_cast<double>(value), width, 0);
}

std::string ReportThresholdColumns(const ClassFigures& figures) {
  return ReportNumber(figures.threshold, 10, 2) + ReportNumber(figures.precision, 10, 3) +
         ReportNumber(figures.recall, 8, 3) + ReportNumber(figures.event_recall, 13, 3) +
         ReportNumber(figures.event_recall_iou30, 8, 3) + ReportNumber(figures.false_per_km, 10, 2);
}

constexpr char kThresholdHeader[] = " threshold precision  recall event recall  IoU .3  false/km";

}  // namespace

std::optional<std::string> WhyNothingMeasured(const DetectionReport& report) {
  const bool measured =
      std::any_of(report.classes.begin(), report.classes.end(), [](const ClassReport& entry) {
        return entry.figures.labels > 0 || entry.figures.false_per_km.has_value();
      });
  if (measured) return std::nullopt;
  return std::to_string(report.frames) + " frames have no label of a class of the model '" +
         report.model + "', and no drive among them has a length";
}

nlohmann::ordered_json ToJson(const DetectionReport& report) {
  nlohmann::ordered_json json;
  json["frames"] = report.frames;
  json["classes"] = nlohmann::ordered_json::object();
  for (const ClassReport& entry : report.classes) {
    json["classes"][entry.class_name] = ReportClassJson(entry);
  }
  json["model"] = report.model;
  json["inference_ms_p50"] = ReportValueOrNull(report.inference_ms_p50);
  json["inference_ms_p95"] = ReportValueOrNull(report.inference_ms_p95);
  if (const auto why = WhyNothingMeasured(report)) json["reason"] = *why;
  return json;
}

std::string ToText(const DetectionReport& report) {
  std::string text = "model " + report.model + ", " + std::to_string(report.frames) +
                     " frames, detection " + ReportNumber(report.inference_ms_p50, 0, 1) +
                     " ms (median), " + ReportNumber(report.inference_ms_p95, 0, 1) +
                     " ms (95 %)\n\n" + "class            frames  labels    AP50    AP30" +
                     kThresholdHeader + "  events      km\n";
  for (const ClassReport& entry : report.classes) {
    const ClassFigures& figures = entry.figures;
    std::string name = entry.class_name;
    name.resize(std::max<std::size_t>(name.size(), 15), ' ');
    text += name + ReportWholeNumber(figures.frames, 8) + ReportWholeNumber(figures.labels, 8) +
            ReportNumber(figures.ap50, 8, 3) + ReportNumber(figures.ap30, 8, 3) +
            ReportThresholdColumns(figures) + ReportWholeNumber(figures.events, 8) +
            ReportNumber(figures.km, 8, 2) + "\n";
  }
  for (const ClassReport& entry : report.classes) {
    if (entry.sweep.empty()) continue;
    text += "\n" + entry.class_name + "\n" + kThresholdHeader + "\n";
    for (const ClassFigures& at : entry.sweep) text += ReportThresholdColumns(at) + "\n";
  }
  for (const ClassReport& entry : report.classes) {
    if (entry.tracking.empty()) continue;
    text += "\n" + entry.class_name + ", tracked\n      sure event recall  IoU .3  false/km\n";
    for (const ClassFigures& at : entry.tracking) {
      text += ReportNumber(at.threshold, 10, 2) + ReportNumber(at.event_recall, 13, 3) +
              ReportNumber(at.event_recall_iou30, 8, 3) + ReportNumber(at.false_per_km, 10, 2) +
              "\n";
    }
  }
  return text;
}

}  // namespace livemap::evaluation
