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

vehicle::HazardAlert::State StateOfMessage(const HazardAlert& message) {
  switch (message.state) {
    case HazardAlert::APPROACH:
      return vehicle::HazardAlert::State::kApproach;
    case HazardAlert::PASSED:
      return vehicle::HazardAlert::State::kPassed;
    case HazardAlert::CANCELLED:
      return vehicle::HazardAlert::State::kCancelled;
  }
  throw Error("hazard alert has state " + std::to_string(message.state) +
              ", accepted is 0 (approach), 1 (passed) or 2 (cancelled)");
}

vehicle::HazardAlert::Side SideOfMessage(const HazardAlert& message) {
  switch (message.side) {
    case HazardAlert::AHEAD:
      return vehicle::HazardAlert::Side::kAhead;
    case HazardAlert::LEFT:
      return vehicle::HazardAlert::Side::kLeft;
    case HazardAlert::RIGHT:
      return vehicle::HazardAlert::Side::kRight;
  }
  throw Error("hazard alert has side " + std::to_string(message.side) +
              ", accepted is 0 (ahead), 1 (left) or 2 (right)");
}

void CheckAlertNumber(const char* name, double value) {
  if (value >= 0 && value <= 1e6) return;
  throw Error(std::string("hazard alert has ") + name + " " + std::to_string(value) +
              ", accepted is 0 to 1000000");
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

vehicle::HazardAlert FromMessage(const HazardAlert& message) {
  CheckAlertNumber("distance", message.distance);
  CheckAlertNumber("seconds", message.seconds);
  vehicle::HazardAlert alert;
  alert.id = ToUuid(message.hazard_uuid);
  alert.class_name = message.class_name;
  alert.urgency = message.urgency;
  alert.state = StateOfMessage(message);
  alert.side = SideOfMessage(message);
  alert.distance_m = message.distance;
  alert.time_s = message.seconds;
  alert.probability = message.probability;
  return alert;
}

}  // namespace livemap::ros_io
