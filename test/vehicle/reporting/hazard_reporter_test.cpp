#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST_F(HazardReporterTest, PlacesTheHazardItselfToTheCentimetre) {
  DriveFixes(0, 4);
  See(3.1, {{"pothole", 0.8F, BoxAt(12, -1.5)}});
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  const protocol::Report& report = reports[0];
  const geo::GeoPoint ahead = geo::GeodesicDestination(VehicleAt(3.1), kBearingRad, 12);
  const geo::GeoPoint expected = geo::GeodesicDestination(ahead, kBearingRad + M_PI / 2, 1.5);
  EXPECT_LT(geo::GeodesicDistanceM(report.position, expected), 0.01);
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
  // The hazard and its surroundings, of which 480 pixels of the image's are the least.
  EXPECT_EQ(picture.size(), cv::Size(480, 320));
  EXPECT_EQ(report.shown.width, 480u);
  EXPECT_LE(report.shown.x, report.box.x_min);
  EXPECT_GE(report.shown.x + report.shown.width, report.box.x_max);
  EXPECT_LE(report.image.size(), 12000u);
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
  protocol::Notice notice;
  notice.hazard_uuid.bytes[0] = 9;
  notice.sequence = 1;
  notice.class_name = "pothole";
  notice.position = geo::GeodesicDestination(VehicleAt(3), kBearingRad, 12);
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

TEST_F(HazardReporterTest, BoxThatTheImagesSideCutsWaitsForAViewOfItsFoot) {
  DriveFixes(0, 4);
  const imaging::Box whole = BoxAt(12, 0);
  for (const float left : {0.0F, 620.0F}) {
    const imaging::Box cut{left, whole.y_min, left + (whole.x_max - whole.x_min), whole.y_max};
    See(3.0, {{"road_work_sign", 0.8F, cut}});
  }
  EXPECT_THAT(TakeDue(), IsEmpty());
  EXPECT_EQ(counters().cut_by_side, 2u);
  See(3.5, {{"road_work_sign", 0.8F, whole}});
  EXPECT_THAT(TakeDue(), SizeIs(1));
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
  ProcessWithPictures(4.0);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position,
                                   geo::GeodesicDestination(VehicleAt(3.6), kBearingRad, 12)),
            0.01);
  EXPECT_EQ(counters().dropped_no_fix, 0u);
}

TEST_F(HazardReporterTest, ReceiverWithoutFixInventsNothing) {
  for (double time_s = 0; time_s < 4; time_s += 0.2) {
    geo::Fix fix = FixAt(time_s);
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
  ProcessWithPictures(3.1 + config_.bracket_wait_s + 0.01);
  EXPECT_THAT(TakeDue(), SizeIs(1));
}

TEST_F(HazardReporterTest, WaitsShortlyForTheImageThenGoesWithoutAPicture) {
  DriveFixes(0, 4);
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->Process(3.0, steady_s_);
  reporter_->Process(3.0 + config_.image_wait_s - 0.01, steady_s_);
  EXPECT_THAT(TakeDue(), IsEmpty());
  reporter_->Process(3.0 + config_.image_wait_s + 0.01, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_THAT(reports[0].image, IsEmpty());
  EXPECT_EQ(reports[0].image_format, "");
  EXPECT_EQ(counters().reports_without_picture, 1u);
  EXPECT_EQ(counters().pictures_requested, 0u);
}

TEST_F(HazardReporterTest, AnImageThatComesAfterItsFrameIsInTime) {
  DriveFixes(0, 4);
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->Process(3.0, steady_s_);
  EXPECT_EQ(reporter_->FrameWithoutImage(StampNs(2.9)), nullptr);
  ASSERT_NE(reporter_->FrameWithoutImage(StampNs(3.0)), nullptr);
  reporter_->AddImage(StampNs(3.0), GreyImage());
  EXPECT_EQ(reporter_->FrameWithoutImage(StampNs(3.0)), nullptr);
  ProcessWithPictures(3.1);
  EXPECT_FALSE(TakeDue().at(0).image.empty());
}

TEST_F(HazardReporterTest, PicturesAreOrderedOnceAndOnlyOfNews) {
  DriveFixes(0, 4);
  const auto look = [this](double seconds, const imaging::Box& box) {
    reporter_->AddFrame(FrameAt(seconds, {{"pothole", 0.8F, box}}), seconds);
    reporter_->AddImage(StampNs(seconds), GreyImage());
    reporter_->Process(seconds, steady_s_);
  };
  look(3.0, BoxAt(12, 0));
  std::vector<PictureOrder> orders = reporter_->TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1));
  ASSERT_THAT(orders[0].cuts, SizeIs(1));
  EXPECT_EQ(orders[0].cuts[0].subject, BoxAt(12, 0));
  reporter_->Process(3.1, steady_s_);
  EXPECT_THAT(reporter_->TakePictureOrders(), IsEmpty());
  reporter_->AddPictures(orders[0].number,
                         CutPictures(orders[0], orders[0].image.picture.bgr, false));
  look(3.2, BoxAt(8.8, 0));         // The same hazard, nearer.
  look(3.3, {300, 100, 320, 150});  // Not on the road.
  EXPECT_THAT(reporter_->TakePictureOrders(), IsEmpty());
  EXPECT_EQ(counters().pictures_requested, 1u);
  EXPECT_FALSE(TakeDue().at(0).image.empty());
}

TEST_F(HazardReporterTest, AReportHasThePictureThatItsOrderWasAnsweredWithAndNoOther) {
  DriveFixes(0, 4);
  reporter_->AddFrame(
      FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}, {"debris", 0.7F, BoxAt(9, 1)}}), 3.0);
  reporter_->AddImage(StampNs(3.0), GreyImage());
  reporter_->Process(3.0, steady_s_);
  const std::vector<PictureOrder> orders = reporter_->TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1));
  ASSERT_THAT(orders[0].cuts, SizeIs(2));
  EXPECT_THAT(TakeDue(), IsEmpty()) << "it waits for the answer";
  imaging::CroppedPicture second;
  second.jpeg = {1, 2, 3};
  second.shown = {5, 6, 7, 8};
  second.legible = true;
  reporter_->AddPictures(orders[0].number + 1, {second, second});  // Of no frame.
  reporter_->Process(3.1, steady_s_);
  EXPECT_THAT(TakeDue(), IsEmpty());
  reporter_->AddPictures(orders[0].number, {imaging::CroppedPicture{}, second});
  reporter_->Process(3.1, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(2));
  for (const protocol::Report& report : reports) {
    const bool is_second = report.class_name == "debris";
    EXPECT_THAT(report.image, SizeIs(is_second ? 3 : 0)) << report.class_name;
    EXPECT_EQ(report.shown.width, is_second ? 7u : 0u) << report.class_name;
  }
  EXPECT_EQ(counters().reports_without_picture, 1u);
}

TEST_F(HazardReporterTest, AnOrderThatIsAnsweredWithNothingMakesAReportWithoutPicture) {
  DriveFixes(0, 4);
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->AddImage(StampNs(3.0), GreyImage());
  reporter_->Process(3.0, steady_s_);
  reporter_->AddPictures(reporter_->TakePictureOrders().at(0).number, {});
  reporter_->Process(3.0, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_THAT(reports[0].image, IsEmpty());
  EXPECT_EQ(counters().reports_without_picture, 1u);
}

TEST_F(HazardReporterTest, FramesWaitForTheirPicturesSideBySide) {
  DriveFixes(0, 4);
  for (const double seconds : {2.0, 2.1, 2.2}) {
    const double range_m = 5 + 100 * (seconds - 2);  // Three places.
    reporter_->AddFrame(FrameAt(seconds, {{"pothole", 0.8F, BoxAt(range_m, 0)}}), 3.0);
    reporter_->AddImage(StampNs(seconds), GreyImage());
  }
  reporter_->Process(3.0, steady_s_);
  const std::vector<PictureOrder> orders = reporter_->TakePictureOrders();
  EXPECT_THAT(orders, SizeIs(3));
  // The third place once more: no second picture of it.
  reporter_->AddFrame(FrameAt(2.2, {{"pothole", 0.7F, BoxAt(25, 0)}}), 3.0);
  reporter_->AddImage(StampNs(2.2), GreyImage());
  reporter_->Process(3.0, steady_s_);
  EXPECT_THAT(reporter_->TakePictureOrders(), IsEmpty());
  for (const PictureOrder& order : orders) reporter_->AddPictures(order.number, {});
  reporter_->Process(3.0, steady_s_);
  EXPECT_THAT(TakeDue(), SizeIs(3));
}

TEST_F(HazardReporterTest, AFrameThatWaitedForItsPositionStillGetsItsPicture) {
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->AddImage(StampNs(3.0), GreyImage());
  reporter_->Process(5.0, steady_s_);
  EXPECT_THAT(reporter_->TakePictureOrders(), IsEmpty());
  DriveFixes(0, 4);
  reporter_->Process(5.0, steady_s_);
  EXPECT_THAT(TakeDue(), IsEmpty());
  MakePictures();
  reporter_->Process(5.2, steady_s_);
  EXPECT_FALSE(TakeDue().at(0).image.empty());
}

TEST_F(HazardReporterTest, AnEventOfSecondsAgoIsPlacedWhereTheVehicleWasThen) {
  DriveFixes(0, 28);
  See(2.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  const geo::GeoPoint expected = geo::GeodesicDestination(VehicleAt(2.0), kBearingRad, 12);
  EXPECT_LT(geo::GeodesicDistanceM(reports[0].position, expected), 0.02);
}

TEST_F(HazardReporterTest, AnImageOfAnotherSizeThanTheFrameIsShownWhole) {
  DriveFixes(0, 4);
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->AddImage(StampNs(3.0), {{cv::Mat(64, 96, CV_8UC3, cv::Scalar(9, 9, 9)), nullptr}, {}});
  ProcessWithPictures(3.0);
  const protocol::Report report = TakeDue().at(0);
  EXPECT_TRUE(report.shown.IsWholeImage());
  EXPECT_EQ(cv::imdecode(report.image, cv::IMREAD_COLOR).size(), cv::Size(96, 64));
}

TEST_F(HazardReporterTest, WithoutCameraOrWithAnotherImageSizeNothingIsPlaced) {
  DriveFixes(0, 4);
  placement::SightingFrame frame = FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
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
  imaging::Box box = BoxAt(12, 0);
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

TEST_F(HazardReporterTest, AfterALoopOfTheClockKnownHazardsStayKnownAndNewOnesAreReported) {
  DriveFixes(0, 6);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  const std::vector<protocol::Report> first = TakeDue();
  ASSERT_EQ(first.size(), 1u);
  reporter_->StartAnew(0.1, steady_s_);
  EXPECT_FALSE(reporter_->track().newest_ns()) << "of a time that is to come";
  DriveFixes(0, 6);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_EQ(counters().duplicates_suppressed, 1u);
  See(4.0, {{"pothole", 0.8F, BoxAt(14, 2)}});
  steady_s_ += 100;
  EXPECT_EQ(TakeDue().size(), 2u) << "the unfinished one and the new one";
  EXPECT_EQ(counters().reports_created, 2u);
}

TEST_F(HazardReporterTest, WhatWaitsForAPictureIsReportedBeforeTimeBeginsAnew) {
  DriveFixes(0, 4);
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->Process(3.0, steady_s_);
  EXPECT_EQ(counters().reports_created, 0u);
  reporter_->StartAnew(0.1, steady_s_);
  EXPECT_EQ(counters().reports_created, 1u);
  EXPECT_EQ(counters().reports_without_picture, 1u);
  EXPECT_EQ(reporter_->waiting_frames(), 0u);
}

TEST_F(HazardReporterTest, WhatWaitsForItsPictureAtTheEndIsReportedWithoutItAfterTheNextStart) {
  DriveFixes(0, 4);
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->AddImage(StampNs(3.0), GreyImage());
  reporter_->Process(3.0, steady_s_);
  EXPECT_THAT(reporter_->TakePictureOrders(), SizeIs(1)) << "it is being made";
  reporter_->Finish(steady_s_);
  EXPECT_EQ(reporter_->waiting_frames(), 0u);
  EXPECT_EQ(counters().reports_without_picture, 1u);
  Restart();
  steady_s_ += config_.link_wait_s;
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_EQ(reports[0].class_name, "pothole");
  EXPECT_THAT(reports[0].image, IsEmpty());
}

TEST_F(HazardReporterTest, WhatHasNoPositionAtTheEndIsDroppedAndCounted) {
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->Finish(steady_s_);
  EXPECT_EQ(counters().dropped_no_fix, 1u);
  Restart();
  EXPECT_THAT(TakeDue(), IsEmpty());
}

TEST_F(HazardReporterTest, NoPictureIsOrderedOfAKnownHazardBesideANewOne) {
  DriveFixes(0, 4);
  See(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}});
  EXPECT_THAT(TakeDue(), SizeIs(1));
  reporter_->AddFrame(
      FrameAt(3.1, {{"pothole", 0.8F, BoxAt(10.4, 0)}, {"debris", 0.7F, BoxAt(9, 1)}}), 3.1);
  reporter_->AddImage(StampNs(3.1), GreyImage());
  reporter_->Process(3.1, steady_s_);
  const std::vector<PictureOrder> orders = reporter_->TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1));
  ASSERT_THAT(orders[0].cuts, SizeIs(1));
  EXPECT_EQ(orders[0].cuts[0].subject, BoxAt(9, 1));
  imaging::CroppedPicture picture;
  picture.jpeg = {1, 2, 3};
  reporter_->AddPictures(orders[0].number, {picture});
  reporter_->Process(3.1, steady_s_);
  const auto reports = TakeDue();
  ASSERT_THAT(reports, SizeIs(1));
  EXPECT_EQ(reports[0].class_name, "debris");
  EXPECT_THAT(reports[0].image, SizeIs(3));
}

TEST_F(HazardReporterTest, WhatHasNoPositionWhenTimeBeginsAnewIsDroppedAndCounted) {
  reporter_->AddFrame(FrameAt(3.0, {{"pothole", 0.8F, BoxAt(12, 0)}}), 3.0);
  reporter_->StartAnew(0.1, steady_s_);
  EXPECT_EQ(counters().dropped_no_fix, 1u);
  EXPECT_EQ(reporter_->waiting_frames(), 0u);
}

TEST_F(HazardReporterTest, AFixOfTheFutureIsCountedAndPositionsGoOn) {
  DriveFixes(0, 4);
  geo::Fix wrong = FixAt(4.2);
  wrong.stamp_ns += 365LL * 86400 * 1'000'000'000;
  reporter_->AddFix(wrong, StampNs(4.2));
  EXPECT_EQ(counters().fixes_bad_stamp, 1u);
  reporter_->AddFix(FixAt(4.4), StampNs(4.4));
  EXPECT_EQ(reporter_->track().newest_ns(), StampNs(4.4));
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

}  // namespace
}  // namespace livemap::vehicle
