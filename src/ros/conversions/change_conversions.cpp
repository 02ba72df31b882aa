#include "ros/conversions/change_conversions.h"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include "ros/conversions/hazard_conversions.h"

namespace livemap::ros_io {
namespace {

std::uint8_t ToMessage(change::ChangeDirection direction) {
  switch (direction) {
    case change::ChangeDirection::kAppeared:
      return ChangedObject::APPEARED;
    case change::ChangeDirection::kVanished:
      return ChangedObject::VANISHED;
    case change::ChangeDirection::kUnknown:
      break;
  }
  return ChangedObject::UNKNOWN;
}

std::uint8_t ToMessage(change::ChangeDetector::Outcome outcome) {
  switch (outcome) {
    case change::ChangeDetector::Outcome::kCompared:
      return ChangedObjects::COMPARED;
    case change::ChangeDetector::Outcome::kNothingEarlier:
      return ChangedObjects::NOTHING_EARLIER;
    case change::ChangeDetector::Outcome::kRefused:
      return ChangedObjects::REFUSED;
    case change::ChangeDetector::Outcome::kUncertain:
      break;
  }
  return ChangedObjects::UNCERTAIN;
}

ChangedObject ToMessage(const change::PlacedChange& change) {
  const change::ChangedObject& event = change.event;
  ChangedObject message;
  message.id = static_cast<std::uint32_t>(event.id);
  message.class_name = protocol::ChangeClassName(event.change_class);
  message.direction = ToMessage(event.direction);
  message.latitude = change.position.latitude_deg;
  message.longitude = change.position.longitude_deg;
  message.covariance = {change.covariance_m2(0, 0), change.covariance_m2(0, 1),
                        change.covariance_m2(1, 0), change.covariance_m2(1, 1)};
  message.confidence = static_cast<float>(event.confidence);
  message.seen = static_cast<std::uint32_t>(event.seen);
  message.missed = static_cast<std::uint32_t>(event.missed);
  message.first_seen = ToRosTime(event.first_ns);
  message.last_seen = ToRosTime(event.last_ns);
  return message;
}

}  // namespace

ChangedObjects ToMessage(const change::ChangeDetector::Answer& answer,
                         const std_msgs::Header& header, const std::string& drive_id,
                         const std::string& method) {
  ChangedObjects message;
  message.header = header;
  message.drive_id = drive_id;
  message.method = method;
  message.outcome = ToMessage(answer.outcome);
  if (answer.outcome == change::ChangeDetector::Outcome::kRefused) message.why = answer.why;
  if (answer.outcome != change::ChangeDetector::Outcome::kCompared) return message;
  message.earlier_drive_id = answer.earlier.drive_id;
  message.earlier_stamp = ToRosTime(answer.earlier.stamp_ns);
  message.known_share = static_cast<float>(cv::mean(answer.pair.valid)[0] / 255);
  for (const change::PlacedChange& change : answer.objects)
    message.objects.push_back(ToMessage(change));
  return message;
}

sensor_msgs::ImagePtr ToImageMessage(const cv::Mat& pixels, const std_msgs::Header& header) {
  namespace encodings = sensor_msgs::image_encodings;
  const std::string encoding = pixels.type() == CV_8UC1 ? encodings::MONO8 : encodings::BGR8;
  return cv_bridge::CvImage(header, encoding, pixels).toImageMsg();
}

}  // namespace livemap::ros_io
