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

Json ReportFigureOrNull(const std::optional<double>& value) {
  if (!value) return nullptr;
  return *value;
}

Json ReportCountsJson(const BinaryCounts& counts) {
  Json json;
  json["precision"] = ReportFigureOrNull(counts.precision());
  json["recall"] = ReportFigureOrNull(counts.recall());
  json["f1"] = ReportFigureOrNull(counts.f1());
  json["fpr"] = ReportFigureOrNull(counts.false_positive_rate());
  json["accuracy"] = ReportFigureOrNull(counts.accuracy());
  return json;
}

/// The most that the share of changed pixels allows: every one found, at as many false positives.
BinaryCounts ReportFullRecall(BinaryCounts counts) {
  counts.true_positive += std::exchange(counts.false_negative, 0);
  return counts;
}

Json ReportOperationsJson(const ScoreHistogram& scores) {
  Json json;
  for (const auto& [name, rate] : kRates) {
    const auto operation = scores.AtFalsePositiveRate(rate);
    if (!operation) {
      json[name] = nullptr;
      continue;
    }
    json[name]["threshold"] = operation->threshold;
    json[name].update(ReportCountsJson(operation->counts));
    json[name]["f1_at_full_recall"] = ReportFigureOrNull(ReportFullRecall(operation->counts).f1());
  }
  return json;
}

Json ReportCurveJson(const ScoreHistogram& scores, std::size_t points) {
  Json json;
  for (const char* key : {"threshold", "fpr", "recall", "precision"}) json[key] = Json::array();
  for (const auto& point : scores.Curve(points)) {
    json["threshold"].push_back(point.threshold);
    json["fpr"].push_back(point.false_positive_rate);
    json["recall"].push_back(point.recall);
    json["precision"].push_back(ReportFigureOrNull(point.precision));
  }
  return json;
}

Json ChangeClassesJson(const PooledChangeScores& pooled, std::size_t curve_points) {
  Json json;
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    const auto change_class = static_cast<protocol::ChangeClass>(i);
    const ScoreHistogram& scores = pooled.of_class(change_class);
    Json entry;
    entry["pixels"] = scores.positives();
    entry["ap"] = ReportFigureOrNull(scores.AveragePrecision());
    entry["at_fpr"] = ReportOperationsJson(scores);
    if (curve_points > 0) entry["curve"] = ReportCurveJson(scores, curve_points);
    json[protocol::ChangeClassName(change_class)] = entry;
  }
  return json;
}

/// Figures of some of the pixels, without classes.
Json ReportPartJson(const std::optional<PooledChangeScores>& part) {
  if (!part) return nullptr;
  Json json;
  json["pixels"] = part->pixels();
  json["change_pixels"] = part->change().positives();
  json["at_fpr"] = ReportOperationsJson(part->change());
  json["ap"] = ReportFigureOrNull(part->change().AveragePrecision());
  return json;
}

/// At the threshold from which on a vehicle tells of a change, of what it compares.
Json ReportOnBoardJson(const ChangeReport& report) {
  if (!report.on_board_threshold || !report.compared) return nullptr;
  Json json;
  json["threshold"] = *report.on_board_threshold;
  json.update(ReportCountsJson(report.compared->change().AtThreshold(*report.on_board_threshold)));
  return json;
}

Json ReportFiguresJson(const ChangeFigures& figures, std::size_t curve_points) {
  const PooledChangeScores& pooled = figures.pooled;
  Json json;
  json["pixels"] = pooled.pixels();
  json["change_pixels"] = pooled.change().positives();
  json["left_out_pixels"] = pooled.left_out();
  json["at_fpr"] = ReportOperationsJson(pooled.change());
  json["roc_area"] = ReportFigureOrNull(pooled.change().RocArea());
  json["ap"] = ReportFigureOrNull(pooled.change().AveragePrecision());
  json["argmax"] = ReportCountsJson(pooled.at_most_likely());
  json["multi_class_accuracy"] = ReportFigureOrNull(pooled.MultiClassAccuracy());
  json["classes"] =
      pooled.tells_classes() ? ChangeClassesJson(pooled, curve_points) : Json(nullptr);
  json["confusion"] = pooled.tells_classes() ? Json(pooled.confusion()) : Json(nullptr);
  Json& community = json["community"];
  community["side"] = CommunityChangeScores::kSide;
  community["f1_per_pair"] = ReportFigureOrNull(figures.community.MeanF1());
  community["f1_per_pair_with_change"] = ReportFigureOrNull(figures.community.MeanF1WithChange());
  community["pooled"] = ReportCountsJson(figures.community.Pooled());
  if (curve_points > 0) {
    json["curve"] = ReportCurveJson(pooled.change(), curve_points);
    for (const auto& [name, counts] : figures.community.pairs()) {
      Json entry;
      entry["name"] = name;
      entry["change_pixels"] = counts.true_positive + counts.false_negative;
      entry.update(ReportCountsJson(counts));
      json["pair_figures"].push_back(entry);
    }
  }
  return json;
}

std::string ReportColumn(const std::optional<double>& value) {
  char text[24];
  if (!value) return "       -";
  std::snprintf(text, sizeof(text), "%8.4f", *value);
  return text;
}

std::string ReportCountsLine(const char* what, const BinaryCounts& counts) {
  char text[80];
  std::snprintf(text, sizeof(text), "  %-26s", what);
  return text + ReportColumn(counts.precision()) + ReportColumn(counts.recall()) +
         ReportColumn(counts.f1()) + ReportColumn(counts.false_positive_rate()) + "\n";
}

std::string ReportFiguresText(const ChangeFigures& figures) {
  const PooledChangeScores& pooled = figures.pooled;
  std::string text = "                            precision  recall      f1     fpr\n";
  for (const auto& [name, rate] : kRates) {
    const auto operation = pooled.change().AtFalsePositiveRate(rate);
    const std::string what = std::string("at a FPR of ") + name;
    text += ReportCountsLine(what.c_str(), operation ? operation->counts : BinaryCounts());
  }
  text += ReportCountsLine("at the most likely class", pooled.at_most_likely());
  text += ReportCountsLine("the same at 512x512", figures.community.Pooled());
  text += "  binary accuracy" + ReportColumn(pooled.at_most_likely().accuracy()) +
          ", multi-class accuracy" + ReportColumn(pooled.MultiClassAccuracy()) + "\n  ROC area" +
          ReportColumn(pooled.change().RocArea()) + ", average precision" +
          ReportColumn(pooled.change().AveragePrecision()) + "\n  512x512: F1 per pair" +
          ReportColumn(figures.community.MeanF1()) + ", of pairs with a change" +
          ReportColumn(figures.community.MeanF1WithChange()) + "\n";
  if (!pooled.tells_classes()) return text;
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    const auto change_class = static_cast<protocol::ChangeClass>(i);
    const ScoreHistogram& scores = pooled.of_class(change_class);
    char line[96];
    std::snprintf(line, sizeof(line), "  %-16s %10llu pixels, average precision",
                  protocol::ChangeClassName(change_class),
                  static_cast<unsigned long long>(scores.positives()));
    text += line + ReportColumn(scores.AveragePrecision()) + "\n";
  }
  return text;
}

/// What was compared and what was guessed, each on its own.
std::string ReportPartsText(const ChangeReport& report) {
  std::string text;
  for (const auto& [name, part] : {std::pair("compared", &report.compared),
                                   std::pair("shown by no earlier picture", &report.unseen)}) {
    if (!*part || (*part)->pixels() == 0) continue;
    const auto operation = (*part)->change().AtFalsePositiveRate(0.01);
    text += ReportCountsLine(name, operation ? operation->counts : BinaryCounts());
    text.insert(text.size() - 1,
                "  at a FPR of 0.01, " + std::to_string((*part)->pixels()) + " pixels");
  }
  if (!report.on_board_threshold || !report.compared) return text;
  return text + ReportCountsLine("compared, as on board",
                                 report.compared->change().AtThreshold(*report.on_board_threshold));
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

std::optional<std::string> WhyNothingMeasured(const ChangeReport& report) {
  if (report.forward.pooled.pixels() > 0) return std::nullopt;
  return "the masks of all " + std::to_string(report.forward.community.pairs().size()) +
         " pairs leave out every pixel";
}

Json ToJson(const ChangeReport& report, std::size_t curve_points) {
  Json json;
  json["method"] = report.method;
  json["directories"] = report.directories;
  json["registration"] = report.registration;
  json["region"] = report.region;
  json["pairs"] = report.forward.community.pairs().size();
  json["refused_pairs"] = report.refused;
  json["left_out_pairs"] = report.hardly_changed;
  if (curve_points > 0) json["refusals"] = report.refusals;
  json["unknown_colour_pixels"] = report.unknown_colour_pixels;
  json["method_ms_p50"] = ReportFigureOrNull(report.method_ms_p50);
  json["registration_ms_p50"] = ReportFigureOrNull(report.registration_ms_p50);
  json.update(ReportFiguresJson(report.forward, curve_points));
  json["compared"] = ReportPartJson(report.compared);
  json["unseen"] = ReportPartJson(report.unseen);
  json["on_board"] = ReportOnBoardJson(report);
  json["directions"] = nullptr;
  if (report.directions) {
    json["directions"] = {{"right", report.directions->right},
                          {"wrong", report.directions->wrong},
                          {"unknown", report.directions->unknown}};
  }
  json["reversed"] = report.has_reversed ? ReportFiguresJson(report.reversed, 0) : Json(nullptr);
  if (const auto why = WhyNothingMeasured(report)) json["reason"] = *why;
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
  if (report.region != "all") text += ", region: " + report.region;
  text += "\n" + ReportFiguresText(report.forward) + ReportPartsText(report);
  if (report.directions) {
    text += "  directions of regions: " + std::to_string(report.directions->right) + " right, " +
            std::to_string(report.directions->wrong) + " wrong, " +
            std::to_string(report.directions->unknown) + " not known\n";
  }
  if (report.has_reversed) text += "order reversed\n" + ReportFiguresText(report.reversed);
  return text;
}

}  // namespace livemap::change
