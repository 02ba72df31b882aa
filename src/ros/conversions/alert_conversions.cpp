#include "ros/conversions/alert_conversions.h"

#include "ros/conversions/message_fields.h"

namespace livemap::ros_io {
namespace {

std::uint8_t StateOfAlert(vehicle::HazardAlert::State state) {
  switch (state) {
    case vehicle::HazardAlert::State::kApproach:
      return HazardAlert::APPROACH;
    case vehicle::HazardAlert::State::kPassed:
      return HazardAlert::PASSED;
    case vehicle::HazardAlert::State::kCancelled:
      return HazardAlert::CANCELLED;
  }
  return HazardAlert::CANCELLED;
}

std::uint8_t SideOfAlert(vehicle::HazardAlert::Side side) {
  switch (side) {
    case vehicle::HazardAlert::Side::kAhead:
      return HazardAlert::AHEAD;
    case vehicle::HazardAlert::Side::kLeft:
      return HazardAlert::LEFT;
    case vehicle::HazardAlert::Side::kRight:
      return HazardAlert::RIGHT;
  }
  return HazardAlert::AHEAD;
}

}  // namespace

HazardAlert ToMessage(const vehicle::HazardAlert& alert, const ros::Time& stamp) {
  HazardAlert message;
  message.header.stamp = stamp;
  message.hazard_uuid = ToBytes(alert.id);
  message.class_name = alert.class_name;
  message.urgency = static_cast<std::uint8_t>(alert.urgency);
  message.state = StateOfAlert(alert.state);
  message.side = SideOfAlert(alert.side);
  message.distance = static_cast<float>(alert.distance_m);
  message.seconds = static_cast<float>(alert.time_s);
  message.probability = static_cast<float>(alert.probability);
  return message;
}

}  // namespace livemap::ros_io
