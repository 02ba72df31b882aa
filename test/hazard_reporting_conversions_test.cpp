#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "ros/hazard_conversions.h"

namespace livemap {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr std::int64_t kStampNs = 1'700'000'000'123'456'789;

Uuid Id(std::uint8_t first) {
  Uuid id;
  for (std::size_t i = 0; i < 16; ++i) id.bytes[i] = static_cast<std::uint8_t>(first + i);
  return id;
}

TEST(HazardConversions, ReportSurvivesTheWayThroughItsMessage) {
  Report report;
  report.uuid = Id(1);
  report.vehicle_id = "car-1";
  report.drive_id = "drive-1";
  report.stamp_ns = kStampNs;
  report.class_name = "pothole";
  report.confidence = 0.75F;
  report.box = {1, 2, 3, 4};
  report.position = {-12.5, 170.25};
  report.covariance_m2 << 1.5, 0.25, 0.5, 2.5;
  report.image_width = 640;
  report.image_height = 400;
  report.image_frame_id = "camera";
  report.image_format = "jpeg";
  report.image = {1, 2, 3};
  const HazardReport message = ToMessage(report);
  EXPECT_EQ(message.image.header.stamp, message.stamp) << "the image's stamp is the report's";
  EXPECT_EQ(message.covariance[1], 0.25) << "row-major";
  const Report back = FromMessage(message);
  EXPECT_EQ(back.uuid, report.uuid);
  EXPECT_EQ(back.vehicle_id, report.vehicle_id);
  EXPECT_EQ(back.drive_id, report.drive_id);
  EXPECT_EQ(back.stamp_ns, report.stamp_ns);
  EXPECT_EQ(back.class_name, report.class_name);
  EXPECT_EQ(back.confidence, report.confidence);
  EXPECT_EQ(back.box.x_min, 1);
  EXPECT_EQ(back.box.y_min, 2);
  EXPECT_EQ(back.box.x_max, 3);
  EXPECT_EQ(back.box.y_max, 4);
  EXPECT_EQ(back.position.latitude_deg, -12.5);
  EXPECT_EQ(back.position.longitude_deg, 170.25);
  EXPECT_EQ(back.covariance_m2, report.covariance_m2);
  EXPECT_EQ(back.image_width, 640u);
  EXPECT_EQ(back.image_height, 400u);
  EXPECT_EQ(back.image_frame_id, "camera");
  EXPECT_EQ(back.image_format, "jpeg");
  EXPECT_EQ(back.image, report.image);
}

TEST(HazardConversions, ReceiptSurvivesTheWayThroughItsMessage) {
  for (const auto status : {Receipt::Status::kCommitted, Receipt::Status::kRefused}) {
    const Receipt receipt{status, Id(1), Id(2), "car-1", "because"};
    const Receipt back = FromMessage(ToMessage(receipt));
    EXPECT_EQ(back.status, status);
    EXPECT_EQ(back.report_uuid, Id(1));
    EXPECT_EQ(back.hazard_uuid, Id(2));
    EXPECT_EQ(back.vehicle_id, "car-1");
    EXPECT_EQ(back.reason, "because");
  }
}

TEST(HazardConversions, EventOfTheZoneBecomesTheNoticeOfTheVehicle) {
  const std::pair<HazardAction, Notice::Action> actions[] = {
      {HazardAction::kAdded, Notice::Action::kAdded},
      {HazardAction::kUpdated, Notice::Action::kUpdated},
      {HazardAction::kRemoved, Notice::Action::kRemoved}};
  for (const auto& [action, expected] : actions) {
    HazardEvent event;
    event.action = action;
    event.hazard.uuid = Id(3);
    event.hazard.class_name = "deer";
    event.hazard.confidence = 0.5F;
    event.hazard.position = {40, -80};
    event.hazard.covariance_m2 << 1, 0.5, 0.5, 2;
    event.hazard.sightings = 7;
    event.hazard.first_seen_ns = kStampNs;
    event.hazard.last_seen_ns = kStampNs + 1;
    event.hazard.updated_ns = kStampNs + 2;
    event.hazard.sequence = 99;
    const Notice notice = FromMessage(ToMessage(event));
    EXPECT_EQ(notice.action, expected);
    EXPECT_EQ(notice.hazard_uuid, Id(3));
    EXPECT_EQ(notice.class_name, "deer");
    EXPECT_EQ(notice.confidence, 0.5F);
    EXPECT_EQ(notice.position.latitude_deg, 40);
    EXPECT_EQ(notice.position.longitude_deg, -80);
    EXPECT_EQ(notice.covariance_m2, event.hazard.covariance_m2);
    EXPECT_EQ(notice.sightings, 7u);
    EXPECT_EQ(notice.first_seen_ns, kStampNs);
    EXPECT_EQ(notice.last_seen_ns, kStampNs + 1);
    EXPECT_EQ(notice.stamp_ns, kStampNs + 2);
    EXPECT_EQ(notice.sequence, 99u);
  }
}

TEST(HazardConversions, VehiclePositionKeepsThatTheCourseIsUnknown) {
  VehicleState vehicle;
  vehicle.drive_id = "drive-1";
  vehicle.position = {40, -80};
  vehicle.course_rad = std::numeric_limits<double>::quiet_NaN();
  vehicle.speed_mps = 0.25;
  vehicle.stamp_ns = kStampNs;
  const VehiclePosition message = ToMessage(vehicle, 1.5);
  EXPECT_EQ(message.horizontal_sigma, 1.5F);
  const VehicleState back = FromMessage(message);
  EXPECT_TRUE(std::isnan(back.course_rad));
  EXPECT_EQ(back.speed_mps, 0.25);
  EXPECT_EQ(back.stamp_ns, kStampNs);
  EXPECT_EQ(back.drive_id, "drive-1");
}

TEST(HazardConversions, OtherSchemaVersionsAreRefused) {
  EXPECT_THAT([] { FromMessage(HazardReport()); }, ThrowsMessage<Error>(HasSubstr("version 0")));
  EXPECT_THAT([] { FromMessage(HazardNotice()); }, ThrowsMessage<Error>(HasSubstr("version 0")));
  EXPECT_THAT([] { FromMessage(ReportReceipt()); }, ThrowsMessage<Error>(HasSubstr("version 0")));
  VehiclePosition newer;
  newer.schema_version = 2;
  EXPECT_THAT([&] { FromMessage(newer); }, ThrowsMessage<Error>(HasSubstr("version 2")));
}

TEST(HazardConversions, UnknownActionsAndStatesAreRefused) {
  HazardNotice notice = ToMessage(Notice{});
  notice.action = 3;
  EXPECT_THAT([&] { FromMessage(notice); }, ThrowsMessage<Error>(HasSubstr("action 3")));
  ReportReceipt receipt = ToMessage(Receipt{});
  receipt.status = 9;
  EXPECT_THAT([&] { FromMessage(receipt); }, ThrowsMessage<Error>(HasSubstr("status 9")));
}

TEST(HazardConversions, StampsOutOfRangeBecomeTheNearestEnd) {
  EXPECT_EQ(ToRosTime(-5), ros::Time(0, 0));
  EXPECT_EQ(ToRosTime(std::numeric_limits<std::int64_t>::max()).sec, 4294967295u);
  EXPECT_EQ(FromRosTime(ToRosTime(kStampNs)), kStampNs);
}

TEST(HazardConversions, FixTakesTheHorizontalCovarianceAndTheReceiversWord) {
  sensor_msgs::NavSatFix message;
  message.header.stamp = ToRosTime(kStampNs);
  message.latitude = 40;
  message.longitude = -80;
  message.status.status = sensor_msgs::NavSatStatus::STATUS_SBAS_FIX;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  message.position_covariance = {{1, 2, 3, 4, 5, 6, 7, 8, 9}};
  Fix fix = ToFix(message);
  EXPECT_TRUE(fix.has_fix);
  EXPECT_EQ(fix.stamp_ns, kStampNs);
  EXPECT_EQ(*fix.covariance_m2, (Eigen::Matrix2d() << 1, 2, 4, 5).finished());
  message.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  fix = ToFix(message);
  EXPECT_FALSE(fix.has_fix);
  EXPECT_FALSE(fix.covariance_m2);
}

TEST(HazardConversions, DetectionsBecomeSightingsInTheirOrder) {
  DetectionArray message;
  message.header.stamp = ToRosTime(kStampNs);
  message.header.frame_id = "camera";
  message.image_width = 640;
  message.image_height = 400;
  message.detections.resize(2);
  message.detections[0].class_name = "pothole";
  message.detections[0].confidence = 0.75F;
  message.detections[0].x_max = 5;
  message.detections[1].class_name = "deer";
  const SightingFrame frame = ToSightingFrame(message);
  EXPECT_EQ(frame.stamp_ns, kStampNs);
  EXPECT_EQ(frame.frame_id, "camera");
  EXPECT_EQ(frame.image_width, 640u);
  ASSERT_EQ(frame.sightings.size(), 2u);
  EXPECT_EQ(frame.sightings[0].confidence, 0.75F);
  EXPECT_EQ(frame.sightings[0].box.x_max, 5);
  EXPECT_EQ(frame.sightings[1].class_name, "deer");
}

}  // namespace
}  // namespace livemap
