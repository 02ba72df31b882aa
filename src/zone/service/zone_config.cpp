#include "zone/service/zone_config.h"

#include <limits>
#include <string>

#include "common/error.h"

namespace livemap::zone {

ZoneConfig CheckedConfig(ZoneConfig config) {
  if (!(config.image_cap_bytes >= 0 && config.image_cap_bytes <= 1e15)) {
    throw Error("image_cap_bytes is " + std::to_string(config.image_cap_bytes) +
                ", accepted is 0 to 1e15");
  }
  if (!(config.picture_days >= 0 && config.picture_days <= 36500)) {
    throw Error("picture_days is " + std::to_string(config.picture_days) +
                ", accepted is 0 to 36500");
  }
  if (!(config.vehicle_retention_s > 0 && config.vehicle_retention_s <= 1e6)) {
    throw Error("vehicle_retention_s is " + std::to_string(config.vehicle_retention_s) +
                ", accepted is above 0 to 1e6");
  }
  const SpeedRule& speed = config.speed;
  if (!(speed.max_speed_mps > 0 && speed.max_speed_mps <= 1e9 && speed.slack_m >= 0)) {
    throw Error("max_speed_mps is " + std::to_string(speed.max_speed_mps) + " and speed_slack_m " +
                std::to_string(speed.slack_m) + ", accepted are above 0 and at least 0");
  }
  if (speed.recovery_reports < 2) {
    throw Error("recovery_reports is " + std::to_string(speed.recovery_reports) +
                ", accepted is at least 2");
  }
  if (config.max_vehicles == 0) throw Error("max_vehicles is 0, accepted is at least 1");
  if (!(config.frame_timeout_s > 0 && config.frame_timeout_s <= 1e7)) {
    throw Error("frame_timeout_s is " + std::to_string(config.frame_timeout_s) +
                ", accepted is above 0 to 1e7");
  }
  if (!(config.frames_per_hour >= 1 && config.frames_per_hour <= 1e6)) {
    throw Error("frames_per_hour is " + std::to_string(config.frames_per_hour) +
                ", accepted is 1 to 1e6");
  }
  config.trust.malicious_share = config.life.malicious_share;
  if (config.replay) config.limits.max_age_s = std::numeric_limits<double>::infinity();
  return config;
}

}  // namespace livemap::zone
