#include "zone/offload/offload_intake.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "test/zone/offload/offloaded_frames.h"
#include "zone/admission/report_validation.h"

namespace livemap::zone {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

class CandidateIntakeTest : public ::testing::Test {
 protected:
  CandidateIntakeTest() { config_.max_ground_sigma_m = 100; }

  OffloadIntake Intake() const {
    return {config_, protocol::HazardCatalogue::Load(LIVEMAP_SOURCE_DIR "/config/hazards.yaml")};
  }

  OffloadIntake::Config config_;
};

TEST_F(CandidateIntakeTest, AHazardIsPlacedByThePoseOfItsFrame) {
  OffloadIntake intake = Intake();
  EXPECT_EQ(intake.Add(CandidateAt(0), kZoneNowNs), "");
  const OffloadIntake::Job* job = intake.Next(kZoneNowNs, 0);
  ASSERT_NE(job, nullptr);
  const auto reports = intake.Finish(job->internal_ns, AnswerOf(job->internal_ns, 12, -1.5));
  ASSERT_THAT(reports, SizeIs(1));
  const protocol::Report& report = reports[0];
  const protocol::OffloadedFrame frame = CandidateAt(0);
  const geo::GeoPoint ahead = geo::GeodesicDestination(frame.base.position, M_PI / 4, 12);
  const geo::GeoPoint foot = geo::GeodesicDestination(ahead, M_PI / 4 + M_PI / 2, 1.5);
  // Its middle, as a big vehicle reports it: a pothole's lies 0.4 m behind its near edge.
  const geo::GeoPoint expected =
      geo::GeodesicDestination(foot, M_PI / 4 + std::atan2(1.5, 12.0), 0.4);
  EXPECT_LT(geo::GeodesicDistanceM(report.position, expected), 0.01);
  EXPECT_EQ(report.vehicle_id, "car-1");
  EXPECT_EQ(report.drive_id, "drive-1");
  EXPECT_EQ(report.stamp_ns, frame.stamp_ns) << "the vehicle's, not the zone's own";
  EXPECT_EQ(report.class_name, "pothole");
  EXPECT_EQ(report.image_frame_id, "camera_optical_frame");
  EXPECT_FALSE(WhyRefused(report, ReportLimits(), kZoneNowNs)) << "as the zone takes reports";
  EXPECT_EQ(intake.counters().reports, 1U);
  EXPECT_EQ(intake.in_flight(), 0U);
}

TEST_F(CandidateIntakeTest, EqualStampsOfTwoVehiclesStayApart) {
  OffloadIntake intake = Intake();
  intake.Add(CandidateAt(0, "car-1"), kZoneNowNs);
  intake.Add(CandidateAt(0, "car-2"), kZoneNowNs);
  const std::int64_t first = intake.Next(kZoneNowNs, 0)->internal_ns;
  const std::int64_t second = intake.Next(kZoneNowNs, 0)->internal_ns;
  ASSERT_LT(first, second);
  const auto of_second = intake.Finish(second, AnswerOf(second, 10, 0));
  const auto of_first = intake.Finish(first, AnswerOf(first, 10, 0));
  ASSERT_THAT(of_first, SizeIs(1));
  ASSERT_THAT(of_second, SizeIs(1));
  EXPECT_EQ(of_first[0].vehicle_id, "car-1");
  EXPECT_EQ(of_second[0].vehicle_id, "car-2");
  EXPECT_NE(of_first[0].uuid, of_second[0].uuid);
}

TEST_F(CandidateIntakeTest, AFrameThatComesTwiceIsDetectedOnce) {
  OffloadIntake intake = Intake();
  EXPECT_EQ(intake.Add(CandidateAt(0), kZoneNowNs), "");
  EXPECT_EQ(intake.Add(CandidateAt(0), kZoneNowNs), "frame came before");
  EXPECT_EQ(intake.counters().repeated, 1U);
  EXPECT_EQ(intake.waiting(), 1U);
}

TEST_F(CandidateIntakeTest, AFrameThatIsSentAgainDoesNotAgreeWithItself) {
  OffloadIntake intake = Intake();
  EXPECT_EQ(intake.Add(CandidateAt(0), kZoneNowNs), "");
  protocol::OffloadedFrame far = CandidateAt(1);
  far.base.position = {47.5, 19.04};
  for (int i = 0; i < 5; ++i) EXPECT_NE(intake.Add(far, kZoneNowNs), "") << i;
  EXPECT_EQ(intake.counters().too_fast, 1U);
  EXPECT_EQ(intake.counters().repeated, 4U);
  EXPECT_EQ(intake.waiting(), 1U);
}

TEST_F(CandidateIntakeTest, AFullTableForgetsTheLongestSilentVehicleAlone) {
  config_.allowance.max_vehicles = 2;
  OffloadIntake intake = Intake();
  const auto after = [](double seconds) {
    return kZoneNowNs + static_cast<std::int64_t>(seconds * 1e9);
  };
  EXPECT_EQ(intake.Add(CandidateAt(0, "car-1"), after(0)), "");
  EXPECT_EQ(intake.Add(CandidateAt(30, "car-2"), after(30)), "");
  EXPECT_EQ(intake.Add(CandidateAt(70, "car-3"), after(70)), "");
  protocol::OffloadedFrame far = CandidateAt(71, "car-2");
  far.base.position = {47.5, 19.04};
  EXPECT_NE(intake.Add(far, after(71)), "");
  EXPECT_EQ(intake.counters().too_fast, 1U);
}

TEST_F(CandidateIntakeTest, TheSameBoxInTheSameFrameIsTheSameReportAfterARestartToo) {
  const auto uuid_now = [this] {
    OffloadIntake intake = Intake();
    intake.Add(CandidateAt(0), kZoneNowNs);
    const std::int64_t stamp = intake.Next(kZoneNowNs, 0)->internal_ns;
    return intake.Finish(stamp, AnswerOf(stamp, 10, 0)).at(0).uuid;
  };
  const Uuid uuid = uuid_now();
  EXPECT_EQ(uuid, uuid_now());
  EXPECT_EQ(uuid.bytes[6] >> 4, 8) << "a version 8 UUID";
  EXPECT_EQ(uuid.bytes[8] >> 6, 2);
}

TEST(OffloadReportUuid, EveryPartOfItsNameCounts) {
  const imaging::Box box{1, 2, 3, 4};
  const Uuid uuid = OffloadReportUuid("car-1", 5, "pothole", box);
  EXPECT_NE(uuid, OffloadReportUuid("car-2", 5, "pothole", box));
  EXPECT_NE(uuid, OffloadReportUuid("car-1", 6, "pothole", box));
  EXPECT_NE(uuid, OffloadReportUuid("car-1", 5, "deer", box));
  EXPECT_NE(uuid, OffloadReportUuid("car-1", 5, "pothole", {1, 2, 3.2F, 4}));
  EXPECT_EQ(uuid, OffloadReportUuid("car-1", 5, "pothole", {1.01F, 2, 3, 4}));
}

TEST_F(CandidateIntakeTest, WhatIsTooFarOrNotOnTheRoadIsNotReported) {
  OffloadIntake intake = Intake();
  intake.Add(CandidateAt(0), kZoneNowNs);
  const std::int64_t stamp = intake.Next(kZoneNowNs, 0)->internal_ns;
  placement::SightingFrame answer = AnswerOf(stamp, 31, 0);
  answer.sightings.push_back({"deer", 0.9F, {100, 10, 200, 100}});  // Ends above the horizon.
  answer.sightings.push_back({"deer", 0.9F, {100, 10, std::nanf(""), 100}});
  answer.sightings.push_back({"deer", 0.9F, {0, 200, 100, 390}});  // Its foot may be out of view.
  EXPECT_THAT(intake.Finish(stamp, answer), IsEmpty());
  EXPECT_EQ(intake.counters().cut_by_side, 1U);
  EXPECT_EQ(intake.counters().too_far, 1U);
  EXPECT_EQ(intake.counters().not_on_ground, 1U);
  EXPECT_EQ(intake.counters().invalid_sightings, 1U);
}

TEST_F(CandidateIntakeTest, TheDetectorHasNeverMoreThanItTakes) {
  config_.max_in_flight = 2;
  OffloadIntake intake = Intake();
  for (int i = 0; i < 5; ++i) intake.Add(CandidateAt(0.3 * i), kZoneNowNs);
  const OffloadIntake::Job* first = intake.Next(kZoneNowNs, 0);
  ASSERT_NE(first, nullptr);
  ASSERT_NE(intake.Next(kZoneNowNs, 0), nullptr);
  EXPECT_EQ(intake.Next(kZoneNowNs, 0), nullptr);
  intake.Finish(first->internal_ns, {});
  EXPECT_NE(intake.Next(kZoneNowNs, 0), nullptr);
  EXPECT_EQ(intake.counters().empty, 1U);
}

TEST_F(CandidateIntakeTest, AFrameThatTheDetectorLostMakesRoomAfterItsTime) {
  config_.max_in_flight = 1;
  OffloadIntake intake = Intake();
  intake.Add(CandidateAt(0), kZoneNowNs);
  intake.Add(CandidateAt(1), kZoneNowNs);
  const std::int64_t lost = intake.Next(kZoneNowNs, 100)->internal_ns;
  EXPECT_THAT(intake.Expire(109), IsEmpty());
  EXPECT_THAT(intake.Expire(110), ::testing::ElementsAre(lost));
  EXPECT_NE(intake.Next(kZoneNowNs, 110), nullptr);
  EXPECT_THAT(intake.Finish(lost, AnswerOf(lost, 10, 0)), IsEmpty()) << "too late";
  EXPECT_EQ(intake.counters().lost_by_detector, 1U);
}

TEST_F(CandidateIntakeTest, WhenTheDetectorIsBehindTheOldestFramesGoAndAreCounted) {
  config_.max_waiting = 3;
  OffloadIntake intake = Intake();
  for (int i = 0; i < 10; ++i) intake.Add(CandidateAt(i), kZoneNowNs);
  EXPECT_EQ(intake.waiting(), 3U);
  EXPECT_EQ(intake.counters().displaced, 7U);
  EXPECT_EQ(intake.Next(kZoneNowNs, 0)->frame.stamp_ns, CandidateAt(7).stamp_ns);
}

TEST_F(CandidateIntakeTest, PicturesThatWaitAreBoundedInBytes) {
  config_.max_waiting_bytes = 2.5 * static_cast<double>(CandidateAt(0).image.size());
  OffloadIntake intake = Intake();
  for (int i = 0; i < 10; ++i) intake.Add(CandidateAt(i), kZoneNowNs);
  EXPECT_EQ(intake.waiting(), 2U);
}

TEST_F(CandidateIntakeTest, AVehicleBeyondItsAllowanceIsNotHeardOthersAre) {
  config_.allowance.frames_per_minute = 3;
  OffloadIntake intake = Intake();
  for (int i = 0; i < 10; ++i) intake.Add(CandidateAt(i), kZoneNowNs);
  EXPECT_EQ(intake.counters().over_allowance, 7U);
  EXPECT_EQ(intake.Add(CandidateAt(0, "car-2"), kZoneNowNs), "");
}

TEST_F(CandidateIntakeTest, BrokenFramesAreCountedAndEveryFrameIsAccountedFor) {
  OffloadIntake intake = Intake();
  protocol::OffloadedFrame broken = CandidateAt(0);
  broken.base.course_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(intake.Add(broken, kZoneNowNs), "");
  intake.Add(CandidateAt(1), kZoneNowNs);
  intake.Add(CandidateAt(2), kZoneNowNs);
  intake.Abandon(intake.Next(kZoneNowNs, 0)->internal_ns);
  const auto& counters = intake.counters();
  EXPECT_EQ(counters.refused, 1U);
  EXPECT_EQ(counters.undecodable, 1U);
  EXPECT_EQ(counters.frames, counters.refused + counters.over_allowance + counters.repeated +
                                 counters.displaced + counters.undecodable +
                                 counters.lost_by_detector + counters.detected + intake.waiting() +
                                 intake.in_flight());
}

TEST_F(CandidateIntakeTest, InternalStampsRiseWhateverTheClockDoes) {
  OffloadIntake intake = Intake();
  intake.Add(CandidateAt(0), kZoneNowNs);
  intake.Add(CandidateAt(1), kZoneNowNs);
  const std::int64_t first = intake.Next(kZoneNowNs, 0)->internal_ns;
  EXPECT_GT(intake.Next(kZoneNowNs - 1'000'000'000, 0)->internal_ns, first);
}

}  // namespace
}  // namespace livemap::zone
