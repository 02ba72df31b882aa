#pragma once

#include <string>
#include <vector>

#include "directory/directory_handout.h"
#include "directory/zone_handover.h"
#include "ros/parameters/shared/parameter_reader.h"
#include "ros/parameters/shared/shared_parameters.h"
#include "transport/mqtt_client.h"

namespace livemap::ros_io {

enum class BridgeRole { kVehicle, kZone };
enum class BridgeDirection {
  kOut,  ///< From ROS to the broker.
  kIn    ///< From the broker to ROS.
};

/// One line of the bridge's topic list.
struct BridgeTopic {
  std::string name;        ///< For diagnostics: "reports" is counted as reports_out.
  std::string ros_topic;   ///< Relative names are resolved in the nodelet's namespace.
  std::string type;        ///< E.g. "livemap/HazardReport"; see BridgedTypeNames.
  std::string mqtt_topic;  ///< Template with {zone}, {vehicle} and {cell}.
  BridgeDirection direction = BridgeDirection::kOut;
  int qos = 1;            ///< 0 or 1.
  int max_bytes = 65536;  ///< One MQTT payload; more is refused in both directions.
  bool keep_when_disconnected =
      false;            ///< Out: wait in the queue (true) or drop and count (false).
  int ros_queue = 100;  ///< Messages.
  /// Out: the SCHEMA_VERSION as which messages are written; 0: the present one.
  int write_version = 0;
};

/// All that the mqtt_bridge nodelet is told; config/mqtt_bridge_*.yaml explain each value.
struct BridgeConfig {
  BridgeRole role = BridgeRole::kVehicle;
  std::string zone;             ///< Required.
  std::string user;             ///< Required: the vehicle's id, or the zone's login.
  std::string password_file;    ///< Its first line is the password; empty: no password.
  double password_wait_s = 10;  ///< For a broker that writes the file while we start.
  double active_timeout_s = 0;  ///< Of a zone: without a word of its activity; 0: always active.
  double diagnostics_period_s = 1;
  transport::MqttConfig mqtt;
  /// The zone directory, where there is one. `zones.zone` is `zone`.
  ZoneParameters zones;
  /// Of a vehicle: how it changes zones.
  directory::ZoneHandover::Config handover;
  directory::DirectoryHandout::Config handout;  ///< Of a zone that has a directory.
  std::vector<BridgeTopic> topics;
};

/// Reads and checks everything but the password file. Throws Error naming the parameter.
BridgeConfig ReadBridgeConfig(ParameterReader& parameters);

/// The first line of `path`, waited for up to `wait_s` seconds. Throws Error when there is none.
std::string ReadPassword(const std::string& path, double wait_s);

}  // namespace livemap::ros_io
