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

geo::GeoPoint ToGeo(const Eigen::Vector3d& earth_m) {
  geo::GeoPoint point;
  double height_m = 0;
  GeographicLib::Geocentric::WGS84().Reverse(earth_m.x(), earth_m.y(), earth_m.z(),
                                             point.latitude_deg, point.longitude_deg, height_m);
  return point;
}

/// Truth on the plane of `frame`, the heading continuous.
std::vector<TruePose> Truth(const datasets::PositionDrive& drive, const geo::LocalFrame& frame) {
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
    truth.push_back({pose.stamp_ns, {frame.ToEnu(ToGeo(pose.earth_m)), yaw_rad}});
  }
  return truth;
}

/// Between two true poses; none outside of them.
std::optional<localization::PlanarPose> TrueAt(const std::vector<TruePose>& truth,
                                               std::int64_t stamp_ns) {
  const auto after = std::lower_bound(
      truth.begin(), truth.end(), stamp_ns,
      [](const TruePose& pose, std::int64_t moment_ns) { return pose.stamp_ns < moment_ns; });
  if (after == truth.end()) return std::nullopt;
  if (after->stamp_ns == stamp_ns) return after->pose;
  if (after == truth.begin()) return std::nullopt;
  const TruePose& before = *std::prev(after);
  const double share =
      Seconds(stamp_ns - before.stamp_ns) / Seconds(after->stamp_ns - before.stamp_ns);
  return localization::PlanarPose{
      before.pose.position_m + share * (after->pose.position_m - before.pose.position_m),
      before.pose.yaw_rad + share * (after->pose.yaw_rad - before.pose.yaw_rad)};
}

/// Wheel speed along a heading that has a gyro's errors: poses in the odometry's frame.
std::vector<TruePose> Odometry(const datasets::PositionDrive& drive,
                               const std::vector<TruePose>& truth, const LocalizationTrial& trial,
                               datasets::SeededRandom& random) {
  const double bias_rps = trial.gyro_bias_sigma_rps * random.Normal().x();
  std::vector<TruePose> odometry;
  double error_rad = 0;
  double heading_before_rad = 0;
  double speed_before_mps = 0;
  for (const datasets::RecordedSpeed& speed : drive.speeds) {
    const auto true_pose = TrueAt(truth, speed.stamp_ns);
    if (!true_pose) continue;
    if (odometry.empty()) {
      // Begins at its own origin, turned as it likes.
      heading_before_rad = true_pose->yaw_rad;
      odometry.push_back({speed.stamp_ns, {}});
    } else {
      const double time_s = Seconds(speed.stamp_ns - odometry.back().stamp_ns);
      error_rad = bias_rps * time_s + trial.gyro_walk_rad * std::sqrt(time_s) * random.Normal().x();
      const double turn_rad = true_pose->yaw_rad - heading_before_rad + error_rad;
      const localization::PlanarPose& before = odometry.back().pose;
      const double way_m = 0.5 * (speed.speed_mps + speed_before_mps) * time_s;
      const Eigen::Vector2d step_m =
          localization::Rotation2(before.yaw_rad + 0.5 * turn_rad) * Eigen::Vector2d(way_m, 0);
      odometry.push_back({speed.stamp_ns, {before.position_m + step_m, before.yaw_rad + turn_rad}});
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

std::vector<TrialFix> Fixes(const datasets::PositionDrive& drive, const LocalizationTrial& trial,
                            datasets::SeededRandom& random) {
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
  localization::LocalizerCounters counters;
  localization::LatencyEstimate latency;
  double odometry_scale = 1;
};

class Runner {
 public:
  Runner(const datasets::PositionDrive& drive, const LocalizationTrial& trial)
      : drive_(drive), trial_(trial), frame_(ToGeo(drive.poses.front().earth_m)) {
    truth_ = Truth(drive, frame_);
    // One seed for both, so that a drop-out changes no noise.
    datasets::SeededRandom random(trial.seed);
    odometry_ = Odometry(drive, truth_, trial, random);
    fixes_ = Fixes(drive, trial, random);
    if (odometry_.size() < 2) throw Error("the drive's wheel speed and poses share no time");
  }

  const std::vector<TruePose>& truth() const { return truth_; }

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
          AddOdometry(localizer, odometry_[next_odometry++]);
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
  static void AddOdometry(localization::GeoLocalizer& localizer, const TruePose& odometry) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear().topLeftCorner<2, 2>() = localization::Rotation2(odometry.pose.yaw_rad);
    pose.translation().head<2>() = odometry.pose.position_m;
    localizer.AddOdometry(odometry.stamp_ns, pose);
  }

  void AddFix(localization::GeoLocalizer& localizer, const TrialFix& fix, bool with_dropout,
              Run& run) const {
    if (with_dropout && InDropout(fix.fix.stamp_ns)) return;
    const auto start = std::chrono::steady_clock::now();
    localizer.AddFix(fix.fix);
    run.milliseconds.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    ++run.fixes;
    run.outliers_added += fix.outlier ? 1 : 0;
    if (const auto true_pose = TrueAt(truth_, fix.fix.stamp_ns)) {
      run.fix_square_sum += (frame_.ToEnu(fix.fix.position) - true_pose->position_m).squaredNorm();
      ++run.compared_fixes;
    }
  }

  void Compare(const localization::GeoLocalizer& localizer, const TruePose& true_pose,
               Run& run) const {
    const auto fused = localizer.Fused(true_pose.stamp_ns);
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
  std::vector<TruePose> odometry_;
  std::vector<TrialFix> fixes_;
};

double Rmse(const std::vector<double>& errors_m) {
  double sum = 0;
  for (const double error_m : errors_m) sum += error_m * error_m;
  return errors_m.empty() ? 0 : std::sqrt(sum / static_cast<double>(errors_m.size()));
}

/// How far the drop-out moved the fused position, at most and at its end.
void AddDropout(const Runner& runner, const Run& with, const Run& without,
                LocalizationReport& report) {
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
  const Runner runner(drive, trial);
  const bool with_dropout = trial.dropout_s > 0;
  const Run run = runner.Drive(config, with_dropout);
  LocalizationReport report;
  report.fixes = run.fixes;
  report.fix_rmse_m = run.compared_fixes == 0
                          ? 0
                          : std::sqrt(run.fix_square_sum / static_cast<double>(run.compared_fixes));
  report.fused_rmse_m = Rmse(run.errors_m);
  report.fused_p50_m = Quantile(run.errors_m, 0.5);
  report.fused_p95_m = Quantile(run.errors_m, 0.95);
  report.fused_max_m = Quantile(run.errors_m, 1);
  report.poses = run.errors_m.size();
  if (!run.fused_m.empty()) {
    report.first_fused_s = Seconds(run.fused_m.begin()->first - drive.fixes.front().stamp_ns);
    report.nees_mean = run.nees_sum / static_cast<double>(run.errors_m.size());
  }
  if (with_dropout) AddDropout(runner, run, runner.Drive(config, false), report);
  report.outliers_added = run.outliers_added;
  report.outliers_refused = run.counters.fixes_refused;
  report.latency_estimate_s = run.latency.value_s;
  report.latency_sigma_s = run.latency.sigma_s;
  report.latency_observed = run.latency.observed;
  report.odometry_scale = run.odometry_scale;
  report.ms_per_fix_median = Quantile(run.milliseconds, 0.5);
  report.ms_per_fix_p95 = Quantile(run.milliseconds, 0.95);
  report.ms_per_fix_max = Quantile(run.milliseconds, 1);
  return report;
}

nlohmann::ordered_json ToJson(const LocalizationReport& report) {
  const auto or_null = [](const std::optional<double>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
  };
  return {{"fixes", report.fixes},
          {"fix_rmse_m", report.fix_rmse_m},
          {"fused_rmse_m", report.fused_rmse_m},
          {"fused_p50_m", report.fused_p50_m},
          {"fused_p95_m", report.fused_p95_m},
          {"fused_max_m", report.fused_max_m},
          {"n", report.poses},
          {"first_fused_s", report.first_fused_s},
          {"nees_mean", report.nees_mean},
          {"dropout_error_m", or_null(report.dropout_error_m)},
          {"dropout_end_error_m", or_null(report.dropout_end_error_m)},
          {"outliers_added", report.outliers_added},
          {"outliers_refused", report.outliers_refused},
          {"latency_estimate_s", report.latency_estimate_s},
          {"latency_sigma_s", report.latency_sigma_s},
          {"latency_observed", report.latency_observed},
          {"odometry_scale", report.odometry_scale},
          {"ms_per_fix_median", report.ms_per_fix_median},
          {"ms_per_fix_p95", report.ms_per_fix_p95},
          {"ms_per_fix_max", report.ms_per_fix_max}};
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
