#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "common/error.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/map_change_conversions.h"
#include "ros/conversions/poll_conversions.h"

namespace livemap::ros_io {
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
  protocol::Report report;
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
  report.shown = {10, 20, 240, 160};
  const HazardReport message = ToMessage(report);
  EXPECT_EQ(message.image.header.stamp, message.stamp) << "the image's stamp is the report's";
  EXPECT_EQ(message.covariance[1], 0.25) << "row-major";
  const protocol::Report back = FromMessage(message);
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
  EXPECT_EQ(back.shown.x, 10u);
  EXPECT_EQ(back.shown.y, 20u);
  EXPECT_EQ(back.shown.width, 240u);
  EXPECT_EQ(back.shown.height, 160u);
}

TEST(HazardConversions, AReportOfVersion1ShowsTheWholeImage) {
  HazardReport message = ToMessage(protocol::Report{});
  message.schema_version = 1;
  message.shown_width = message.shown_height = 100;
  EXPECT_TRUE(FromMessage(message).shown.IsWholeImage());
  for (const std::uint16_t unknown : {std::uint16_t{0}, std::uint16_t{3}}) {
    message.schema_version = unknown;
    EXPECT_THAT([&] { FromMessage(message); },
                ThrowsMessage<Error>(HasSubstr("accepted is 1 to 2")));
  }
}

TEST(HazardConversions, TheLinkIsWhatItsMessageSaysAndNothingElse) {
  LinkState message;
  const vehicle::LinkCost costs[] = {vehicle::LinkCost::kUnknown, vehicle::LinkCost::kCheap,
                                     vehicle::LinkCost::kMetered, vehicle::LinkCost::kNone};
  for (std::uint8_t state = 0; state < 4; ++state) {
    message.state = state;
    EXPECT_EQ(FromMessage(message), costs[state]);
  }
  message.state = 4;
  EXPECT_THAT([&] { FromMessage(message); }, ThrowsMessage<Error>(HasSubstr("link state is 4")));
}

TEST(HazardConversions, ReceiptSurvivesTheWayThroughItsMessage) {
  for (const auto status :
       {protocol::Receipt::Status::kCommitted, protocol::Receipt::Status::kRefused}) {
    const protocol::Receipt receipt{status, Id(1), Id(2), "car-1", "because", "west"};
    const protocol::Receipt back = FromMessage(ToMessage(receipt));
    EXPECT_EQ(back.status, status);
    EXPECT_EQ(back.report_uuid, Id(1));
    EXPECT_EQ(back.hazard_uuid, Id(2));
    EXPECT_EQ(back.vehicle_id, "car-1");
    EXPECT_EQ(back.reason, "because");
    EXPECT_EQ(back.zone, "west");
  }
}

TEST(HazardConversions, EventOfTheZoneBecomesTheNoticeOfTheVehicle) {
  struct Step {
    std::optional<zone::HazardState> from;
    zone::HazardState to;
    protocol::Notice::Action expected;
  };
  const Step steps[] = {
      {std::nullopt, zone::HazardState::kActive, protocol::Notice::Action::kAdded},
      {zone::HazardState::kCandidate, zone::HazardState::kActive, protocol::Notice::Action::kAdded},
      {zone::HazardState::kActive, zone::HazardState::kVerifying,
       protocol::Notice::Action::kUpdated},
      {zone::HazardState::kVerifying, zone::HazardState::kGone, protocol::Notice::Action::kRemoved},
      {zone::HazardState::kActive, zone::HazardState::kRejected,
       protocol::Notice::Action::kRemoved}};
  for (const Step& step : steps) {
    zone::HazardEvent event;
    event.from = step.from;
    event.hazard.state = step.to;
    event.announced = true;
    event.previous_announced = 95;
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
    const protocol::Notice notice = FromMessage(ToMessage(event));
    EXPECT_EQ(notice.action, step.expected);
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
    EXPECT_EQ(notice.previous_sequence, 95u);
    EXPECT_EQ(notice.vehicle_id, "") << "to everybody";
  }
}

TEST(HazardConversions, WhatOneVehicleIsToldBearsItsNameAndTheAnnouncementsSequence) {
  zone::Hazard hazard;
  hazard.uuid = Id(3);
  hazard.class_name = "deer";
  hazard.position = {40, -80};
  hazard.sequence = 120;
  hazard.announced_sequence = 99;
  const protocol::Notice notice =
      FromMessage(ToVehicleMessage(hazard, zone::HazardAction::kRemoved, "car-1"));
  EXPECT_EQ(notice.action, protocol::Notice::Action::kRemoved);
  EXPECT_EQ(notice.vehicle_id, "car-1");
  EXPECT_EQ(notice.sequence, 99u);
  EXPECT_EQ(notice.previous_sequence, 0u);
}

TEST(HazardConversions, TheEndOfACatchUpSurvivesTheWayThroughItsMessage) {
  protocol::Notice done;
  done.action = protocol::Notice::Action::kCaughtUp;
  done.sequence = 99;
  done.previous_sequence = 7;
  done.vehicle_id = "car-1";
  done.position = {40, -80};
  done.radius_m = 5000;
  done.told = 12;
  done.image_format = "jpeg";
  done.image = {1, 2};
  const protocol::Notice back = FromMessage(ToMessage(done));
  EXPECT_EQ(back.action, protocol::Notice::Action::kCaughtUp);
  EXPECT_EQ(back.sequence, 99u);
  EXPECT_EQ(back.previous_sequence, 7u);
  EXPECT_EQ(back.vehicle_id, "car-1");
  EXPECT_EQ(back.radius_m, 5000);
  EXPECT_EQ(back.told, 12u);
  EXPECT_EQ(back.image_format, "jpeg");
  EXPECT_EQ(back.image, done.image);
}

protocol::Poll MakePoll() {
  protocol::Poll poll;
  poll.poll = Id(1);
  poll.hazard = Id(2);
  poll.vehicle_id = "car-1";
  poll.stamp_ns = kStampNs;
  poll.expires_ns = kStampNs + 60'000'000'000;
  poll.class_name = "deer";
  poll.position = {40, -80};
  poll.covariance_m2 << 1, 0.5, 0.5, 2;
  poll.picture = protocol::PollPicture::kCrop;
  poll.max_picture_bytes = 5000;
  return poll;
}

TEST(PollConversions, PollSurvivesTheWayThroughItsMessage) {
  const protocol::Poll poll = MakePoll();
  const protocol::Poll back = FromMessage(ToMessage(poll));
  EXPECT_EQ(back.poll, poll.poll);
  EXPECT_EQ(back.hazard, poll.hazard);
  EXPECT_EQ(back.vehicle_id, "car-1");
  EXPECT_EQ(back.stamp_ns, poll.stamp_ns);
  EXPECT_EQ(back.expires_ns, poll.expires_ns);
  EXPECT_EQ(back.class_name, "deer");
  EXPECT_EQ(back.position.longitude_deg, -80);
  EXPECT_EQ(back.covariance_m2, poll.covariance_m2);
  EXPECT_EQ(back.picture, protocol::PollPicture::kCrop);
  EXPECT_EQ(back.max_picture_bytes, 5000u);
}

TEST(PollConversions, APollOfVersion1WantsTheWholeFrameOrNone) {
  HazardPoll message = ToMessage(MakePoll());
  message.schema_version = 1;
  message.picture_kind = 0;  // As the bridge fills it in.
  EXPECT_EQ(FromMessage(message).picture, protocol::PollPicture::kFullFrame);
  message.picture_wanted = 0;
  EXPECT_EQ(FromMessage(message).picture, protocol::PollPicture::kNone);
  for (const protocol::PollPicture picture :
       {protocol::PollPicture::kNone, protocol::PollPicture::kCrop,
        protocol::PollPicture::kFullFrame}) {
    protocol::Poll poll = MakePoll();
    poll.picture = picture;
    EXPECT_EQ(FromMessage(ToMessage(poll)).picture, picture);
  }
}

TEST(PollConversions, PollsThatMakeNoSenseAreRefusedWithTheReason) {
  const std::pair<std::function<void(HazardPoll&)>, const char*> faults[] = {
      {[](HazardPoll& poll) { poll.schema_version = 9; }, "version 9"},
      {[](HazardPoll& poll) { poll.schema_version = 0; }, "accepted is 1 to 2"},
      {[](HazardPoll& poll) { poll.picture_kind = 2; }, "wants picture 2"},
      {[](HazardPoll& poll) { poll.poll_uuid.assign(0); }, "nil poll_uuid"},
      {[](HazardPoll& poll) { poll.latitude = std::nan(""); }, "position"},
      {[](HazardPoll& poll) { poll.covariance[0] = -1; }, "covariance"},
      {[](HazardPoll& poll) { poll.covariance[1] = std::nan(""); }, "covariance"},
      {[](HazardPoll& poll) { poll.class_name.clear(); }, "class_name"},
      {[](HazardPoll& poll) { poll.class_name.assign(65, 'x'); }, "65 bytes"},
      {[](HazardPoll& poll) { poll.expires = poll.stamp; }, "expires before"}};
  for (const auto& [spoil, words] : faults) {
    HazardPoll message = ToMessage(MakePoll());
    spoil(message);
    EXPECT_THAT([&message] { FromMessage(message); }, ThrowsMessage<Error>(HasSubstr(words)));
  }
}

TEST(PollConversions, AnswerReachesTheZoneAsItWasGiven) {
  protocol::PollAnswer reply;
  reply.poll = Id(1);
  reply.hazard = Id(2);
  reply.vehicle_id = "car-1";
  reply.drive_id = "drive-1";
  reply.stamp_ns = kStampNs;
  reply.answer = protocol::PollAnswer::Answer::kCantSee;
  reply.reason = "too dark";
  reply.confidence = 0.25F;
  reply.vehicle_position = {40, -80};
  reply.course_rad = std::numeric_limits<double>::quiet_NaN();
  reply.image_format = "jpeg";
  reply.image = {1, 2, 3};
  const protocol::PollAnswer answer = FromMessage(ToMessage(reply));
  EXPECT_EQ(answer.poll, Id(1));
  EXPECT_EQ(answer.hazard, Id(2));
  EXPECT_EQ(answer.vehicle_id, "car-1");
  EXPECT_EQ(answer.answer, protocol::PollAnswer::Answer::kCantSee);
  EXPECT_EQ(answer.reason, "too dark");
  EXPECT_EQ(answer.confidence, 0.25);
  EXPECT_EQ(answer.vehicle_position.latitude_deg, 40);
  EXPECT_EQ(answer.stamp_ns, kStampNs);
  EXPECT_EQ(answer.image_format, "jpeg");
  EXPECT_EQ(answer.image, reply.image);

  const std::pair<std::function<void(HazardPollAnswer&)>, const char*> faults[] = {
      {[](HazardPollAnswer& message) { message.answer = 3; }, "is 3"},
      {[](HazardPollAnswer& message) { message.confidence = std::nanf(""); }, "confidence"},
      {[](HazardPollAnswer& message) { message.longitude = 181; }, "position"},
      {[](HazardPollAnswer& message) { message.reason.assign(65, 'x'); }, "65 bytes"},
      {[](HazardPollAnswer& message) { message.hazard_uuid.assign(0); }, "nil hazard_uuid"}};
  for (const auto& [spoil, words] : faults) {
    HazardPollAnswer message = ToMessage(reply);
    spoil(message);
    EXPECT_THAT([&message] { FromMessage(message); }, ThrowsMessage<Error>(HasSubstr(words)));
  }
}

TEST(HazardConversions, VehiclePositionKeepsThatTheCourseIsUnknown) {
  zone::VehicleState vehicle;
  vehicle.drive_id = "drive-1";
  vehicle.position = {40, -80};
  vehicle.course_rad = std::numeric_limits<double>::quiet_NaN();
  vehicle.speed_mps = 0.25;
  vehicle.stamp_ns = kStampNs;
  vehicle.outbox_age_s = 12.5;
  VehiclePosition message = ToMessage(vehicle, 1.5, 42);
  EXPECT_EQ(message.map_sequence, 42u);
  EXPECT_EQ(message.horizontal_sigma, 1.5F);
  const zone::VehicleState back = FromMessage(message);
  EXPECT_TRUE(std::isnan(back.course_rad));
  EXPECT_EQ(back.speed_mps, 0.25);
  EXPECT_EQ(back.stamp_ns, kStampNs);
  EXPECT_EQ(back.drive_id, "drive-1");
  EXPECT_EQ(back.outbox_age_s, 12.5);
  message.schema_version = 2;
  EXPECT_EQ(FromMessage(message).outbox_age_s, std::nullopt) << "version 2 does not say it";
}

TEST(HazardConversions, OtherSchemaVersionsAreRefused) {
  EXPECT_THAT([] { FromMessage(HazardReport()); }, ThrowsMessage<Error>(HasSubstr("version 0")));
  EXPECT_THAT([] { FromMessage(HazardNotice()); }, ThrowsMessage<Error>(HasSubstr("version 0")));
  EXPECT_THAT([] { FromMessage(ReportReceipt()); }, ThrowsMessage<Error>(HasSubstr("version 0")));
  VehiclePosition newer;
  newer.schema_version = 4;
  EXPECT_THAT([&] { FromMessage(newer); }, ThrowsMessage<Error>(HasSubstr("version 4")));
}

TEST(HazardConversions, ANoticeTellsTheCourseThatTheZoneKnows) {
  zone::HazardEvent event;
  event.hazard.course_rad = 1.5;
  EXPECT_DOUBLE_EQ(FromMessage(ToMessage(event)).course_rad, 1.5);
  event.hazard.course_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(FromMessage(ToMessage(event)).course_rad));
}

TEST(HazardConversions, ANoticeTellsTheTrailsThatTheZoneKnows) {
  zone::HazardEvent event;
  event.hazard.position = {49.2, 7.0};
  const geo::LocalFrame frame(event.hazard.position);
  event.hazard.trails = {{frame.ToGeo({-100, 0}), frame.ToGeo({250, 10})}};
  const protocol::Notice notice = FromMessage(ToMessage(event));
  ASSERT_EQ(notice.trails.size(), 1U);
  EXPECT_LT(geo::GeodesicDistanceM(notice.trails[0][1], event.hazard.trails[0][1]), 0.1);
  // A hazard that an official moved far away keeps none.
  event.hazard.position = {49.3, 7.0};
  EXPECT_TRUE(FromMessage(ToMessage(event)).trails.empty());
}

TEST(HazardConversions, ANoticeOfVersion2TellsNoCourse) {
  HazardNotice message = ToMessage(protocol::Notice{});
  message.schema_version = 2;
  message.course = 0;  // As the bridge fills it in.
  EXPECT_TRUE(std::isnan(FromMessage(message).course_rad));
}

TEST(HazardConversions, UnknownActionsAndStatesAreRefused) {
  HazardNotice notice = ToMessage(protocol::Notice{});
  notice.action = 4;
  EXPECT_THAT([&] { FromMessage(notice); }, ThrowsMessage<Error>(HasSubstr("action 4")));
  ReportReceipt receipt = ToMessage(protocol::Receipt{});
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
  geo::Fix fix = ToFix(message);
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
  const placement::SightingFrame frame = ToSightingFrame(message);
  EXPECT_EQ(frame.stamp_ns, kStampNs);
  EXPECT_EQ(frame.frame_id, "camera");
  EXPECT_EQ(frame.image_width, 640u);
  ASSERT_EQ(frame.sightings.size(), 2u);
  EXPECT_EQ(frame.sightings[0].confidence, 0.75F);
  EXPECT_EQ(frame.sightings[0].box.x_max, 5);
  EXPECT_EQ(frame.sightings[1].class_name, "deer");
}

TEST(MapChangeConversions, ReportSurvivesTheWayThroughItsMessage) {
  protocol::MapChangeReport report;
  report.uuid = Id(1);
  report.vehicle_id = "car-1";
  report.drive_id = "tuesday";
  report.stamp_ns = kStampNs;
  report.earlier_stamp_ns = kStampNs - 1'000'000'000;
  report.class_name = "sign";
  report.vanished = true;
  report.confidence = 0.75F;
  report.seen = 5;
  report.missed = 1;
  report.position = {-12.5, 170.25};
  report.covariance_m2 << 1.5, 0.25, 0.25, 2.5;
  const protocol::MapChangeReport back = FromMessage(ToMessage(report));
  EXPECT_EQ(back.uuid, report.uuid);
  EXPECT_EQ(back.vehicle_id, report.vehicle_id);
  EXPECT_EQ(back.drive_id, report.drive_id);
  EXPECT_EQ(back.stamp_ns, report.stamp_ns);
  EXPECT_EQ(back.earlier_stamp_ns, report.earlier_stamp_ns);
  EXPECT_EQ(back.class_name, report.class_name);
  EXPECT_TRUE(back.vanished);
  EXPECT_EQ(back.confidence, report.confidence);
  EXPECT_EQ(back.seen, report.seen);
  EXPECT_EQ(back.missed, report.missed);
  EXPECT_EQ(back.position.latitude_deg, report.position.latitude_deg);
  EXPECT_EQ(back.position.longitude_deg, report.position.longitude_deg);
  EXPECT_EQ(back.covariance_m2, report.covariance_m2);
}

TEST(MapChangeConversions, UnknownVersionsAndDirectionsAreRefused) {
  MapChange message = ToMessage(protocol::MapChangeReport());
  EXPECT_FALSE(FromMessage(message).vanished);
  message.direction = 0;
  EXPECT_THAT([&] { FromMessage(message); },
              ThrowsMessage<Error>(HasSubstr("direction 0, accepted is 1")));
  message.direction = MapChange::APPEARED;
  message.schema_version = 2;
  EXPECT_THAT([&] { FromMessage(message); }, ThrowsMessage<Error>(HasSubstr("schema version 2")));
}

}  // namespace
}  // namespace livemap::ros_io
