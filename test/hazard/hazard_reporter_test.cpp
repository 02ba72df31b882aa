#include "hazard/hazard_reporter.h"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "temporary_directory.h"

namespace livemap {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr GeoPoint kStart{40.4433, -79.9436};
constexpr std::int64_t kEpochNs = 1'600'000'000'000'000'000;
constexpr double kSpeedMps = 16.0;
constexpr double kBearingRad = 0.9;
constexpr char kOptical[] = "camera_optical_frame";
const Eigen::Vector3d kCameraInBase(1.5, 0.1, 1.6);

std::int64_t StampNs(double seconds) { return kEpochNs + std::llround(seconds * 1e9); }

GeoPoint VehicleAt(double seconds) {
  return GeodesicDestination(kStart, kBearingRad, kSpeedMps * seconds);
}

Fix FixAt(double seconds) {
  return {StampNs(seconds), true, VehicleAt(seconds), Eigen::Matrix2d::Identity() * 0.01};
}

CameraIntrinsics Intrinsics() { return {500, 500, 319.5, 199.5, 640, 400}; }

/// A camera that looks straight ahead, 1.6 m above the road.
Eigen::Isometry3d Mounting() {
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  base_from_optical.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  base_from_optical.translation() = kCameraInBase;
  return base_from_optical;
}

/// The box of an object that stands on the road at this place in base_link.
Box BoxAt(double forward_m, double left_m) {
  const Eigen::Vector3d in_camera = Mounting().inverse() * Eigen::Vector3d(forward_m, left_m, 0.0);
  const CameraIntrinsics camera = Intrinsics();
  const double u = camera.fx * in_camera.x() / in_camera.z() + camera.cx + 0.5;
  const double v = camera.fy * in_camera.y() / in_camera.z() + camera.cy + 0.5;
  return {static_cast<float>(u - 10), static_cast<float>(v - 12), static_cast<float>(u + 10),
          static_cast<float>(v)};
}

SightingFrame FrameAt(double seconds, std::vector<Sighting> sightings) {
  return {StampNs(seconds), kOptical, 640, 400, std::move(sightings)};
}

Picture GreyPicture() { return {cv::Mat(400, 640, CV_8UC3, cv::Scalar(90, 90, 90)), nullptr}; }

class HazardReporterTest : public ::testing::Test {
 protected:
  HazardReporterTest() {
    config_.drive_id = "drive-1";
    config_.map.path = directory_.path() + "/local.sqlite3";
    config_.max_ground_sigma_m = 100;  // Only where a test is about it.
    Restart();
  }

  void Restart() {
    reporter_.reset();
    reporter_ = std::make_unique<HazardReporter>(config_, HazardCatalogue(),
                                                 std::mt19937_64(seed_++), kEpochNs, steady_s_);
    reporter_->SetIntrinsics(Intrinsics());
    reporter_->SetMounting(kOptical, Mounting());
  }

  /// Fixes at 5 Hz from `from_s` up to `to_s`.
  void DriveFixes(double from_s, double to_s) {
    for (double time_s = from_s; time_s <= to_s + 1e-9; time_s += 0.2) {
      reporter_->AddFix(FixAt(time_s));
    }
  }

  /// A frame with its picture, seen and worked off at once.
  void See(double seconds, std::vector<Sighting> sightings) {
    reporter_->AddFrame(FrameAt(seconds, std::move(sightings)), seconds);
    reporter_->AddPicture(StampNs(seconds), GreyPicture());
    reporter_->Process(seconds, steady_s_);
  }

  std::vector<Report> TakeDue() { return reporter_->TakeDue(steady_s_, 100); }
  const HazardReporter::Counters& counters() const { return reporter_->counters(); }

  TemporaryDirectory directory_;
  HazardReporter::Config config_;
  std::uint64_t seed_ = 1;
  double steady_s_ = 500;
  std::unique_ptr<HazardReporter> reporter_;
};

TEST_F(HazardReporterTest, PlacesTheHazardItselfToTheCentimetre) {
  DriveFixes(0, 4);
  See(3.1, {{"pothole", 0.8F, BoxAt(12, -1.5)}});
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  const Report& report = reports[0];
  const GeoPoint ahead = GeodesicDestination(VehicleAt(3.1), kBearingRad, 12);
  const GeoPoint expected = GeodesicDestination(ahead, kBearingRad + M_PI / 2, 1.5);
  EXPECT_LT(GeodesicDistanceM(report.position, expected), 0.01);
  EXPECT_EQ(report.class_name, "pothole");
  EXPECT_EQ(report.confidence, 0.8F);
  EXPECT_EQ(report.stamp_ns, StampNs(3.1));
  EXPECT_EQ(report.drive_id, "drive-1");
  EXPECT_EQ(report.vehicle_id, "");
  EXPECT_EQ(report.image_frame_id, kOptical);
  EXPECT_EQ(report.uuid.bytes[6] >> 4, 4) << "a version 4 UUID";
  EXPECT_GT(report.covariance_m2.determinant(), 0);
  const cv::Mat picture = cv::imdecode(report.image, cv::IMREAD_COLOR);
  EXPECT_EQ(report.image_format, "jpeg");
  EXPECT_EQ(picture.size(), cv::Size(640, 400));
}

TEST_F(HazardReporterTest, HazardInSuccessiveFramesIsReportedOnce) {
  DriveFixes(0, 4);
  // The same place, seen from nearer and nearer.
  for (int i = 0; i < 5; ++i) {
    See(3.0 + 0.1 * i, {{"pothole", 0.8F, BoxAt(14 - 1.6 * i, 0)}});
  }
  EXPECT_THAT(TakeDue(), SizeIs(1));
  EXPECT_EQ(counters().detections, 5u);
  EXPECT_EQ(counters().duplicates_suppressed, 4u);
  EXPECT_EQ(counters().reports_created, 1u);
}

TEST_F(HazardReporterTest, OtherClassAndOtherPlaceAreOtherHazards) {
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(10, 0)},
            {"traffic_cone", 0.8F, BoxAt(10, 0)},
            {"pothole", 0.7F, BoxAt(18, 0)},
            {"pothole", 0.6F, BoxAt(12, 1)}});
  EXPECT_THAT(TakeDue(), SizeIs(3));
  EXPECT_EQ(counters().duplicates_suppressed, 1u);
}

TEST_F(HazardReporterTest, HazardThatTheZoneAnnouncedIsNotReported) {
  DriveFixes(0, 4);
  Notice notice;
  notice.hazard_uuid.bytes[0] = 9;
  notice.sequence = 1;
  notice.class_name = "pothole";
  notice.position = GeodesicDestination(VehicleAt(3), kBearingRad, 12);
  reporter_->AddNotice(notice);
  See(3.0, {{"pothole", 0.8F, BoxAt(10, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty());
  EXPECT_EQ(counters().duplicates_suppressed, 1u);
}

TEST_F(HazardReporterTest, FarSightingWaitsForANearerView) {
  config_.max_ground_sigma_m = 100;
  Restart();
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(35, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty());
  EXPECT_EQ(counters().too_far, 1u);
  See(3.5, {{"pothole", 0.8F, BoxAt(27, 0)}});
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(HazardReporterTest, SightingWhosePlaceIsUncertainWaitsForANearerView) {
  config_.max_ground_sigma_m = 0.6;
  Restart();
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(20, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty());
  EXPECT_EQ(counters().too_far, 1u);
  See(3.5, {{"pothole", 0.8F, BoxAt(8, 0)}});
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(HazardReporterTest, BoxAboveTheHorizonIsNotPlaced) {
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, {100, 100, 120, 150}}});
  EXPECT_THAT(TakeDue(), IsEmpty());
  EXPECT_EQ(counters().not_on_ground, 1u);
}

TEST_F(HazardReporterTest, WithoutAFixSightingsAreHeldBackThenDroppedAndCounted) {
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}, {"debris", 0.8F, BoxAt(9, 0)}});
  EXPECT_EQ(counters().held_back_no_fix, 2u);
  EXPECT_EQ(counters().dropped_no_fix, 0u);
  reporter_->Process(3.0 + config_.max_wait_s - 0.01, steady_s_);
  EXPECT_EQ(reporter_->waiting_frames(), 1u);
  reporter_->Process(3.0 + config_.max_wait_s + 0.01, steady_s_);
  EXPECT_EQ(reporter_->waiting_frames(), 0u);
  EXPECT_EQ(counters().held_back_no_fix, 2u);
  EXPECT_EQ(counters().dropped_no_fix, 2u);
  EXPECT_THAT(TakeDue(), IsEmpty());
}

TEST_F(HazardReporterTest, HeldBackSightingIsReportedOnceFixesEmbraceIt) {
  DriveFixes(0, 2);
  See(3.6, {{"pothole", 0.8F, BoxAt(12, 0)}});  // 1.6 s after the newest fix: stale.
  EXPECT_EQ(counters().held_back_no_fix, 1u);
  EXPECT_THAT(TakeDue(), IsEmpty());
  DriveFixes(2.2, 4);
  reporter_->Process(4.0, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(
      GeodesicDistanceM(reports[0].position, GeodesicDestination(VehicleAt(3.6), kBearingRad, 12)),
      0.01);
  EXPECT_EQ(counters().dropped_no_fix, 0u);
}

TEST_F(HazardReporterTest, ReceiverWithoutFixInventsNothing) {
  for (double time_s = 0; time_s < 4; time_s += 0.2) {
    Fix fix = FixAt(time_s);
    fix.has_fix = false;
    reporter_->AddFix(fix);
  }
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  reporter_->Process(9.0, steady_s_);
  EXPECT_EQ(counters().dropped_no_fix, 1u);
  EXPECT_EQ(counters().no_fixes, 20u);
}

TEST_F(HazardReporterTest, WaitsShortlyForAFixAfterTheImageThenCarriesThePositionOn) {
  DriveFixes(0, 3);
  See(3.1, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty());
  EXPECT_EQ(counters().held_back_no_fix, 0u) << "it had a fix";
  reporter_->Process(3.1 + config_.bracket_wait_s + 0.01, steady_s_);
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(HazardReporterTest, WaitsForThePictureThenGoesWithout) {
  DriveFixes(0, 4);
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->Process(3.4, steady_s_);
  EXPECT_THAT(TakeDue(), IsEmpty());
  reporter_->Process(3.51, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_THAT(reports[0].image, IsEmpty());
  EXPECT_EQ(reports[0].image_format, "");
  EXPECT_EQ(counters().reports_without_picture, 1u);
}

TEST_F(HazardReporterTest, PictureMayComeBeforeItsFrame) {
  DriveFixes(0, 4);
  reporter_->AddPicture(StampNs(3.0), GreyPicture());
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->Process(3.0, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_FALSE(reports[0].image.empty());
}

TEST_F(HazardReporterTest, WithoutCameraOrWithAnotherImageSizeNothingIsPlaced) {
  DriveFixes(0, 4);
  SightingFrame frame = FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  frame.image_width = 1280;
  reporter_->AddFrame(frame, 3.0);
  frame = FrameAt(3.1, {{"pothole", 0.8F, BoxAt(12, 0)}});
  frame.frame_id = "rear_camera";
  reporter_->AddFrame(frame, 3.1);
  reporter_->Process(3.2, steady_s_);
  reporter_->Process(9.0, steady_s_);
  EXPECT_EQ(counters().dropped_no_camera, 2u);
  EXPECT_THAT(TakeDue(), IsEmpty());
}

TEST_F(HazardReporterTest, HostileDetectionsAreDroppedAndCounted) {
  DriveFixes(0, 4);
  const float nan = std::nanf("");
  Box box = BoxAt(12, 0);
  box.x_min = nan;
  See(3.0, {{"pothole", nan, BoxAt(12, 0)},
            {"pothole", 0.8F, box},
            {"pothole", 0.8F, {20, 300, 20, 310}},
            {"", 0.8F, BoxAt(12, 0)},
            {std::string(65, 'x'), 0.8F, BoxAt(12, 0)},
            {"pothole", 1.5F, BoxAt(12, 0)}});
  EXPECT_EQ(counters().invalid_detections, 6u);
  EXPECT_THAT(TakeDue(), IsEmpty());
}

TEST_F(HazardReporterTest, TooManyWaitingFramesDropTheOldest) {
  config_.max_waiting_frames = 3;
  Restart();
  for (int i = 0; i < 5; ++i) See(3.0 + 0.1 * i, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_EQ(reporter_->waiting_frames(), 3u);
  EXPECT_EQ(counters().dropped_no_fix, 2u);
}

TEST_F(HazardReporterTest, ClockSetBackDoesNotMakeAFrameWaitForEver) {
  See(100.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  reporter_->Process(1.0, steady_s_);
  reporter_->Process(1.0 + config_.max_wait_s + 0.01, steady_s_);
  EXPECT_EQ(reporter_->waiting_frames(), 0u);
}

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

  Receipt receipt;
  receipt.status = Receipt::Status::kCommitted;
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
  Receipt receipt;
  receipt.status = Receipt::Status::kRefused;
  receipt.report_uuid.bytes[3] = 77;
  reporter_->AddReceipt(receipt);
  EXPECT_EQ(counters().refused, 0u);
  EXPECT_EQ(reporter_->map().pending_count(), 1u);
}

TEST_F(HazardReporterTest, SameSeedMakesTheSameReports) {
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  const Uuid first = TakeDue().at(0).uuid;
  config_.map.path += ".second";
  seed_ = 1;
  Restart();
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_EQ(TakeDue().at(0).uuid, first);
}

/// The fused pose of base_link: a metre left of what the fixes say, and turned by 0.05 rad.
TrackPose FusedPoseAt(double seconds) {
  TrackPose pose;
  pose.position = GeodesicDestination(VehicleAt(seconds), kBearingRad - M_PI / 2, 1.0);
  pose.covariance_m2 = 0.04 * Eigen::Matrix2d::Identity();
  pose.course_rad = kBearingRad + 0.05;
  pose.course_variance_rad2 = 1e-5;
  pose.speed_mps = kSpeedMps;
  return pose;
}

GeoPoint AheadOf(const TrackPose& pose, double forward_m) {
  return GeodesicDestination(pose.position, pose.course_rad, forward_m);
}

TEST_F(HazardReporterTest, PlacesByTheFusedPoseAndItsHeadingWhereTheAntennaIsElsewhere) {
  config_.position_source = PositionSource::kFused;
  config_.antenna_x_m = 3;  // Of the receiver; the fused pose is that of base_link.
  Restart();
  DriveFixes(0, 4);
  for (const double time_s : {3.0, 3.1, 3.2}) {
    reporter_->AddPose(StampNs(time_s), FusedPoseAt(time_s));
  }
  See(3.15, {{"pothole", 0.8F, BoxAt(12, 0)}});
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(GeodesicDistanceM(reports[0].position, AheadOf(FusedPoseAt(3.15), 12)), 0.02);
  EXPECT_LT(reports[0].covariance_m2.trace(), 0.7) << "of the fused pose, not of the fixes";
  EXPECT_EQ(counters().placed_by_fusion, 1u);
  EXPECT_EQ(counters().placed_by_fixes, 0u);
}

TEST_F(HazardReporterTest, WaitsForTheFusedPoseAndFallsBackToTheFixesWhenItDoesNotCome) {
  config_.position_source = PositionSource::kFused;
  config_.picture_wait_s = 0;
  Restart();
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty()) << "it may come yet";
  reporter_->Process(3.0 + config_.fused_wait_s + 0.01, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  const GeoPoint by_fixes = GeodesicDestination(VehicleAt(3.0), kBearingRad, 12);
  EXPECT_LT(GeodesicDistanceM(reports[0].position, by_fixes), 0.02);
  EXPECT_EQ(counters().placed_by_fixes, 1u);
  EXPECT_EQ(counters().held_back_no_fix, 0u);

  reporter_->AddFrame(FrameAt(3.3, {{"debris", 0.8F, BoxAt(12, 0)}}), 4.5);
  reporter_->Process(4.6, steady_s_);
  EXPECT_THAT(TakeDue(), IsEmpty());
  reporter_->AddPose(StampNs(3.3), FusedPoseAt(3.3));
  reporter_->Process(4.7, steady_s_);
  ASSERT_THAT(TakeDue(), SizeIs(1));
  EXPECT_EQ(counters().placed_by_fusion, 1u);
}

TEST_F(HazardReporterTest, AFusedHeadingThatIsUncertainWaitsForANearerView) {
  config_.position_source = PositionSource::kFused;
  config_.max_ground_sigma_m = 1.0;
  Restart();
  for (const double time_s : {3.0, 3.5}) {
    TrackPose pose = FusedPoseAt(time_s);
    pose.course_variance_rad2 = 0.08 * 0.08;
    reporter_->AddPose(StampNs(time_s), pose);
  }
  See(3.0, {{"pothole", 0.8F, BoxAt(13.5, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty()) << "0.08 rad are 1.1 m there";
  EXPECT_EQ(counters().too_far, 1u);
  See(3.5, {{"pothole", 0.8F, BoxAt(5.5, 0)}});
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(HazardReporterTest, FusedPosesWithoutFixesAreEnough) {
  config_.position_source = PositionSource::kFused;
  Restart();
  reporter_->AddPose(StampNs(3.0), FusedPoseAt(3.0));
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), SizeIs(1)) << "the receiver may have lost its fix: that is what it is for";
  TrackPose bad = FusedPoseAt(3.1);
  bad.course_rad = std::numeric_limits<double>::quiet_NaN();
  reporter_->AddPose(StampNs(3.1), bad);
  EXPECT_EQ(counters().poses, 2u);
  EXPECT_EQ(counters().invalid_poses, 1u);
}

TEST_F(HazardReporterTest, DistanceIsThatOfTheDepthAtTheFootAndElseOfThePlane) {
  config_.use_depth = true;
  Restart();
  DriveFixes(0, 4);
  const Box box = BoxAt(12, 0);  // 10.5 m ahead of the camera, says the plane.
  DepthImage depth;
  depth.depth = cv::Mat(400, 640, CV_32FC1, cv::Scalar(9.5F));
  reporter_->AddDepth(StampNs(3.0), depth);
  See(3.0, {{"pothole", 0.8F, box}});
  auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(
      GeodesicDistanceM(reports[0].position, GeodesicDestination(VehicleAt(3.0), kBearingRad, 11)),
      0.02);
  EXPECT_EQ(counters().distances_by_depth, 1u);

  depth.depth = cv::Mat(400, 640, CV_32FC1, cv::Scalar(0));
  reporter_->AddDepth(StampNs(3.4), depth);
  See(3.4, {{"debris", 0.8F, box}});
  reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(
      GeodesicDistanceM(reports[0].position, GeodesicDestination(VehicleAt(3.4), kBearingRad, 12)),
      0.02);
  EXPECT_EQ(counters().distances_by_depth, 1u);
}

TEST_F(HazardReporterTest, WaitsForTheDepthImageNoLongerThanItMay) {
  config_.use_depth = true;
  Restart();
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), IsEmpty());
  reporter_->Process(3.0 + config_.depth_wait_s + 0.01, steady_s_);
  EXPECT_THAT(TakeDue(), SizeIs(1)) << "by the plane";
  for (int i = 0; i < 200; ++i) reporter_->AddDepth(StampNs(10 + 0.1 * i), {});
  See(3.5, {{"debris", 0.8F, BoxAt(12, 0)}});
  reporter_->AddDepth(StampNs(3.5), {cv::Mat(400, 640, CV_32FC1, cv::Scalar(9.5F)), 1, nullptr});
  reporter_->Process(3.6, steady_s_);
  EXPECT_THAT(TakeDue(), SizeIs(1)) << "also after a clock that was set back";
  EXPECT_EQ(counters().distances_by_depth, 1u);
}

}  // namespace
}  // namespace livemap
