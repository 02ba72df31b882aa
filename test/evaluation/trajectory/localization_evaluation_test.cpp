#include "evaluation/trajectory/localization_evaluation.h"

#include <gtest/gtest.h>

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "common/time.h"
#include "datasets/comma2k19.h"
#include "geo/wgs84.h"

namespace livemap::evaluation {
namespace {

/// The real drive; nothing where it is absent.
std::optional<datasets::PositionDrive> RealDrive() {
  const char* set = std::getenv("LIVEMAP_DATA_DIR");
  const std::string data =
      set != nullptr ? set : std::string(LIVEMAP_SOURCE_DIR) + "/../shared/data";
  const std::string folder = data + "/positions/comma2k19";
  if (!std::filesystem::is_directory(folder)) return std::nullopt;
  return datasets::ReadComma2k19(folder);
}

/// As the tool's defaults.
localization::LocalizerConfig ToolConfig() {
  localization::LocalizerConfig config;
  config.receiver.shared_sigma_m = 0.4;
  return config;
}

TEST(LocalizationReport, OfNothingIsNullWithAReason) {
  LocalizationReport report;
  report.fixes = 600;
  report.compared_fixes = 600;
  report.fix_rmse_m = 2;
  report.outliers_refused = 599;
  report.fixes_used = 1;
  const nlohmann::ordered_json nothing = ToJson(report);
  for (const char* key :
       {"fused_rmse_m", "fused_p50_m", "fused_p95_m", "fused_max_m", "first_fused_s", "nees_mean",
        "latency_estimate_s", "latency_sigma_s", "odometry_scale"}) {
    EXPECT_TRUE(nothing[key].is_null()) << key;
  }
  EXPECT_EQ(nothing["n"], 0);
  EXPECT_EQ(nothing["fix_rmse_m"], 2);
  EXPECT_EQ(
      nothing["reason"],
      "no true pose has a fused one: of 600 fixes 1 were used, 599 refused as outliers, 0 out of "
      "range and 0 without odometry");
  report.poses = 1;
  EXPECT_EQ(ToJson(report)["fused_rmse_m"], 0);
  EXPECT_FALSE(ToJson(report).contains("reason"));
  report.fixes = report.compared_fixes = 0;
  EXPECT_TRUE(ToJson(report)["fix_rmse_m"].is_null());
  EXPECT_TRUE(ToJson(report)["ms_per_fix_median"].is_null());
}

TEST(LocalizationReport, OfNothingExplainsEveryFix) {
  LocalizationReport report;
  report.fixes = 600;
  report.fixes_used = 1;
  report.fixes_without_odometry = 9;
  report.fixes_out_of_order = 2;
  EXPECT_NE(ToJson(report)["reason"].get<std::string>().find(
                "2 were out of order, 588 were still waiting for a heading"),
            std::string::npos)
      << ToJson(report)["reason"];
  report.fix_span = TimeSpan{500, 512};
  report.truth_span = TimeSpan{0, 12.5};
  EXPECT_NE(ToJson(report)["reason"].get<std::string>().find(
                "the fixes reach from 500.000 to 512.000 s, the true poses from 0.000 to 12.500 s"),
            std::string::npos)
      << ToJson(report)["reason"];
}

/// A street that bends all the time, so that a straight line across a gap is far from it: fixes at
/// 10 Hz, poses at 20 Hz and speeds at 50 Hz, all exact, from second `from_s` on.
datasets::PositionDrive BendingDrive(double from_s, double length_s) {
  constexpr double kSpeedMps = 10;
  constexpr double kYawRateRps = 0.1;
  const GeographicLib::LocalCartesian plane(48, 11, 0);
  datasets::PositionDrive drive;
  const auto stamp = [from_s](double s) { return Nanoseconds(from_s + s); };
  const auto place = [](double s) {
    const double radius_m = kSpeedMps / kYawRateRps;
    return Eigen::Vector2d(radius_m * std::sin(kYawRateRps * s),
                           radius_m * (1 - std::cos(kYawRateRps * s)));
  };
  for (int i = 0; i <= static_cast<int>(10 * length_s); ++i) {
    const Eigen::Vector2d at = place(i / 10.0);
    double height_m = 0;
    geo::GeoPoint point;
    plane.Reverse(at.x(), at.y(), 0, point.latitude_deg, point.longitude_deg, height_m);
    drive.fixes.push_back({stamp(i / 10.0), point});
  }
  for (int i = 0; i <= static_cast<int>(20 * length_s); ++i) {
    const Eigen::Vector2d at = place(i / 20.0);
    double latitude_deg = 0;
    double longitude_deg = 0;
    double height_m = 0;
    plane.Reverse(at.x(), at.y(), 0, latitude_deg, longitude_deg, height_m);
    datasets::RecordedPose pose;
    pose.stamp_ns = stamp(i / 20.0);
    GeographicLib::Geocentric::WGS84().Forward(latitude_deg, longitude_deg, 0, pose.earth_m.x(),
                                               pose.earth_m.y(), pose.earth_m.z());
    const Eigen::Matrix3d earth_from_enu =
        geo::LocalFrame({latitude_deg, longitude_deg}).InEarth().linear();
    pose.earth_from_vehicle = Eigen::Quaterniond(
        earth_from_enu *
        Eigen::AngleAxisd(kYawRateRps * i / 20.0, Eigen::Vector3d::UnitZ()).toRotationMatrix());
    drive.poses.push_back(pose);
  }
  for (int i = 0; i <= static_cast<int>(50 * length_s); ++i) {
    drive.speeds.push_back({stamp(i / 50.0), kSpeedMps});
  }
  return drive;
}

template <typename Stamped>
void CutOut(std::vector<Stamped>& records, double from_s, double to_s) {
  records.erase(std::remove_if(records.begin(), records.end(),
                               [&](const Stamped& record) {
                                 return Seconds(record.stamp_ns) > from_s &&
                                        Seconds(record.stamp_ns) < to_s;
                               }),
                records.end());
}

/// Without a receiver's latency, as the fixes are exact.
localization::LocalizerConfig ExactConfig() {
  localization::LocalizerConfig config = ToolConfig();
  config.receiver.latency_s = 0;
  config.receiver.latency_sigma_s = 0;
  return config;
}

TEST(LocalizationEvaluation, NothingIsComparedAcrossAGapOfTheTruePoses) {
  datasets::PositionDrive drive = BendingDrive(100, 60);
  const LocalizationReport whole = EvaluateLocalization(drive, ExactConfig(), {});
  EXPECT_EQ(whole.truth_gaps + whole.odometry_gaps, 0U);
  EXPECT_TRUE(NotesOf(whole).empty());
  EXPECT_LT(whole.fused_max_m, 1);
  CutOut(drive.poses, 120, 145);
  const LocalizationReport report = EvaluateLocalization(drive, ExactConfig(), {});
  EXPECT_EQ(report.truth_gaps, 1U);
  EXPECT_EQ(report.odometry_gaps, 1U) << "the heading is that of the true poses";
  EXPECT_EQ(NotesOf(report).size(), 2U);
  EXPECT_LT(report.compared_fixes, whole.compared_fixes - 240);
  EXPECT_LT(report.fix_rmse_m, 0.1) << "a straight line across the gap is 30 m from the street";
  EXPECT_LT(report.fused_max_m, 5);
  EXPECT_GT(report.poses, 600U);
  EXPECT_EQ(ToJson(report)["truth_gaps"], 1);
}

TEST(LocalizationEvaluation, WheelSpeedIsNotIntegratedAcrossAGap) {
  datasets::PositionDrive drive = BendingDrive(100, 60);
  CutOut(drive.speeds, 120, 145);
  const LocalizationReport report = EvaluateLocalization(drive, ExactConfig(), {});
  EXPECT_EQ(report.truth_gaps, 0U);
  EXPECT_EQ(report.odometry_gaps, 1U);
  EXPECT_LT(report.fused_max_m, 5);
  EXPECT_GT(report.poses, 600U);
}

TEST(LocalizationEvaluation, ADriveMayBeginAtItsOwnZero) {
  const LocalizationReport later = EvaluateLocalization(BendingDrive(100, 20), ExactConfig(), {});
  const LocalizationReport report = EvaluateLocalization(BendingDrive(0, 20), ExactConfig(), {});
  EXPECT_EQ(report.fixes_invalid, 0U);
  EXPECT_EQ(report.poses, later.poses);
}

TEST(LocalizationEvaluation, RealFixesAreShiftedIntoPlace) {
  const auto drive = RealDrive();
  if (!drive) GTEST_SKIP() << "skipped, no data";
  const LocalizationReport report = EvaluateLocalization(*drive, ToolConfig(), {});
  EXPECT_EQ(report.fixes, 579U);
  EXPECT_NEAR(report.fix_rmse_m, 1.47, 0.01);
  EXPECT_LE(report.fused_rmse_m, 0.6);
  EXPECT_GT(report.poses, 1150U);
  EXPECT_EQ(report.outliers_refused, 0U);
  EXPECT_NEAR(report.latency_estimate_s, 0.09, 0.02);
  EXPECT_LT(report.nees_mean, 3);
}

TEST(LocalizationEvaluation, NoiseAndOutliersAreBorne) {
  const auto drive = RealDrive();
  if (!drive) GTEST_SKIP() << "skipped, no data";
  LocalizationTrial trial;
  trial.noise_m = 2;
  trial.outlier_share = 0.05;
  double sum_m = 0;
  constexpr int kSeeds = 8;
  for (trial.seed = 1; trial.seed <= kSeeds; ++trial.seed) {
    const LocalizationReport report = EvaluateLocalization(*drive, ToolConfig(), trial);
    sum_m += report.fused_rmse_m;
    EXPECT_LT(report.fused_rmse_m, 1.1);
    EXPECT_NEAR(static_cast<double>(report.outliers_refused),
                static_cast<double>(report.outliers_added), 5);
  }
  EXPECT_LE(sum_m / kSeeds, 0.8);
}

TEST(LocalizationEvaluation, DropOutCostsLittle) {
  const auto drive = RealDrive();
  if (!drive) GTEST_SKIP() << "skipped, no data";
  LocalizationTrial trial;
  trial.dropout_s = 10;
  for (const double start_s : {10.0, 20.0, 30.0, 40.0, 47.0}) {
    trial.dropout_start_s = start_s;
    const LocalizationReport report = EvaluateLocalization(*drive, ToolConfig(), trial);
    ASSERT_TRUE(report.dropout_error_m);
    EXPECT_LT(*report.dropout_error_m, 3) << start_s;
  }
}

}  // namespace
}  // namespace livemap::evaluation
