#include "ros/conversions/poll_conversions.h"

#include <string>

#include "protocol/poll_validation.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/message_fields.h"

namespace livemap::ros_io {
namespace {

/// A message of version 1 has 0 there: a whole frame.
protocol::PollPicture PictureOf(const HazardPoll& message) {
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
  poll.picture = PictureOf(message);
  poll.max_picture_bytes = message.max_picture_bytes;
  protocol::CheckPoll(poll);
  return poll;
}

HazardPoll ToMessage(const zone::PollOrder& order, std::int64_t now_ns) {
  protocol::Poll poll;
  poll.poll = order.poll;
  poll.hazard = order.hazard;
  poll.vehicle_id = order.vehicle_id;
  poll.stamp_ns = now_ns;
  poll.expires_ns = order.expires_ns;
  poll.class_name = order.class_name;
  poll.position = order.position;
  poll.covariance_m2 = order.covariance_m2;
  poll.picture = order.picture;
  poll.max_picture_bytes = order.max_picture_bytes;
  return ToMessage(poll);
}

zone::PollAnswer ToPollAnswer(const HazardPollAnswer& message) {
  const protocol::PollReply reply = FromMessage(message);
  zone::PollAnswer answer;
  answer.poll = reply.poll;
  answer.hazard = reply.hazard;
  answer.vehicle_id = reply.vehicle_id;
  switch (reply.answer) {
    case protocol::PollReply::Answer::kYes:
      answer.answer = zone::PollAnswer::Answer::kYes;
      break;
    case protocol::PollReply::Answer::kNo:
      answer.answer = zone::PollAnswer::Answer::kNo;
      break;
    case protocol::PollReply::Answer::kCantSee:
      answer.answer = zone::PollAnswer::Answer::kCantSee;
      break;
  }
  answer.reason = reply.reason;
  answer.confidence = static_cast<double>(reply.confidence);
  answer.vehicle_position = reply.vehicle_position;
  answer.stamp_ns = reply.stamp_ns;
  answer.image_format = reply.image_format;
  answer.image = reply.image;
  return answer;
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

HazardPollAnswer ToMessage(const protocol::PollReply& reply) {
  HazardPollAnswer message;
  message.schema_version = HazardPollAnswer::SCHEMA_VERSION;
  message.poll_uuid = ToBytes(reply.poll);
  message.hazard_uuid = ToBytes(reply.hazard);
  message.vehicle_id = reply.vehicle_id;
  message.drive_id = reply.drive_id;
  message.stamp = ToRosTime(reply.stamp_ns);
  switch (reply.answer) {
    case protocol::PollReply::Answer::kYes:
      message.answer = HazardPollAnswer::YES;
      break;
    case protocol::PollReply::Answer::kNo:
      message.answer = HazardPollAnswer::NO;
      break;
    case protocol::PollReply::Answer::kCantSee:
      message.answer = HazardPollAnswer::CANT_SEE;
      break;
  }
  message.reason = reply.reason;
  message.confidence = reply.confidence;
  message.latitude = reply.vehicle_position.latitude_deg;
  message.longitude = reply.vehicle_position.longitude_deg;
  message.course = static_cast<float>(reply.course_rad);
  message.image.header.stamp = message.stamp;
  message.image.format = reply.image_format;
  message.image.data = reply.image;
  return message;
}

protocol::PollReply FromMessage(const HazardPollAnswer& message) {
  CheckVersion(message, "poll answer");
  protocol::PollReply reply;
  switch (message.answer) {
    case HazardPollAnswer::YES:
      reply.answer = protocol::PollReply::Answer::kYes;
      break;
    case HazardPollAnswer::NO:
      reply.answer = protocol::PollReply::Answer::kNo;
      break;
    case HazardPollAnswer::CANT_SEE:
      reply.answer = protocol::PollReply::Answer::kCantSee;
      break;
    default:
      throw Error("poll answer is " + std::to_string(message.answer) +
                  ", accepted is 0 (yes), 1 (no) or 2 (can't see)");
  }
  reply.poll = ToUuid(message.poll_uuid);
  reply.hazard = ToUuid(message.hazard_uuid);
  reply.vehicle_id = message.vehicle_id;
  reply.drive_id = message.drive_id;
  reply.stamp_ns = FromRosTime(message.stamp);
  reply.reason = message.reason;
  reply.confidence = message.confidence;
  reply.vehicle_position = {message.latitude, message.longitude};
  reply.course_rad = static_cast<double>(message.course);
  reply.image_format = message.image.format;
  reply.image = message.image.data;
  protocol::CheckReply(reply);
  return reply;
}

}  // namespace livemap::ros_io
