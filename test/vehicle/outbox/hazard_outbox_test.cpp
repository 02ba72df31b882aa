#include <gmock/gmock.h>

#include <random>
#include <string>
#include <utility>
#include <vector>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

TEST_F(HazardReporterTest, ReportIsSentAgainUntilTheReceiptAlsoAfterARestart) {
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  const auto first = TakeDue();
  ASSERT_THAT(first, SizeIs(1));
  EXPECT_THAT(TakeDue(), IsEmpty());
  steady_s_ += 1.5;
  EXPECT_EQ(TakeDue().at(0).uuid, first[0].uuid);
  EXPECT_EQ(counters().reports_sent, 1u);
  EXPECT_EQ(counters().resends, 1u);

  Restart();
  const auto again = TakeDue();
  ASSERT_THAT(again, SizeIs(1));
  EXPECT_EQ(again[0].uuid, first[0].uuid);
  EXPECT_EQ(again[0].image, first[0].image);
  EXPECT_EQ(counters().reports_sent, 0u) << "it was sent before";
  EXPECT_EQ(counters().resends, 1u);

  protocol::Receipt receipt;
  receipt.status = protocol::Receipt::Status::kCommitted;
  receipt.report_uuid = first[0].uuid;
  receipt.hazard_uuid.bytes[0] = 9;
  reporter_->AddReceipt(receipt);
  reporter_->AddReceipt(receipt);
  EXPECT_EQ(counters().committed, 1u);
  steady_s_ += 100;
  EXPECT_THAT(TakeDue(), IsEmpty());
  DriveFixes(0, 4);
  See(3.5, {{"pothole", 0.8F, BoxAt(4, 0)}});
  EXPECT_EQ(counters().duplicates_suppressed, 1u) << "remembered over the restart";
}

TEST_F(HazardReporterTest, ReceiptForAnotherReportEndsNothing) {
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  protocol::Receipt receipt;
  receipt.status = protocol::Receipt::Status::kRefused;
  receipt.report_uuid.bytes[3] = 77;
  reporter_->AddReceipt(receipt);
  EXPECT_EQ(counters().refused, 0u);
  EXPECT_EQ(reporter_->map().pending_count(), 1u);
}

protocol::Report ReportOf(int number, const std::string& class_name) {
  protocol::Report report;
  report.uuid.bytes[0] = 1;
  report.uuid.bytes[15] = static_cast<std::uint8_t>(number);
  report.stamp_ns = kEpochNs + number * 1'000'000'000LL;
  report.class_name = class_name;
  report.confidence = 0.5F;
  report.box = {1, 2, 3, 4};
  report.position = geo::GeodesicDestination(kStart, 0, 100.0 * number);
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  return report;
}

TEST_F(HazardReporterTest, AfterARestartUrgentReportsGoFirstAndThenTheOldest) {
  const auto catalogue = protocol::HazardCatalogue::Parse(
      "classes:\n  deer: {urgency: 1}\n  cone: {urgency: 2}\n  pothole: {urgency: 3}\n", "test");
  const std::vector<std::pair<int, std::string>> stored = {
      {1, "pothole"}, {5, "cone"}, {4, "deer"}, {2, "pothole"}, {3, "cone"}, {6, "deer"}};
  config_.map.path += ".order";
  {
    LocalHazardMap map(config_.map, catalogue, kEpochNs);
    for (const auto& [number, name] : stored) map.Add(ReportOf(number, name));
  }
  HazardReporter reporter(config_, catalogue, std::mt19937_64(1), kEpochNs, steady_s_);
  std::vector<int> order;
  while (true) {
    const auto due = reporter.TakeDue(steady_s_, 1);
    if (due.empty()) break;
    order.push_back(due[0].uuid.bytes[15]);
  }
  EXPECT_EQ(order, (std::vector<int>{4, 6, 3, 5, 1, 2}));
}

/// Ranks as in config/hazards.yaml, on a link that costs.
class HeldReportTest : public HazardReporterTest {
 protected:
  HeldReportTest() {
    catalogue_ = protocol::HazardCatalogue::Parse(
        "classes:\n  deer: {urgency: 1}\n  cone: {urgency: 2}\n  pothole: {urgency: 3}\n", "test");
    Restart();
    reporter_->SetLink(LinkCost::kMetered);
    DriveFixes(0, 4);
  }
  std::vector<std::string> Sent() {
    std::vector<std::string> classes;
    for (const protocol::Report& report : TakeDue()) classes.push_back(report.class_name);
    return classes;
  }
};

TEST_F(HeldReportTest, OnADearLinkOnlyUrgentReportsGoAtOnceOthersAtTheirLimit) {
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)},
            {"deer", 0.8F, BoxAt(12, 1)},
            {"cone", 0.8F, BoxAt(12, -1)}});
  EXPECT_THAT(Sent(), ElementsAre("deer"));
  EXPECT_EQ(reporter_->HeldReports(steady_s_), 2u);
  steady_s_ += config_.hold_s[1];
  EXPECT_THAT(Sent(), UnorderedElementsAre("deer", "cone"));
  EXPECT_EQ(reporter_->HeldReports(steady_s_), 1u);
  steady_s_ += config_.hold_s[2] - config_.hold_s[1];
  EXPECT_THAT(Sent(), Contains("pothole"));
}

TEST_F(HeldReportTest, ACheapLinkLetsAllGoUrgentFirst) {
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}, {"cone", 0.8F, BoxAt(12, -1)}});
  EXPECT_THAT(Sent(), IsEmpty());
  reporter_->SetLink(LinkCost::kNone);
  EXPECT_THAT(Sent(), IsEmpty());
  reporter_->SetLink(LinkCost::kCheap);
  EXPECT_THAT(Sent(), ElementsAre("cone", "pothole"));
}

TEST_F(HeldReportTest, ALinkOfWhichNobodySpeaksHoldsNothingUnlessItIsSaid) {
  reporter_->SetLink(LinkCost::kUnknown);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(Sent(), ElementsAre("pothole"));
  config_.unknown_link_is_cheap = false;
  config_.map.path += ".other";
  Restart();
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(Sent(), IsEmpty());
}

TEST_F(HeldReportTest, ItsLimitSurvivesARestartAndCountsTheTimeInBetween) {
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  steady_s_ = 7;  // Another boot: the steady clock begins anew.
  const double away_s = 5000;
  Restart(away_s);
  EXPECT_THAT(Sent(), IsEmpty()) << "the word about the link may come yet";
  reporter_->SetLink(LinkCost::kMetered);
  steady_s_ += config_.hold_s[2] - away_s - 1;
  EXPECT_THAT(Sent(), IsEmpty());
  steady_s_ += 1.001;
  EXPECT_THAT(Sent(), ElementsAre("pothole"));
  EXPECT_EQ(counters().reports_sent, 1u);
}

TEST_F(HeldReportTest, AfterARestartWithoutAWordAboutTheLinkItGoesWhenThatHadTimeToCome) {
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  Restart(60);
  steady_s_ += config_.link_wait_s - 0.1;
  EXPECT_THAT(Sent(), IsEmpty());
  steady_s_ += 0.2;
  EXPECT_THAT(Sent(), ElementsAre("pothole"));
}

TEST_F(HeldReportTest, AClockThatWasSetBackHoldsItNoLongerThanFromTheStart) {
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  Restart(-10 * 365 * 86400.0);
  reporter_->SetLink(LinkCost::kMetered);
  steady_s_ += config_.hold_s[2] - 1;
  EXPECT_THAT(Sent(), IsEmpty());
  steady_s_ += 1.001;
  EXPECT_THAT(Sent(), ElementsAre("pothole"));
}

TEST_F(HazardReporterTest, AHazardThatTheZoneNeverAnnouncedIsReportedAnewAfterItsClasssLife) {
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  protocol::Receipt receipt;
  receipt.status = protocol::Receipt::Status::kCommitted;
  receipt.report_uuid = TakeDue().at(0).uuid;
  receipt.hazard_uuid.bytes[0] = 9;
  reporter_->AddReceipt(receipt);
  const double life_s = protocol::HazardCatalogue().Get("pothole").expected_life_s;
  const double now_s = static_cast<double>(kEpochNs) * 1e-9;
  reporter_->Process(now_s + life_s - 60, steady_s_);
  EXPECT_EQ(reporter_->map().known_count(), 1u);
  reporter_->Process(now_s + life_s + 64, steady_s_);
  EXPECT_EQ(reporter_->map().known_count(), 0u) << "the zone gave it up and told nobody";
  EXPECT_EQ(counters().forgotten_unannounced, 1u);
}

TEST_F(HazardReporterTest, AReportForAZoneThatHasLeftTheDirectoryGoesToTheOneOfItsPlace) {
  config_.map.zone = "west";
  Restart();
  std::string of_place = "east";
  reporter_->SetZones({[&](const geo::GeoPoint&) { return of_place; },
                       [&](const std::string& zone) { return zone == "east" && of_place != zone; },
                       {}});
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_EQ(TakeDue().at(0).zone, "east");
  of_place = "north";
  steady_s_ += 3600;
  const auto again = TakeDue();
  ASSERT_EQ(again.size(), 1U);
  EXPECT_EQ(again[0].zone, "north");
  EXPECT_EQ(counters().redirected, 1U);
  steady_s_ += 3600;
  EXPECT_EQ(TakeDue().at(0).zone, "north");
  EXPECT_EQ(counters().redirected, 1U) << "it was given away once";
  protocol::Receipt receipt;
  receipt.report_uuid = again[0].uuid;
  receipt.hazard_uuid.bytes[0] = 9;
  receipt.zone = "east";
  reporter_->AddReceipt(receipt);
  EXPECT_EQ(reporter_->map().pending_count(), 1U) << "it is no longer for east to answer";
  receipt.zone = "north";
  reporter_->AddReceipt(receipt);
  EXPECT_EQ(reporter_->map().pending_count(), 0U);
}

}  // namespace
}  // namespace livemap::vehicle
