#include "evaluation/detection/detection_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "evaluation/quantile.h"

namespace livemap::evaluation {
namespace {

using ::testing::HasSubstr;

DetectionReport ExampleReport() {
  ClassFigures potholes;
  potholes.threshold = 0.4;
  potholes.frames = 7;
  potholes.labels = 3;
  potholes.ap50 = 0.25;
  potholes.precision = 0.5;
  potholes.recall = 0.75;
  potholes.events = 2;
  potholes.event_recall = 0.5;
  potholes.event_recall_iou30 = 1.0;
  potholes.false_per_km = 8.5;
  ClassFigures cones;
  cones.labels = 1;
  return {"m", 8, 12.5, 20, {{"pothole", potholes, {potholes}}, {"traffic_cone", cones, {}}}};
}

TEST(DetectionReport, JsonHasThePublishedKeys) {
  const nlohmann::ordered_json json = ToJson(ExampleReport());
  EXPECT_EQ(json["frames"], 8);
  const nlohmann::ordered_json& pothole = json["classes"]["pothole"];
  EXPECT_EQ(pothole["labels"], 3);
  EXPECT_EQ(pothole["ap50"], 0.25);
  EXPECT_EQ(pothole["precision"], 0.5);
  EXPECT_EQ(pothole["recall"], 0.75);
  EXPECT_EQ(pothole["events"], 2);
  EXPECT_EQ(pothole["event_recall"], 0.5);
  EXPECT_EQ(pothole["event_recall_iou30"], 1.0);
  EXPECT_EQ(pothole["false_per_km"], 8.5);
  EXPECT_EQ(pothole["n"], 7);
  EXPECT_EQ(pothole["sweep"].size(), 1U);
  EXPECT_EQ(json["inference_ms_p50"], 12.5);
}

TEST(DetectionReport, UndefinedFiguresAreNullInJsonAndADashInText) {
  const nlohmann::ordered_json cone = ToJson(ExampleReport())["classes"]["traffic_cone"];
  EXPECT_TRUE(cone["ap50"].is_null());
  EXPECT_TRUE(cone["event_recall"].is_null());
  EXPECT_TRUE(cone["false_per_km"].is_null());
  EXPECT_FALSE(cone.contains("sweep"));
  EXPECT_THAT(ToText(ExampleReport()), HasSubstr(" - "));
}

TEST(DetectionReport, WithoutLabelsAndRoadSaysThatNothingWasMeasured) {
  EXPECT_FALSE(ToJson(ExampleReport()).contains("reason"));
  DetectionReport report = ExampleReport();
  for (ClassReport& entry : report.classes) entry.figures = {};
  EXPECT_EQ(WhyNothingMeasured(report).value_or(""),
            "8 frames have no label of a class of the model 'm', and no drive among them has a "
            "length");
  EXPECT_TRUE(ToJson(report)["reason"].is_string());
  report.classes[0].figures.false_per_km = 0;
  EXPECT_FALSE(WhyNothingMeasured(report)) << "a drive without hazards measures false reports";
}

TEST(DetectionReport, TextNamesModelAndClasses) {
  const std::string text = ToText(ExampleReport());
  EXPECT_THAT(text, HasSubstr("model m, 8 frames"));
  EXPECT_THAT(text, HasSubstr("pothole"));
  EXPECT_THAT(text, HasSubstr("0.250"));
}

TEST(Quantile, IsTheNearestRank) {
  EXPECT_EQ(Quantile({4, 1, 3, 2}, 0.5), 2);
  EXPECT_EQ(Quantile({4, 1, 3, 2}, 0.95), 4);
  EXPECT_EQ(Quantile({4, 1, 3, 2}, 0), 1);
  EXPECT_EQ(Quantile({}, 0.5), 0);
}

}  // namespace
}  // namespace livemap::evaluation
