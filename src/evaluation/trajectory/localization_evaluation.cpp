#include "evaluation/trajectory/localization_evaluation.h"

#include <GeographicLib/Geocentric.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <vector>

#include "common/error.h"
#include "common/median.h"
#include "common/time.h"
#include "datasets/seeded_random.h"
#include "evaluation/detection/detection_report.h"
#include "evaluation/quantile.h"
#include "localization/geo_localizer.h"

namespace livemap::evaluation {
namespace {

constexpr double kTwoPi = 6.28318530717958647693;

/// A true pose on a plane.
struct TruePose {
  std::int64_t stamp_ns;
  localization::PlanarPose pose;
};

geo::GeoPoint TrialPlaceOf(const Eigen::Vector3d& earth_m) {
  geo::GeoPoint point;
  double height_m = 0;
  GeographicLib::Geocentric::WGS84().Reverse(earth_m.x(), earth_m.y(), earth_m.z(),
                                             point.latitude_deg, point.longitude_deg, height_m);
  return point;
}

/// Truth on the plane of `frame`, the heading continuous.
std::vector<TruePose> TruthOfTrial(const datasets::PositionDrive& drive,
                                   const geo::LocalFrame& frame) {
  const Eigen::Matrix3d east_north_up = frame.InEarth().linear().transpose();
  std::vector<TruePose> truth;
  for (const datasets::RecordedPose& pose : drive.poses) {
    const Eigen::Vector3d ahead =
        east_north_up * (pose.earth_from_vehicle * Eigen::Vector3d::UnitX());
    double yaw_rad = std::atan2(ahead.y(), ahead.x());
    if (!truth.empty()) {
      const double before_rad = truth.back().pose.yaw_rad;
      yaw_rad = before_rad + localization::WrapAngle(yaw_rad - before_rad);
    }
    truth.push_back({pose.stamp_ns, {frame.ToEnu(TrialPlaceOf(pose.earth_m)), yaw_rad}});
  }
  return truth;
}

/// A longer time between two neighbours is a gap, across which nothing is known: twice the median
/// interval, and at least a second.
template <typename Stamped>
std::int64_t MaxTrialIntervalNs(const std::vector<Stamped>& records) {
  constexpr std::int64_t kLeastNs = 1'000'000'000;
  std::vector<std::int64_t> intervals_ns;
  for (std::size_t i = 1; i < records.size(); ++i) {
    intervals_ns.push_back(records[i].stamp_ns - records[i - 1].stamp_ns);
  }
  if (intervals_ns.empty()) return kLeastNs;
  return std::max(kLeastNs, 2 * TakeMedian(intervals_ns));
}

template <typename Stamped>
TimeSpan SpanOfTrial(const std::vector<Stamped>& records) {
  if (records.empty()) return {};
  return {Seconds(records.front().stamp_ns), Seconds(records.back().stamp_ns)};
}

std::string TrialSpanText(const TimeSpan& span) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.3f to %.3f s", span.from_s, span.to_s);
  return text.data();
}

/// Between two true poses that follow each other closely; none outside of them and in a gap.
std::optional<localization::PlanarPose> TrialTruthAt(const std::vector<TruePose>& truth,
                                                     std::int64_t max_interval_ns,
                                                     std::int64_t stamp_ns) {
  const auto after = std::lower_bound(
      truth.begin(), truth.end(), stamp_ns,
      [](const TruePose& pose, std::int64_t moment_ns) { return pose.stamp_ns < moment_ns; });
  if (after == truth.end()) return std::nullopt;
  if (after->stamp_ns == stamp_ns) return after->pose;
  if (after == truth.begin()) return std::nullopt;
  const TruePose& before = *std::prev(after);
  if (after->stamp_ns - before.stamp_ns > max_interval_ns) return std::nullopt;
  const double share =
      Seconds(stamp_ns - before.stamp_ns) / Seconds(after->stamp_ns - before.stamp_ns);
  return localization::PlanarPose{
      before.pose.position_m + share * (after->pose.position_m - before.pose.position_m),
      before.pose.yaw_rad + share * (after->pose.yaw_rad - before.pose.yaw_rad)};
}

/// A pose in the odometry's frame.
struct TrialOdometry {
  std::int64_t stamp_ns = 0;
  localization::PlanarPose pose;
  bool lost = false;  ///< After a gap: the pose is held, and says nothing about the way since.
};

/// Wheel speed along a heading that has a gyro's errors. Across a gap in the speeds or the true
/// poses nobody knows how the vehicle moved: the odometry is lost there.
std::vector<TrialOdometry> OdometryOfTrial(const datasets::PositionDrive& drive,
                                           const std::vector<TruePose>& truth,
                                           const LocalizationTrial& trial,
                                           datasets::SeededRandom& random) {
  const double bias_rps = trial.gyro_bias_sigma_rps * random.Normal().x();
  const std::int64_t max_truth_interval_ns = MaxTrialIntervalNs(truth);
  const std::int64_t max_interval_ns =
      std::max(max_truth_interval_ns, MaxTrialIntervalNs(drive.speeds));
  std::vector<TrialOdometry> odometry;
  double error_rad = 0;
  double heading_before_rad = 0;
  double speed_before_mps = 0;
  for (const datasets::RecordedSpeed& speed : drive.speeds) {
    const auto true_pose = TrialTruthAt(truth, max_truth_interval_ns, speed.stamp_ns);
    if (!true_pose) continue;
    if (odometry.empty()) {
      // Begins at its own origin, turned as it likes.
      heading_before_rad = true_pose->yaw_rad;
      odometry.push_back({speed.stamp_ns, {}, false});
    } else if (speed.stamp_ns - odometry.back().stamp_ns > max_interval_ns) {
      heading_before_rad = true_pose->yaw_rad;
      odometry.push_back({speed.stamp_ns, odometry.back().pose, true});
    } else {
      const double time_s = Seconds(speed.stamp_ns - odometry.back().stamp_ns);
      error_rad = bias_rps * time_s + trial.gyro_walk_rad * std::sqrt(time_s) * random.Normal().x();
      const double turn_rad = true_pose->yaw_rad - heading_before_rad + error_rad;
      const localization::PlanarPose& before = odometry.back().pose;
      const double way_m = 0.5 * (speed.speed_mps + speed_before_mps) * time_s;
      const Eigen::Vector2d step_m =
          localization::Rotation2(before.yaw_rad + 0.5 * turn_rad) * Eigen::Vector2d(way_m, 0);
      odometry.push_back(
          {speed.stamp_ns, {before.position_m + step_m, before.yaw_rad + turn_rad}, false});
      heading_before_rad = true_pose->yaw_rad;
    }
    speed_before_mps = speed.speed_mps;
  }
  return odometry;
}

struct TrialFix {
  geo::Fix fix;
  bool outlier = false;
};

std::vector<TrialFix> FixesOfTrial(const datasets::PositionDrive& drive,
                                   const LocalizationTrial& trial, datasets::SeededRandom& random) {
  std::vector<TrialFix> fixes;
  const double stated_m = std::hypot(trial.fix_sigma_m, trial.states_noise ? trial.noise_m : 0);
  for (const datasets::RecordedFix& recorded : drive.fixes) {
    TrialFix fix;
    Eigen::Vector2d error_m = trial.noise_m * random.Normal();
    fix.outlier = random.Uniform() < trial.outlier_share;
    const double direction_rad = kTwoPi * random.Uniform();
    if (fix.outlier) {
      error_m +=
          trial.outlier_m * Eigen::Vector2d(std::cos(direction_rad), std::sin(direction_rad));
    }
    fix.fix.stamp_ns = recorded.stamp_ns;
    fix.fix.position = recorded.position;
    if (error_m != Eigen::Vector2d::Zero()) {
      fix.fix.position = geo::LocalFrame(recorded.position).ToGeo(error_m);
    }
    fix.fix.covariance_m2 = stated_m * stated_m * Eigen::Matrix2d::Identity();
    fixes.push_back(fix);
  }
  return fixes;
}

/// What one run gives.
struct Run {
  std::map<std::int64_t, Eigen::Vector2d> fused_m;  // By the true poses' stamps.
  std::vector<double> errors_m;
  double nees_sum = 0;
  std::vector<double> milliseconds;
  std::size_t fixes = 0;
  double fix_square_sum = 0;
  std::size_t compared_fixes = 0;
  std::size_t outliers_added = 0;
  std::optional<std::uint64_t> fixes_used_before_gap;  // The last one; none without a gap.
  localization::LocalizerCounters counters;
  localization::LatencyEstimate latency;
  double odometry_scale = 1;
};

class LocalizationEvaluationRun {
 public:
  LocalizationEvaluationRun(const datasets::PositionDrive& drive, const LocalizationTrial& trial)
      : drive_(drive), trial_(trial), frame_(TrialPlaceOf(drive.poses.front().earth_m)) {
    truth_ = TruthOfTrial(drive, frame_);
    max_truth_interval_ns_ = MaxTrialIntervalNs(truth_);
    const std::int64_t first_ns = std::min(
        {truth_.front().stamp_ns, drive.fixes.front().stamp_ns, drive.speeds.front().stamp_ns});
    // A drive may begin at its own zero, which is no stamp on board.
    shift_ns_ = first_ns > 0 ? 0 : 1'000'000'000;
    // One seed for both, so that a drop-out changes no noise.
    datasets::SeededRandom random(trial.seed);
    odometry_ = OdometryOfTrial(drive, truth_, trial, random);
    fixes_ = FixesOfTrial(drive, trial, random);
    if (odometry_.size() < 2) {
      throw Error("the drive's wheel speed and poses share no time: the speeds reach from " +
                  TrialSpanText(SpanOfTrial(drive.speeds)) + ", the poses from " +
                  TrialSpanText(SpanOfTrial(drive.poses)));
    }
  }

  const std::vector<TruePose>& truth() const { return truth_; }

  std::size_t TruthGaps() const {
    std::size_t gaps = 0;
    for (std::size_t i = 1; i < truth_.size(); ++i) {
      if (truth_[i].stamp_ns - truth_[i - 1].stamp_ns > max_truth_interval_ns_) ++gaps;
    }
    return gaps;
  }

  std::size_t OdometryGaps() const {
    return static_cast<std::size_t>(
        std::count_if(odometry_.begin(), odometry_.end(),
                      [](const TrialOdometry& odometry) { return odometry.lost; }));
  }

  bool InDropout(std::int64_t stamp_ns) const {
    const double after_s = Seconds(stamp_ns - drive_.fixes.front().stamp_ns);
    return after_s >= trial_.dropout_start_s && after_s < trial_.dropout_start_s + trial_.dropout_s;
  }

  Run Drive(const localization::LocalizerConfig& config, bool with_dropout) const {
    localization::GeoLocalizer localizer(config);
    Run run;
    std::size_t next_odometry = 0;
    std::size_t next_fix = 0;
    for (const TruePose& true_pose : truth_) {
      while (true) {
        const std::int64_t odometry_ns = next_odometry < odometry_.size()
                                             ? odometry_[next_odometry].stamp_ns
                                             : true_pose.stamp_ns + 1;
        const std::int64_t fix_ns =
            next_fix < fixes_.size() ? fixes_[next_fix].fix.stamp_ns : true_pose.stamp_ns + 1;
        if (std::min(odometry_ns, fix_ns) > true_pose.stamp_ns) break;
        if (odometry_ns <= fix_ns) {
          AddOdometry(localizer, odometry_[next_odometry++], run);
        } else {
          AddFix(localizer, fixes_[next_fix++], with_dropout, run);
        }
      }
      Compare(localizer, true_pose, run);
    }
    run.counters = localizer.counters();
    run.latency = localizer.latency();
    run.odometry_scale = localizer.odometry_scale();
    return run;
  }

 private:
  void AddOdometry(localization::GeoLocalizer& localizer, const TrialOdometry& odometry,
                   Run& run) const {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear().topLeftCorner<2, 2>() = localization::Rotation2(odometry.pose.yaw_rad);
    pose.translation().head<2>() = odometry.pose.position_m;
    if (odometry.lost) {
      localizer.AddLostOdometry(odometry.stamp_ns + shift_ns_, pose);
      run.fixes_used_before_gap = localizer.counters().fixes_used;
    } else {
      localizer.AddOdometry(odometry.stamp_ns + shift_ns_, pose);
    }
  }

  void AddFix(localization::GeoLocalizer& localizer, const TrialFix& fix, bool with_dropout,
              Run& run) const {
    if (with_dropout && InDropout(fix.fix.stamp_ns)) return;
    geo::Fix handed = fix.fix;
    handed.stamp_ns += shift_ns_;
    const auto start = std::chrono::steady_clock::now();
    localizer.AddFix(handed);
    run.milliseconds.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    ++run.fixes;
    run.outliers_added += fix.outlier ? 1 : 0;
    if (const auto true_pose = TrialTruthAt(truth_, max_truth_interval_ns_, fix.fix.stamp_ns)) {
      run.fix_square_sum += (frame_.ToEnu(fix.fix.position) - true_pose->position_m).squaredNorm();
      ++run.compared_fixes;
    }
  }

  void Compare(const localization::GeoLocalizer& localizer, const TruePose& true_pose,
               Run& run) const {
    // What the odometry missed in a gap of the recording is no error of the fusion: it is compared
    // again from the next fix on.
    if (localizer.counters().fixes_used == run.fixes_used_before_gap) return;
    const auto fused = localizer.Fused(true_pose.stamp_ns + shift_ns_);
    if (!fused || fused->state == localization::LocalizerState::kUninitialised) return;
    const Eigen::Vector2d fused_m = frame_.ToEnu(fused->position);
    const Eigen::Vector2d error_m = fused_m - true_pose.pose.position_m;
    run.fused_m[true_pose.stamp_ns] = fused_m;
    run.errors_m.push_back(error_m.norm());
    run.nees_sum += error_m.dot(fused->covariance_m2.inverse() * error_m);
  }

  const datasets::PositionDrive& drive_;
  const LocalizationTrial& trial_;
  const geo::LocalFrame frame_;
  std::vector<TruePose> truth_;
  std::int64_t max_truth_interval_ns_ = 0;
  std::int64_t shift_ns_ = 0;  // Added to all stamps for the localizer.
  std::vector<TrialOdometry> odometry_;
  std::vector<TrialFix> fixes_;
};

double LocalizationRmse(const std::vector<double>& errors_m) {
  double sum = 0;
  for (const double error_m : errors_m) sum += error_m * error_m;
  return errors_m.empty() ? 0 : std::sqrt(sum / static_cast<double>(errors_m.size()));
}

/// How far the drop-out moved the fused position, at most and at its end.
void AddLocalizationDropout(const LocalizationEvaluationRun& runner, const Run& with,
                            const Run& without, LocalizationReport& report) {
  for (const TruePose& pose : runner.truth()) {
    if (!runner.InDropout(pose.stamp_ns)) continue;
    const auto a = with.fused_m.find(pose.stamp_ns);
    const auto b = without.fused_m.find(pose.stamp_ns);
    if (a == with.fused_m.end() || b == without.fused_m.end()) continue;
    const double moved_m = (a->second - b->second).norm();
    report.dropout_error_m = std::max(report.dropout_error_m.value_or(0), moved_m);
    report.dropout_end_error_m = (a->second - pose.pose.position_m).norm();
  }
}

}  // namespace

LocalizationReport EvaluateLocalization(const datasets::PositionDrive& drive,
                                        const localization::LocalizerConfig& config,
                                        const LocalizationTrial& trial) {
  const LocalizationEvaluationRun runner(drive, trial);
  const bool with_dropout = trial.dropout_s > 0;
  const Run run = runner.Drive(config, with_dropout);
  LocalizationReport report;
  report.fixes = run.fixes;
  report.compared_fixes = run.compared_fixes;
  report.fix_rmse_m = run.compared_fixes == 0
                          ? 0
                          : std::sqrt(run.fix_square_sum / static_cast<double>(run.compared_fixes));
  report.fused_rmse_m = LocalizationRmse(run.errors_m);
  report.fused_p50_m = Quantile(run.errors_m, 0.5);
  report.fused_p95_m = Quantile(run.errors_m, 0.95);
  report.fused_max_m = Quantile(run.errors_m, 1);
  report.poses = run.errors_m.size();
  if (!run.fused_m.empty()) {
    report.first_fused_s = Seconds(run.fused_m.begin()->first - drive.fixes.front().stamp_ns);
    report.nees_mean = run.nees_sum / static_cast<double>(run.errors_m.size());
  }
  if (with_dropout) AddLocalizationDropout(runner, run, runner.Drive(config, false), report);
  report.outliers_added = run.outliers_added;
  report.outliers_refused = run.counters.fixes_refused;
  report.fixes_used = run.counters.fixes_used;
  report.fixes_invalid = run.counters.fixes_invalid;
  report.fixes_without_odometry = run.counters.fixes_without_odometry;
  report.fixes_out_of_order = run.counters.fixes_out_of_order;
  report.truth_gaps = runner.TruthGaps();
  report.odometry_gaps = runner.OdometryGaps();
  report.fix_span = SpanOfTrial(drive.fixes);
  report.truth_span = SpanOfTrial(drive.poses);
  report.latency_estimate_s = run.latency.value_s;
  report.latency_sigma_s = run.latency.sigma_s;
  report.latency_observed = run.latency.observed;
  report.odometry_scale = run.odometry_scale;
  report.ms_per_fix_median = Quantile(run.milliseconds, 0.5);
  report.ms_per_fix_p95 = Quantile(run.milliseconds, 0.95);
  report.ms_per_fix_max = Quantile(run.milliseconds, 1);
  return report;
}

std::optional<std::string> WhyNothingMeasured(const LocalizationReport& report) {
  if (report.poses > 0) return std::nullopt;
  std::string why = "no true pose has a fused one: of " + std::to_string(report.fixes) + " fixes " +
                    std::to_string(report.fixes_used) + " were used, " +
                    std::to_string(report.outliers_refused) + " refused as outliers, " +
                    std::to_string(report.fixes_invalid) + " out of range and " +
                    std::to_string(report.fixes_without_odometry) + " without odometry";
  if (report.fixes_out_of_order > 0) {
    why += ", " + std::to_string(report.fixes_out_of_order) + " were out of order";
  }
  const std::uint64_t told = report.fixes_used + report.outliers_refused + report.fixes_invalid +
                             report.fixes_without_odometry + report.fixes_out_of_order;
  if (told < report.fixes) {
    why += ", " + std::to_string(report.fixes - told) + " were still waiting for a heading";
  }
  const std::optional<TimeSpan>& fixes = report.fix_span;
  const std::optional<TimeSpan>& truth = report.truth_span;
  if (fixes && truth && (fixes->to_s < truth->from_s || fixes->from_s > truth->to_s)) {
    why += "; the fixes reach from " + TrialSpanText(*fixes) + ", the true poses from " +
           TrialSpanText(*truth) + ", and share no time";
  }
  return why;
}

std::vector<std::string> NotesOf(const LocalizationReport& report) {
  std::vector<std::string> notes;
  const auto add = [&notes](std::size_t gaps, const std::string& where, const std::string& what) {
    if (gaps == 0) return;
    notes.push_back(where + (gaps == 1 ? " a gap" : " " + std::to_string(gaps) + " gaps") + what);
  };
  add(report.truth_gaps, "the true poses have", ", in which nothing is compared");
  add(report.odometry_gaps, "the wheel speed with a true heading has",
      ", across which the odometry is lost: nothing is compared from there to the next fix");
  return notes;
}

nlohmann::ordered_json ToJson(const LocalizationReport& report) {
  const auto or_null = [](const std::optional<double>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
  };
  const auto null_unless = [](bool measured, double value) {
    return measured ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
  };
  const auto of_fused = [&](double value) { return null_unless(report.poses > 0, value); };
  const auto of_time = [&](double value) { return null_unless(report.fixes > 0, value); };
  nlohmann::ordered_json json = {
      {"fixes", report.fixes},
      {"fix_rmse_m", null_unless(report.compared_fixes > 0, report.fix_rmse_m)},
      {"fused_rmse_m", of_fused(report.fused_rmse_m)},
      {"fused_p50_m", of_fused(report.fused_p50_m)},
      {"fused_p95_m", of_fused(report.fused_p95_m)},
      {"fused_max_m", of_fused(report.fused_max_m)},
      {"n", report.poses},
      {"first_fused_s", of_fused(report.first_fused_s)},
      {"nees_mean", of_fused(report.nees_mean)},
      {"dropout_error_m", or_null(report.dropout_error_m)},
      {"dropout_end_error_m", or_null(report.dropout_end_error_m)},
      {"outliers_added", report.outliers_added},
      {"outliers_refused", report.outliers_refused},
      {"latency_estimate_s", of_fused(report.latency_estimate_s)},
      {"latency_sigma_s", of_fused(report.latency_sigma_s)},
      {"latency_observed", report.latency_observed},
      {"odometry_scale", of_fused(report.odometry_scale)},
      {"ms_per_fix_median", of_time(report.ms_per_fix_median)},
      {"ms_per_fix_p95", of_time(report.ms_per_fix_p95)},
      {"ms_per_fix_max", of_time(report.ms_per_fix_max)},
      {"truth_gaps", report.truth_gaps},
      {"odometry_gaps", report.odometry_gaps}};
  if (const auto why = WhyNothingMeasured(report)) json["reason"] = *why;
  return json;
}

std::string ToText(const LocalizationReport& report) {
  std::string text;
  const nlohmann::ordered_json json = ToJson(report);
  for (const auto& [key, value] : json.items()) {
    text += key + std::string(22 - std::min<std::size_t>(21, key.size()), ' ');
    if (value.is_number_float()) {
      std::array<char, 32> number{};
      std::snprintf(number.data(), number.size(), "%.4f", value.get<double>());
      text += number.data();
    } else {
      text += value.is_null() ? "-" : value.dump();
    }
    text += '\n';
  }
  return text;
}

}  // namespace livemap::evaluation
