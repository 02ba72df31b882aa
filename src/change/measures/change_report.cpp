#include "change/measures/change_report.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <utility>

#include "change/measures/change_pairs.h"

namespace livemap::change {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::pair<const char*, double>, 2> kRates{{{"0.10", 0.10}, {"0.01", 0.01}}};

Json FigureOrNull(const std::optional<double>& value) {
  if (!value) return nullptr;
  return *value;
}

Json CountsJson(const BinaryCounts& counts) {
  Json json;
  json["precision"] = FigureOrNull(counts.precision());
  json["recall"] = FigureOrNull(counts.recall());
  json["f1"] = FigureOrNull(counts.f1());
  json["fpr"] = FigureOrNull(counts.false_positive_rate());
  json["accuracy"] = FigureOrNull(counts.accuracy());
  return json;
}

/// The most that the share of changed pixels allows: every one found, at as many false positives.
BinaryCounts FullRecall(BinaryCounts counts) {
  counts.true_positive += std::exchange(counts.false_negative, 0);
  return counts;
}

Json OperationsJson(const ScoreHistogram& scores) {
  Json json;
  for (const auto& [name, rate] : kRates) {
    const auto operation = scores.AtFalsePositiveRate(rate);
    if (!operation) {
      json[name] = nullptr;
      continue;
    }
    json[name]["threshold"] = operation->threshold;
    json[name].update(CountsJson(operation->counts));
    json[name]["f1_at_full_recall"] = FigureOrNull(FullRecall(operation->counts).f1());
  }
  return json;
}

Json CurveJson(const ScoreHistogram& scores, std::size_t points) {
  Json json;
  for (const char* key : {"threshold", "fpr", "recall", "precision"}) json[key] = Json::array();
  for (const auto& point : scores.Curve(points)) {
    json["threshold"].push_back(point.threshold);
    json["fpr"].push_back(point.false_positive_rate);
    json["recall"].push_back(point.recall);
    json["precision"].push_back(FigureOrNull(point.precision));
  }
  return json;
}

Json ClassesJson(const PooledChangeScores& pooled, std::size_t curve_points) {
  Json json;
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    const auto change_class = static_cast<protocol::ChangeClass>(i);
    const ScoreHistogram& scores = pooled.of_class(change_class);
    Json entry;
    entry["pixels"] = scores.positives();
    entry["ap"] = FigureOrNull(scores.AveragePrecision());
    entry["at_fpr"] = OperationsJson(scores);
    if (curve_points > 0) entry["curve"] = CurveJson(scores, curve_points);
    json[protocol::ChangeClassName(change_class)] = entry;
  }
  return json;
}

Json FiguresJson(const ChangeFigures& figures, std::size_t curve_points) {
  const PooledChangeScores& pooled = figures.pooled;
  Json json;
  json["pixels"] = pooled.pixels();
  json["change_pixels"] = pooled.change().positives();
  json["left_out_pixels"] = pooled.left_out();
  json["at_fpr"] = OperationsJson(pooled.change());
  json["roc_area"] = FigureOrNull(pooled.change().RocArea());
  json["ap"] = FigureOrNull(pooled.change().AveragePrecision());
  json["argmax"] = CountsJson(pooled.at_most_likely());
  json["multi_class_accuracy"] = FigureOrNull(pooled.MultiClassAccuracy());
  json["classes"] = pooled.tells_classes() ? ClassesJson(pooled, curve_points) : Json(nullptr);
  json["confusion"] = pooled.tells_classes() ? Json(pooled.confusion()) : Json(nullptr);
  Json& community = json["community"];
  community["side"] = CommunityChangeScores::kSide;
  community["f1_per_pair"] = FigureOrNull(figures.community.MeanF1());
  community["f1_per_pair_with_change"] = FigureOrNull(figures.community.MeanF1WithChange());
  community["pooled"] = CountsJson(figures.community.Pooled());
  if (curve_points > 0) {
    json["curve"] = CurveJson(pooled.change(), curve_points);
    for (const auto& [name, counts] : figures.community.pairs()) {
      Json entry;
      entry["name"] = name;
      entry["change_pixels"] = counts.true_positive + counts.false_negative;
      entry.update(CountsJson(counts));
      json["pair_figures"].push_back(entry);
    }
  }
  return json;
}

std::string Column(const std::optional<double>& value) {
  char text[24];
  if (!value) return "       -";
  std::snprintf(text, sizeof(text), "%8.4f", *value);
  return text;
}

std::string CountsLine(const char* what, const BinaryCounts& counts) {
  char text[80];
  std::snprintf(text, sizeof(text), "  %-26s", what);
  return text + Column(counts.precision()) + Column(counts.recall()) + Column(counts.f1()) +
         Column(counts.false_positive_rate()) + "\n";
}

std::string FiguresText(const ChangeFigures& figures) {
  const PooledChangeScores& pooled = figures.pooled;
  std::string text = "                            precision  recall      f1     fpr\n";
  for (const auto& [name, rate] : kRates) {
    const auto operation = pooled.change().AtFalsePositiveRate(rate);
    const std::string what = std::string("at a FPR of ") + name;
    text += CountsLine(what.c_str(), operation ? operation->counts : BinaryCounts());
  }
  text += CountsLine("at the most likely class", pooled.at_most_likely());
  text += CountsLine("the same at 512x512", figures.community.Pooled());
  text += "  binary accuracy" + Column(pooled.at_most_likely().accuracy()) +
          ", multi-class accuracy" + Column(pooled.MultiClassAccuracy()) + "\n  ROC area" +
          Column(pooled.change().RocArea()) + ", average precision" +
          Column(pooled.change().AveragePrecision()) + "\n  512x512: F1 per pair" +
          Column(figures.community.MeanF1()) + ", of pairs with a change" +
          Column(figures.community.MeanF1WithChange()) + "\n";
  if (!pooled.tells_classes()) return text;
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    const auto change_class = static_cast<protocol::ChangeClass>(i);
    const ScoreHistogram& scores = pooled.of_class(change_class);
    char line[96];
    std::snprintf(line, sizeof(line), "  %-16s %10llu pixels, average precision",
                  protocol::ChangeClassName(change_class),
                  static_cast<unsigned long long>(scores.positives()));
    text += line + Column(scores.AveragePrecision()) + "\n";
  }
  return text;
}

}  // namespace

void CountDirections(const std::vector<ChangeRegion>& regions, const cv::Mat& classes,
                     const cv::Mat& truth, DirectionCounts& counts) {
  const cv::Mat changed = classes > 0;
  for (const ChangeRegion& region : regions) {
    const cv::Mat here = changed(region.box);
    const int appeared =
        cv::countNonZero((truth(region.box) == int{protocol::kAppearedPixel}) & here);
    const int vanished =
        cv::countNonZero((truth(region.box) == int{protocol::kVanishedPixel}) & here);
    const int true_pixels = appeared + vanished;
    if (true_pixels < 0.4 * cv::countNonZero(here)) continue;
    if (std::max(appeared, vanished) < 0.75 * true_pixels) continue;
    const ChangeDirection expected =
        appeared > vanished ? ChangeDirection::kAppeared : ChangeDirection::kVanished;
    if (region.direction == ChangeDirection::kUnknown) {
      ++counts.unknown;
    } else {
      ++(region.direction == expected ? counts.right : counts.wrong);
    }
  }
}

Json ToJson(const ChangeReport& report, std::size_t curve_points) {
  Json json;
  json["method"] = report.method;
  json["directories"] = report.directories;
  json["registration"] = report.registration;
  json["pairs"] = report.forward.community.pairs().size();
  json["refused_pairs"] = report.refused;
  json["left_out_pairs"] = report.hardly_changed;
  if (curve_points > 0) json["refusals"] = report.refusals;
  json["unknown_colour_pixels"] = report.unknown_colour_pixels;
  json["method_ms_p50"] = report.method_ms_p50;
  json["registration_ms_p50"] = report.registration_ms_p50;
  json.update(FiguresJson(report.forward, curve_points));
  json["directions"] = nullptr;
  if (report.directions) {
    json["directions"] = {{"right", report.directions->right},
                          {"wrong", report.directions->wrong},
                          {"unknown", report.directions->unknown}};
  }
  json["reversed"] = report.has_reversed ? FiguresJson(report.reversed, 0) : Json(nullptr);
  return json;
}

std::string ToText(const ChangeReport& report) {
  const std::size_t pairs = report.forward.community.pairs().size();
  std::string text =
      report.method + ", " + std::to_string(pairs) + " pairs, registration: " + report.registration;
  if (report.hardly_changed > 0) {
    text += ", " + std::to_string(report.hardly_changed) + " left out as hardly changed";
  }
  if (report.refused > 0) text += ", " + std::to_string(report.refused) + " refused";
  text += "\n" + FiguresText(report.forward);
  if (report.directions) {
    text += "  directions of regions: " + std::to_string(report.directions->right) + " right, " +
            std::to_string(report.directions->wrong) + " wrong, " +
            std::to_string(report.directions->unknown) + " not known\n";
  }
  if (report.has_reversed) text += "order reversed\n" + FiguresText(report.reversed);
  return text;
}

}  // namespace livemap::change
