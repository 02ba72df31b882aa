#include "ros/conversions/poll_conversions.h"

#include <string>

#include "protocol/poll_validation.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/message_fields.h"

namespace livemap::ros_io {
namespace {

/// A message of version 1 has 0 there: a whole frame.
protocol::PollPicture PollPictureOf(const HazardPoll& message) {
  if (message.picture_kind != HazardPoll::WHOLE_FRAME && message.picture_kind != HazardPoll::CROP) {
    throw Error("hazard poll wants picture " + std::to_string(message.picture_kind) +
                ", accepted is 0 (whole frame) or 1 (crop)");
  }
  if (message.picture_wanted == 0) return protocol::PollPicture::kNone;
  return message.picture_kind == HazardPoll::CROP ? protocol::PollPicture::kCrop
                                                  : protocol::PollPicture::kFullFrame;
}

}  // namespace

HazardPoll ToMessage(const protocol::Poll& poll) {
  HazardPoll message;
  message.schema_version = HazardPoll::SCHEMA_VERSION;
  message.poll_uuid = ToBytes(poll.poll);
  message.hazard_uuid = ToBytes(poll.hazard);
  message.vehicle_id = poll.vehicle_id;
  message.stamp = ToRosTime(poll.stamp_ns);
  message.expires = ToRosTime(poll.expires_ns);
  message.class_name = poll.class_name;
  message.latitude = poll.position.latitude_deg;
  message.longitude = poll.position.longitude_deg;
  message.covariance = ToArray(poll.covariance_m2);
  message.picture_wanted = poll.picture != protocol::PollPicture::kNone;
  message.picture_kind =
      poll.picture == protocol::PollPicture::kCrop ? HazardPoll::CROP : HazardPoll::WHOLE_FRAME;
  message.max_picture_bytes = poll.max_picture_bytes;
  message.zone = poll.zone;
  return message;
}

protocol::Poll FromMessage(const HazardPoll& message) {
  constexpr std::uint16_t kWholeFrames = 1;  // Knew no other pictures.
  CheckVersion(message, "hazard poll", kWholeFrames);
  protocol::Poll poll;
  poll.poll = ToUuid(message.poll_uuid);
  poll.hazard = ToUuid(message.hazard_uuid);
  poll.vehicle_id = message.vehicle_id;
  poll.stamp_ns = FromRosTime(message.stamp);
  poll.expires_ns = FromRosTime(message.expires);
  poll.class_name = message.class_name;
  poll.position = {message.latitude, message.longitude};
  poll.covariance_m2 = ToMatrix(message.covariance);
  poll.picture = PollPictureOf(message);
  poll.max_picture_bytes = message.max_picture_bytes;
  poll.zone = message.zone;
  protocol::CheckPoll(poll);
  return poll;
}

std::vector<vehicle::ChangeEvidence> ToEvidence(const ChangedObjects& message) {
  std::vector<vehicle::ChangeEvidence> all;
  for (const ChangedObject& object : message.objects) {
    if (object.direction != ChangedObject::APPEARED &&
        object.direction != ChangedObject::VANISHED) {
      continue;
    }
    vehicle::ChangeEvidence evidence;
    evidence.stamp_ns = FromRosTime(object.last_seen);
    evidence.change_class = object.class_name;
    evidence.vanished = object.direction == ChangedObject::VANISHED;
    evidence.position = {object.latitude, object.longitude};
    evidence.covariance_m2 << object.covariance[0], object.covariance[1], object.covariance[2],
        object.covariance[3];
    evidence.confidence = object.confidence;
    all.push_back(evidence);
  }
  return all;
}

HazardPollAnswer ToMessage(const protocol::PollAnswer& answer) {
  HazardPollAnswer message;
  message.schema_version = HazardPollAnswer::SCHEMA_VERSION;
  message.poll_uuid = ToBytes(answer.poll);
  message.hazard_uuid = ToBytes(answer.hazard);
  message.vehicle_id = answer.vehicle_id;
  message.drive_id = answer.drive_id;
  message.stamp = ToRosTime(answer.stamp_ns);
  switch (answer.answer) {
    case protocol::PollAnswer::Answer::kYes:
      message.answer = HazardPollAnswer::YES;
      break;
    case protocol::PollAnswer::Answer::kNo:
      message.answer = HazardPollAnswer::NO;
      break;
    case protocol::PollAnswer::Answer::kCantSee:
      message.answer = HazardPollAnswer::CANT_SEE;
      break;
  }
  message.reason = answer.reason;
  message.confidence = answer.confidence;
  message.latitude = answer.vehicle_position.latitude_deg;
  message.longitude = answer.vehicle_position.longitude_deg;
  message.course = static_cast<float>(answer.course_rad);
  message.image.header.stamp = message.stamp;
  message.image.format = answer.image_format;
  message.image.data = answer.image;
  message.zone = answer.zone;
  return message;
}

protocol::PollAnswer FromMessage(const HazardPollAnswer& message) {
  CheckVersion(message, "poll answer");
  protocol::PollAnswer answer;
  switch (message.answer) {
    case HazardPollAnswer::YES:
      answer.answer = protocol::PollAnswer::Answer::kYes;
      break;
    case HazardPollAnswer::NO:
      answer.answer = protocol::PollAnswer::Answer::kNo;
      break;
    case HazardPollAnswer::CANT_SEE:
      answer.answer = protocol::PollAnswer::Answer::kCantSee;
      break;
    default:
      throw Error("poll answer is " + std::to_string(message.answer) +
                  ", accepted is 0 (yes), 1 (no) or 2 (can't see)");
  }
  answer.poll = ToUuid(message.poll_uuid);
  answer.hazard = ToUuid(message.hazard_uuid);
  answer.vehicle_id = message.vehicle_id;
  answer.drive_id = message.drive_id;
  answer.stamp_ns = FromRosTime(message.stamp);
  answer.reason = message.reason;
  answer.confidence = message.confidence;
  answer.vehicle_position = {message.latitude, message.longitude};
  answer.course_rad = static_cast<double>(message.course);
  answer.image_format = message.image.format;
  answer.image = message.image.data;
  answer.zone = message.zone;
  protocol::CheckAnswer(answer);
  return answer;
}

}  // namespace livemap::ros_io
