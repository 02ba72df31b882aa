#include "evaluation/trajectory/localization_evaluation.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "datasets/comma2k19.h"

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
