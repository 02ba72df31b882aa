#include "vehicle/reporting/offload_sender.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

std::vector<std::uint8_t> PlainJpeg(const CameraImage& image, std::size_t max_bytes) {
  return imaging::EncodeJpeg(image.picture, 80, max_bytes);
}

/// A small vehicle that drives straight on.
class CandidateSenderTest : public ::testing::Test {
 protected:
  CandidateSenderTest() {
    config_.drive_id = "drive-1";
    Restart();
  }

  void Restart() {
    sender_ = std::make_unique<OffloadSender>(config_);
    sender_->SetIntrinsics(Intrinsics());
    sender_->SetMounting(kOptical, Mounting());
  }

  void DriveFixes(double from_s, double to_s) {
    for (double time_s = from_s; time_s <= to_s + 1e-9; time_s += 0.2) {
      sender_->AddFix(FixAt(time_s));
    }
  }

  /// A candidate of this moment that arrives at once; what can go then.
  std::vector<protocol::OffloadedFrame> See(double seconds) {
    sender_->AddJudged(StampNs(seconds), kOptical, 0.8F, true, GreyImage(), seconds);
    return sender_->TakeReady(seconds, PlainJpeg);
  }

  const OffloadSender::Counters& counters() const { return sender_->counters(); }

  OffloadSender::Config config_;
  std::unique_ptr<OffloadSender> sender_;
};

TEST_F(CandidateSenderTest, AFrameGoesWithThePoseOfItsMomentAndItsCamera) {
  DriveFixes(0, 4);
  const auto sent = See(3.1);
  ASSERT_THAT(sent, SizeIs(1));
  const protocol::OffloadedFrame& candidate = sent[0];
  EXPECT_LT(geo::GeodesicDistanceM(candidate.base.position, VehicleAt(3.1)), 0.01);
  EXPECT_NEAR(candidate.base.course_rad, kBearingRad, 0.01);
  EXPECT_GT(candidate.base.covariance_m2.determinant(), 0);
  EXPECT_FALSE(candidate.fused);
  EXPECT_EQ(candidate.stamp_ns, StampNs(3.1));
  EXPECT_EQ(candidate.drive_id, "drive-1");
  EXPECT_EQ(candidate.vehicle_id, "");
  EXPECT_EQ(candidate.score, 0.8F);
  EXPECT_EQ(candidate.intrinsics.width, 640);
  EXPECT_EQ(candidate.intrinsics.fx, Intrinsics().fx);
  EXPECT_TRUE(candidate.base_from_optical.isApprox(Mounting()));
  EXPECT_EQ(counters().sent, 1U);
  EXPECT_EQ(counters().sent_bytes, candidate.image.size());
}

TEST_F(CandidateSenderTest, ThePoseIsThatOfBaseLinkNotOfTheAntenna) {
  config_.pose.antenna_x_m = 2.0;
  Restart();
  DriveFixes(0, 4);
  const auto sent = See(3.1);
  ASSERT_THAT(sent, SizeIs(1));
  const geo::GeoPoint behind = geo::GeodesicDestination(VehicleAt(3.1), kBearingRad + M_PI, 2.0);
  EXPECT_LT(geo::GeodesicDistanceM(sent[0].base.position, behind), 0.02);
  // A course error moves base_link, which lies behind the antenna, against its sense.
  EXPECT_GT(sent[0].base.position_course.norm(), 0);
}

TEST_F(CandidateSenderTest, TheClassifierSeesFiveFramesASecondOfAnyCamera) {
  for (const double camera_hz : {30.0, 10.0, 5.2}) {
    Restart();
    int taken = 0;
    const int frames = static_cast<int>(20 * camera_hz);
    for (int i = 0; i < frames; ++i) taken += sender_->Takes(StampNs(i / camera_hz)) ? 1 : 0;
    EXPECT_NEAR(taken, 100, 2) << camera_hz;
    EXPECT_EQ(counters().frames, static_cast<std::uint64_t>(frames));
    EXPECT_EQ(counters().frames, counters().taken + counters().rate_skipped);
  }
}

TEST_F(CandidateSenderTest, ABagThatBeginsAnewIsSeenFromItsFirstFrame) {
  EXPECT_TRUE(sender_->Takes(StampNs(100)));
  EXPECT_TRUE(sender_->Takes(StampNs(3)));
  EXPECT_FALSE(sender_->Takes(StampNs(3.1)));
}

TEST_F(CandidateSenderTest, AStandingVehicleSendsOnce) {
  DriveFixes(0, 2);
  for (int i = 1; i <= 150; ++i) {  // It stands where it was after two seconds.
    const double time_s = 2 + 0.2 * i;
    geo::Fix fix = FixAt(2);
    fix.stamp_ns = StampNs(time_s);
    sender_->AddFix(fix);
  }
  std::size_t sent = 0;
  for (int i = 0; i < 60; ++i) sent += See(3 + 0.33 * i).size();
  EXPECT_EQ(sent, 1U);
  EXPECT_EQ(counters().same_place, 59U);
}

TEST_F(CandidateSenderTest, WhatIsNotWorthSendingIsCountedAndGone) {
  DriveFixes(0, 4);
  sender_->AddJudged(StampNs(3), kOptical, 0.1F, false, GreyImage(), 3);
  EXPECT_THAT(sender_->TakeReady(10, PlainJpeg), IsEmpty());
  EXPECT_EQ(counters().discarded, 1U);
  EXPECT_EQ(counters().candidates, 0U);
}

TEST_F(CandidateSenderTest, AFrameAheadOfTheFixesWaitsForTheNextOne) {
  DriveFixes(0, 3);
  EXPECT_THAT(See(3.1), IsEmpty());
  sender_->AddFix(FixAt(3.2));
  const auto sent = sender_->TakeReady(3.25, PlainJpeg);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_LT(geo::GeodesicDistanceM(sent[0].base.position, VehicleAt(3.1)), 0.01);
}

TEST_F(CandidateSenderTest, AFrameWithoutAPoseIsDroppedAfterItsTime) {
  EXPECT_THAT(See(3), IsEmpty());
  EXPECT_THAT(sender_->TakeReady(7.9, PlainJpeg), IsEmpty());
  EXPECT_EQ(counters().no_pose, 0U);
  EXPECT_THAT(sender_->TakeReady(8.1, PlainJpeg), IsEmpty());
  EXPECT_EQ(counters().no_pose, 1U);
  EXPECT_EQ(sender_->waiting(), 0U);
}

TEST_F(CandidateSenderTest, FusedPosesCountWhereTheyAreAndFixesElsewhere) {
  config_.pose.use_fused = true;
  Restart();
  DriveFixes(0, 4);
  geo::TrackPose fused;
  fused.position =
      geo::GeodesicDestination(VehicleAt(3.1), 0, 1.0);  // A metre away from the fixes.
  fused.covariance_m2 = Eigen::Matrix2d::Identity() * 0.01;
  fused.course_rad = kBearingRad;
  fused.course_variance_rad2 = 1e-4;
  sender_->AddPose(StampNs(3.05), fused);
  sender_->AddPose(StampNs(3.15), fused);
  const auto sent = See(3.1);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_TRUE(sent[0].fused);
  EXPECT_LT(geo::GeodesicDistanceM(sent[0].base.position, fused.position), 0.01);
  EXPECT_THAT(See(3.5), IsEmpty()) << "the fusion may yet tell";
  const auto later = sender_->TakeReady(3.5 + 1.1, PlainJpeg);
  ASSERT_THAT(later, SizeIs(1));
  EXPECT_FALSE(later[0].fused);
}

TEST_F(CandidateSenderTest, WhatCannotBeMaskedDoesNotLeave) {
  DriveFixes(0, 4);
  sender_->AddJudged(StampNs(3), kOptical, 0.8F, true, GreyImage(), 3);
  const auto refuse = [](const CameraImage&, std::size_t) { return std::vector<std::uint8_t>(); };
  EXPECT_THAT(sender_->TakeReady(3, refuse), IsEmpty());
  EXPECT_EQ(counters().withheld, 1U);
  EXPECT_EQ(counters().sent, 0U);
}

TEST_F(CandidateSenderTest, TheBudgetOfBytesHoldsInTheLongRun) {
  config_.max_bytes_per_s = 5000;
  config_.burst_s = 2;
  config_.min_spacing_m = 0;
  config_.min_image_bytes = 2000;
  config_.max_image_bytes = 8000;
  Restart();
  std::size_t largest = 0;
  std::size_t smallest = 100000;
  const auto all_that_is_left = [&](const CameraImage& image, std::size_t max_bytes) {
    std::vector<std::uint8_t> jpeg = PlainJpeg(image, 100000);
    jpeg.resize(max_bytes);
    largest = std::max(largest, max_bytes);
    smallest = std::min(smallest, max_bytes);
    return jpeg;
  };
  DriveFixes(0, 0.6);
  for (int i = 3; i < 170; ++i) {
    DriveFixes(0.33 * i, 0.33 * i + 0.1);
    sender_->AddJudged(StampNs(0.33 * i), kOptical, 0.8F, true, GreyImage(), 0.33 * i);
    sender_->TakeReady(0.33 * i, all_that_is_left);
  }
  const double seconds = 0.33 * 167;
  EXPECT_LE(static_cast<double>(counters().sent_bytes), 5000 * (seconds + 2));
  EXPECT_GE(static_cast<double>(counters().sent_bytes), 0.8 * 5000 * seconds);
  EXPECT_GT(counters().over_budget, 0U);
  EXPECT_EQ(largest, 8000U) << "as long as there is plenty";
  EXPECT_GE(smallest, 2000U);
}

TEST_F(CandidateSenderTest, APictureThatWasShrunkHasTheIntrinsicsOfItsOwnSize) {
  DriveFixes(0, 4);
  sender_->AddJudged(StampNs(3), kOptical, 0.8F, true, GreyImage(), 3);
  const auto half = [](const CameraImage&, std::size_t max_bytes) {
    return PlainJpeg({{cv::Mat(200, 320, CV_8UC3, cv::Scalar(1, 2, 3)), nullptr}, {}}, max_bytes);
  };
  const auto sent = sender_->TakeReady(3, half);
  ASSERT_THAT(sent, SizeIs(1));
  const geo::CameraIntrinsics& camera = sent[0].intrinsics;
  EXPECT_EQ(camera.width, 320);
  EXPECT_EQ(camera.height, 200);
  EXPECT_DOUBLE_EQ(camera.fx, 250);
  EXPECT_DOUBLE_EQ(camera.cx, 159.5) << "the middle stays the middle";
  EXPECT_DOUBLE_EQ(camera.cy, 99.5);
}

TEST_F(CandidateSenderTest, AnotherImageSizeThanTheCalibrationsIsNotSent) {
  DriveFixes(0, 4);
  const CameraImage other{{cv::Mat(480, 640, CV_8UC3, cv::Scalar(1, 2, 3)), nullptr}, {}};
  sender_->AddJudged(StampNs(3), kOptical, 0.8F, true, other, 3);
  EXPECT_THAT(sender_->TakeReady(9, PlainJpeg), IsEmpty());
  EXPECT_EQ(counters().no_camera, 1U);
}

TEST_F(CandidateSenderTest, TheWaitingRoomIsBounded) {
  for (int i = 0; i < 100; ++i) See(3 + 0.01 * i);
  EXPECT_EQ(sender_->waiting(), static_cast<std::size_t>(config_.max_waiting_frames));
  EXPECT_EQ(counters().displaced, 100U - sender_->waiting());
}

TEST_F(CandidateSenderTest, AfterALoopOfTheClockFramesAreTakenAndSentAsBefore) {
  DriveFixes(0, 4);
  EXPECT_TRUE(sender_->Takes(StampNs(3.1)));
  ASSERT_THAT(See(3.1), SizeIs(1));
  sender_->AddJudged(StampNs(9), kOptical, 0.8F, true, GreyImage(), 9);
  sender_->StartAnew();
  EXPECT_EQ(sender_->waiting(), 0U);
  EXPECT_EQ(counters().no_pose, 1U);
  DriveFixes(0, 4);
  EXPECT_TRUE(sender_->Takes(StampNs(2.5)));
  EXPECT_THAT(See(2.5), SizeIs(1));
}

}  // namespace
}  // namespace livemap::vehicle
