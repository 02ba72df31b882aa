#include "evaluation/trajectory/trajectory_report.h"

#include <array>
#include <cstdio>

namespace livemap::evaluation {
namespace {

constexpr double kDegreesPerRadian = 180 / 3.14159265358979323846;

constexpr std::array<std::pair<const char*, AlignmentKind>, 4> kAlignments = {
    {{"none", AlignmentKind::kNone},
     {"se3", AlignmentKind::kSe3},
     {"sim3", AlignmentKind::kSim3},
     {"origin", AlignmentKind::kOrigin}}};

/// The same figures in another unit.
ErrorFigures ReportFiguresTimes(ErrorFigures figures, double factor) {
  for (double* value :
       {&figures.rmse, &figures.mean, &figures.median, &figures.std, &figures.min, &figures.max}) {
    *value *= factor;
  }
  return figures;
}

/// Keys PREFIX_rmse_UNIT and so on; null without errors.
void AddReportFigures(const std::string& prefix, const std::string& unit,
                      const ErrorFigures& figures, nlohmann::ordered_json& json) {
  const std::array<std::pair<const char*, double>, 6> values = {{{"rmse", figures.rmse},
                                                                 {"mean", figures.mean},
                                                                 {"median", figures.median},
                                                                 {"std", figures.std},
                                                                 {"min", figures.min},
                                                                 {"max", figures.max}}};
  for (const auto& [name, value] : values) {
    nlohmann::ordered_json& entry = json[prefix + "_" + name + "_" + unit];
    if (figures.n > 0) entry = value;
  }
}

std::string TrajectoryReportNumber(double value, int width, int digits) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%*.*f", width, digits, value);
  return text.data();
}

/// Shortest form, for what was asked for.
std::string PlainReportNumber(double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

std::string TrajectoryReportRow(std::string name, const ErrorFigures& figures) {
  name.resize(std::max<std::size_t>(name.size(), 26), ' ');
  if (figures.n == 0) return name + "  no two poses are that far apart\n";
  for (const double value :
       {figures.rmse, figures.mean, figures.median, figures.std, figures.min, figures.max}) {
    name += TrajectoryReportNumber(value, 11, 6);
  }
  return name + TrajectoryReportNumber(static_cast<double>(figures.n), 9, 0) + "\n";
}

}  // namespace

std::string AlignmentName(AlignmentKind kind) {
  for (const auto& [name, known] : kAlignments) {
    if (known == kind) return name;
  }
  return "";
}

std::optional<AlignmentKind> ParseAlignmentKind(const std::string& name) {
  for (const auto& [known, kind] : kAlignments) {
    if (known == name) return kind;
  }
  return std::nullopt;
}

nlohmann::ordered_json ToJson(const TrajectoryFigures& figures) {
  nlohmann::ordered_json json;
  json["pairs"] = figures.pairs;
  json["truth_poses"] = figures.truth_poses;
  json["estimate_poses"] = figures.estimate_poses;
  json["duration_s"] = figures.duration_s;
  json["length_m"] = figures.length_m;
  json["longest_gap_s"] = figures.longest_gap_s;
  json["alignment"] = AlignmentName(figures.alignment);
  if (figures.alignment == AlignmentKind::kSim3) json["scale"] = figures.scale;
  AddReportFigures("ate", "m", figures.ate_m, json);
  json["rpe_delta_s"] = figures.rpe_delta_s;
  json["rpe_pairs"] = figures.rpe_m.n;
  AddReportFigures("rpe", "m_per_s", ReportFiguresTimes(figures.rpe_m, 1 / figures.rpe_delta_s),
                   json);
  AddReportFigures("rpe", "deg_per_s",
                   ReportFiguresTimes(figures.rpe_rad, kDegreesPerRadian / figures.rpe_delta_s),
                   json);
  if (figures.rpe_delta_frames > 0) {
    json["rpe_frames_delta"] = figures.rpe_delta_frames;
    json["rpe_frames_pairs"] = figures.rpe_frames_m.n;
    AddReportFigures("rpe_frames", "m", figures.rpe_frames_m, json);
    AddReportFigures("rpe_frames", "deg",
                     ReportFiguresTimes(figures.rpe_frames_rad, kDegreesPerRadian), json);
  }
  json["kitti_translation_percent"] = nullptr;
  json["kitti_rotation_deg_per_100m"] = nullptr;
  json["kitti_segments"] = figures.kitti ? figures.kitti->n : 0;
  if (figures.kitti) {
    json["kitti_translation_percent"] = figures.kitti->translation_percent;
    json["kitti_rotation_deg_per_100m"] =
        figures.kitti->rotation_rad_per_m * kDegreesPerRadian * 100;
  }
  json["segment_translation_percent"] = nullptr;
  if (figures.short_segments) {
    json["segment_translation_percent"] = figures.short_segments->translation_percent;
  }
  json["end_error_percent"] = nullptr;
  if (figures.end_error_percent) json["end_error_percent"] = *figures.end_error_percent;
  return json;
}

nlohmann::ordered_json NullFigures() {
  nlohmann::ordered_json json = ToJson(TrajectoryFigures{});
  for (auto& [key, value] : json.items()) value = nullptr;
  return json;
}

std::string ToText(const TrajectoryFigures& figures) {
  std::string text = std::to_string(figures.pairs) + " pairs of " +
                     std::to_string(figures.truth_poses) + " true and " +
                     std::to_string(figures.estimate_poses) + " estimated poses, " +
                     TrajectoryReportNumber(figures.duration_s, 0, 1) + " s, " +
                     TrajectoryReportNumber(figures.length_m, 0, 2) + " m, longest gap " +
                     TrajectoryReportNumber(figures.longest_gap_s, 0, 2) + " s\nalignment " +
                     AlignmentName(figures.alignment);
  if (figures.alignment == AlignmentKind::kSim3)
    text += ", scale " + TrajectoryReportNumber(figures.scale, 0, 6);
  text += "\n\n" + std::string(26, ' ') +
          "       rmse       mean     median        std        min        max        n\n";
  text += TrajectoryReportRow("ATE (m)", figures.ate_m);
  const std::string over = "RPE over " + PlainReportNumber(figures.rpe_delta_s) + " s ";
  text += TrajectoryReportRow(over + "(m/s)",
                              ReportFiguresTimes(figures.rpe_m, 1 / figures.rpe_delta_s));
  text += TrajectoryReportRow(
      over + "(deg/s)",
      ReportFiguresTimes(figures.rpe_rad, kDegreesPerRadian / figures.rpe_delta_s));
  if (figures.rpe_delta_frames > 0) {
    const std::string frames = "RPE over " + std::to_string(figures.rpe_delta_frames) +
                               (figures.rpe_delta_frames == 1 ? " frame " : " frames ");
    text += TrajectoryReportRow(frames + "(m)", figures.rpe_frames_m);
    text += TrajectoryReportRow(frames + "(deg)",
                                ReportFiguresTimes(figures.rpe_frames_rad, kDegreesPerRadian));
  }
  text += "\n";
  if (!figures.kitti) return text + "KITTI segments: none, the path is not longer than 100 m\n";
  return text +
         "KITTI segments: " + TrajectoryReportNumber(figures.kitti->translation_percent, 0, 4) +
         " %, " +
         TrajectoryReportNumber(figures.kitti->rotation_rad_per_m * kDegreesPerRadian * 100, 0, 4) +
         " deg/100 m, n " + std::to_string(figures.kitti->n) + "\n";
}

}  // namespace livemap::evaluation
