#include "ros/parameters/mqtt_bridge_parameters.h"

#include <ros/time.h>

#include <filesystem>
#include <set>
#include <sstream>

#include "common/comma_list.h"
#include "common/text_file.h"
#include "ros/bridge/bridged_type.h"
#include "ros/parameters/shared/shared_parameters.h"
#include "transport/topic_template.h"

namespace livemap::ros_io {
namespace {

constexpr std::size_t kMaxPasswordFileBytes = 4096;
constexpr int kMaxMessageBytes = 64 << 20;
/// With the first one, as many as a zone directory names.
constexpr std::size_t kMaxOtherBrokers = 7;

/// One entry of the list `topics`, read key by key.
class MqttBridgeTopicReader {
 public:
  MqttBridgeTopicReader(const XmlRpc::XmlRpcValue& entry, std::string place)
      : entry_(entry), place_(std::move(place)) {
    if (entry_.getType() != XmlRpc::XmlRpcValue::TypeStruct) {
      throw Error("parameter '" + place_ + "' is no map of keys and values");
    }
  }

  std::string Text(const std::string& key) {
    return static_cast<std::string>(
        Take(key, XmlRpc::XmlRpcValue::TypeString, true, "a text").value());
  }

  int Number(const std::string& key, int standard, int min, int max) {
    const std::string accepted =
        "a whole number from " + std::to_string(min) + " to " + std::to_string(max);
    auto value = Take(key, XmlRpc::XmlRpcValue::TypeInt, false, accepted);
    if (!value) return standard;
    const int number = static_cast<int>(*value);
    if (number < min || number > max) Refuse(key, accepted);
    return number;
  }

  bool Flag(const std::string& key, bool standard) {
    auto value = Take(key, XmlRpc::XmlRpcValue::TypeBoolean, false, "true or false");
    return value ? static_cast<bool>(*value) : standard;
  }

  void RejectUnknown() {
    for (const auto& entry : entry_) {
      if (known_.count(entry.first) != 0) continue;
      std::string accepted;
      for (const std::string& name : known_) accepted += (accepted.empty() ? "" : ", ") + name;
      throw Error("unknown key '" + entry.first + "' in parameter '" + place_ +
                  "', accepted are: " + accepted);
    }
  }

  [[noreturn]] void Refuse(const std::string& key, const std::string& accepted) {
    std::ostringstream text;
    if (entry_.hasMember(key)) entry_[key].write(text);
    throw Error("parameter '" + place_ + "/" + key + "' is " +
                (text.str().empty() ? "missing" : text.str()) + ", accepted is " + accepted);
  }

 private:
  std::optional<XmlRpc::XmlRpcValue> Take(const std::string& key, XmlRpc::XmlRpcValue::Type type,
                                          bool required, const std::string& accepted) {
    known_.insert(key);
    if (!entry_.hasMember(key)) {
      if (required) Refuse(key, accepted);
      return std::nullopt;
    }
    if (entry_[key].getType() != type) Refuse(key, accepted);
    return entry_[key];
  }

  XmlRpc::XmlRpcValue entry_;
  std::string place_;
  std::set<std::string> known_;
};

BridgeTopic ReadBridgeTopic(const XmlRpc::XmlRpcValue& entry, const std::string& place) {
  MqttBridgeTopicReader reader(entry, place);
  BridgeTopic topic;
  topic.name = reader.Text("name");
  if (!transport::IsValidId(topic.name))
    reader.Refuse("name", "1 to 64 characters of A-Z a-z 0-9 . _ -");
  topic.ros_topic = reader.Text("ros_topic");
  topic.type = reader.Text("type");
  topic.mqtt_topic = reader.Text("mqtt_topic");
  const std::string direction = reader.Text("direction");
  if (direction != "in" && direction != "out") reader.Refuse("direction", "in or out");
  topic.direction = direction == "in" ? BridgeDirection::kIn : BridgeDirection::kOut;
  topic.qos = reader.Number("qos", topic.qos, 0, 1);
  topic.max_bytes = reader.Number("max_bytes", topic.max_bytes, 1, kMaxMessageBytes);
  topic.keep_when_disconnected =
      reader.Flag("keep_when_disconnected", topic.keep_when_disconnected);
  topic.ros_queue = reader.Number("ros_queue", topic.ros_queue, 1, 100000);
  topic.write_version = reader.Number("write_version", topic.write_version, 0, 65535);
  if (topic.direction == BridgeDirection::kIn && topic.write_version != 0) {
    reader.Refuse("write_version", "0 where the direction is in");
  }
  reader.RejectUnknown();
  return topic;
}

/// What must hold so that no message can be attributed to the wrong vehicle.
void CheckBridgeTopic(const BridgeTopic& topic, const BridgeConfig& config) {
  const transport::TopicTemplate mqtt_topic(topic.mqtt_topic);
  const auto type =
      MakeBridgedType(topic.type, static_cast<std::size_t>(topic.max_bytes), topic.write_version);
  const bool has_vehicle_id = type->has_vehicle_id();
  const std::string what = "topic '" + topic.name + "' of the bridge ";
  if (config.role == BridgeRole::kZone) {
    if (topic.direction == BridgeDirection::kIn && !mqtt_topic.has_vehicle()) {
      throw Error(what + "has MQTT topic '" + topic.mqtt_topic +
                  "', but what a zone takes in must name its sender by a level {vehicle}");
    }
    if (mqtt_topic.has_vehicle() && !has_vehicle_id) {
      throw Error(what + "has type '" + topic.type +
                  "' without a field vehicle_id, so its MQTT topic cannot have {vehicle}");
    }
  }
  const bool is_zone = config.role == BridgeRole::kZone;
  if (mqtt_topic.has_cell() && is_zone == (topic.direction == BridgeDirection::kIn)) {
    throw Error(what + "has MQTT topic '" + topic.mqtt_topic +
                "', but the level {cell} is accepted in what a zone sends out and a vehicle takes "
                "in alone");
  }
  if (mqtt_topic.has_cell() && !type->has_place()) {
    throw Error(what + "has type '" + topic.type +
                "' without fields latitude and longitude, so its MQTT topic cannot have {cell}");
  }
  // Expands, and so checks, the names that are known now.
  mqtt_topic.Expand({config.zone, is_zone ? "any" : config.user, "any"});
}

std::vector<BridgeTopic> ReadBridgeTopics(ParameterReader& parameters) {
  XmlRpc::XmlRpcValue list = parameters.ReadList(
      "topics",
      "Topics that the bridge carries; docs/how-to/bridge-other-topics.md lists the keys of an "
      "entry. On the zone's side incoming messages get their vehicle_id from the level {vehicle} "
      "of the MQTT topic, which the broker lets only that vehicle write, and outgoing messages on "
      "a topic with {vehicle} go to the vehicle_id in the message, those on a topic with {cell} to "
      "the cell of its latitude and longitude. A vehicle hears of the cells on vehicle/cells.");
  if (list.getType() != XmlRpc::XmlRpcValue::TypeArray || list.size() == 0) {
    throw Error("parameter 'topics' of the bridge is no list, accepted is a list of topics");
  }
  std::vector<BridgeTopic> topics;
  std::set<std::string> names;
  for (int i = 0; i < list.size(); ++i) {
    topics.push_back(ReadBridgeTopic(list[i], "topics[" + std::to_string(i) + "]"));
    if (!names.insert(topics.back().name).second) {
      throw Error("topic name '" + topics.back().name + "' stands twice in parameter 'topics'");
    }
  }
  return topics;
}

/// One address of the list; `text` has no blanks around it.
transport::MqttAddress ParseBrokerAddress(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  const std::string digits = colon == std::string::npos ? "" : text.substr(colon + 1);
  std::string host = text.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);  // An IPv6 address has colons itself.
  } else if (host.find(':') != std::string::npos) {
    host.clear();
  }
  constexpr std::size_t kMostDigits = 5;
  const bool is_number = !digits.empty() && digits.size() <= kMostDigits &&
                         digits.find_first_not_of("0123456789") == std::string::npos;
  const int port = is_number ? std::stoi(digits) : 0;
  if (host.empty() || host.find_first_of(" \t[]") != std::string::npos || port < 1 ||
      port > 65535) {
    throw Error("parameter 'other_brokers' of the bridge has '" + text +
                "', accepted is HOST:PORT or [IPV6]:PORT, several with commas between");
  }
  return {host, port};
}

std::vector<transport::MqttAddress> ParseBrokerAddresses(const std::string& list) {
  std::vector<transport::MqttAddress> addresses;
  for (const std::string& part : SplitAtCommas(list)) addresses.push_back(ParseBrokerAddress(part));
  if (addresses.size() > kMaxOtherBrokers) {
    throw Error("parameter 'other_brokers' of the bridge has " + std::to_string(addresses.size()) +
                " addresses, accepted are at most " + std::to_string(kMaxOtherBrokers));
  }
  return addresses;
}

void ReadMqttConnection(ParameterReader& parameters, transport::MqttConfig& mqtt) {
  parameters.Section("Connection");
  parameters.Read(
      "clean_start", mqtt.clean_start,
      "true: the broker forgets the last session, and the messages it queued, at login.");
  parameters.Read("session_expiry_s", mqtt.session_expiry_s, {1, 7 * 24 * 3600},
                  "Time that the broker keeps session and queued messages after a loss.", "s");
  parameters.Read(
      "keepalive_s", mqtt.keepalive_s, {5, 65535},
      "Keep-alive of the connection. A silent connection is given up after 1.5 times this.", "s");
  parameters.Read("connect_timeout_s", mqtt.connect_timeout_s, {0.1, 600},
                  "Time limit of a connection attempt, per address of the host.", "s");
  parameters.Read(
      "reconnect_min_s", mqtt.reconnect_min_s, {0.01, 600},
      "First wait after a loss. It doubles each time, and is shortened by up to half at random.",
      "s");
  parameters.Read("reconnect_max_s", mqtt.reconnect_max_s, {0.01, 3600},
                  "Longest wait after a loss.", "s");
  parameters.Read("max_inflight", mqtt.max_inflight, {1, 65535},
                  "Number of QoS 1 messages sent and not yet acknowledged.");
  parameters.Read("queue_messages", mqtt.queue_messages, {1, 1e6},
                  "Number of messages that may wait for the connection. Beyond it messages are "
                  "dropped and counted.");
  parameters.Read("queue_bytes", mqtt.queue_bytes, {1, 1 << 30},
                  "The same in bytes of payload and topic.", "bytes");
  parameters.Read("max_packet_bytes", mqtt.max_packet_bytes, {1, 1 << 28},
                  "Largest packet that is accepted from the broker.", "bytes");
}

/// The three TLS files, or none of them.
std::optional<transport::MqttTlsConfig> ReadMqttTlsOptions(ParameterReader& parameters) {
  transport::MqttTlsConfig tls;
  parameters.Read("ca_file", tls.ca_file,
                  "Certificate of the zone's authority, a PEM file. TLS 1.3 needs ca_file, "
                  "certificate_file and key_file, all three; none means plain TCP. The broker's "
                  "certificate must be for the name in host. The launch files set all three by the "
                  "argument `identity`; docs/how-to/enroll-a-vehicle.md tells how to make them.");
  parameters.Read("certificate_file", tls.certificate_file,
                  "The vehicle's or zone's own certificate, a PEM file.");
  parameters.Read("key_file", tls.key_file, "The key of that certificate, a PEM file.");
  const std::pair<const char*, std::string*> files[] = {{"ca_file", &tls.ca_file},
                                                        {"certificate_file", &tls.certificate_file},
                                                        {"key_file", &tls.key_file}};
  if (tls.ca_file.empty() && tls.certificate_file.empty() && tls.key_file.empty()) {
    return std::nullopt;
  }
  for (const auto& [name, path] : files) {
    if (path->empty()) {
      throw Error("parameter '" + std::string(name) +
                  "' of the bridge is missing, ca_file, certificate_file and key_file go together");
    }
  }
  return tls;
}

void ReadBridgeNames(ParameterReader& parameters, BridgeConfig& config) {
  std::string role;
  parameters.ReadChoice("role", role, {"vehicle", "zone"}, "Side of the bridge. Required.");
  if (role.empty())
    throw Error("parameter 'role' of the bridge is missing, accepted is vehicle or zone");
  config.role = role == "zone" ? BridgeRole::kZone : BridgeRole::kVehicle;
  parameters.ReadRequired("zone", config.zone, "demo",
                          "Name of the zone whose broker this is, 1 to 64 of A-Z a-z 0-9 . _ -. "
                          "The launch files set it by the argument `zone`.");
  parameters.ReadRequired("user", config.user, "car-1",
                          "Login at the broker: the vehicle's id, which vehicle.launch sets by the "
                          "argument `vehicle`, or the zone's login.");
  for (const auto& [name, value] : {std::pair{"zone", config.zone}, {"user", config.user}}) {
    if (!transport::IsValidId(value)) {
      throw Error("parameter '" + std::string(name) + "' of the bridge is '" + value +
                  "', accepted are 1 to 64 characters of A-Z a-z 0-9 . _ -");
    }
  }
}

/// A zone's connection carries the messages of many vehicles and is to be down for longer.
void SetZoneBridgeDefaults(transport::MqttConfig& mqtt) {
  mqtt.session_expiry_s = 3600;
  mqtt.max_inflight = 1000;
  mqtt.queue_messages = 10000;
}

void ReadBridgeZoneDirectory(ParameterReader& parameters, BridgeConfig& config) {
  parameters.Section("Zone directory");
  config.zones.zone = config.zone;
  ReadZoneDirectory(parameters, config.zones,
                    "File of the authority's signed zone directory "
                    "(docs/reference/zone-directory.md). A zone gives it to its vehicles. A "
                    "vehicle changes zones by it, and a newer one that a zone gives it takes its "
                    "place; it need not be there at first. Empty: a vehicle stays with `zone`, and "
                    "a zone gives none. The launch files set it by the argument "
                    "`zone_directory`.");
}

void ReadDirectoryHandout(ParameterReader& parameters, BridgeConfig& config) {
  parameters.Read("zone_directory_repeat_s", config.handout.repeat_s, {1, 86400},
                  "A vehicle is given the directory at its first message, at the first one after "
                  "the directory changed, and again after this time.",
                  "s");
}

void ReadZoneHandover(ParameterReader& parameters, BridgeConfig& config) {
  directory::ZoneHandover::Config& handover = config.handover;
  parameters.Section("Changing zones",
                     "With a zone directory a vehicle connects to the zone in which it is "
                     "(docs/explanation/changing-zones.md). `zone`, `host` and `port` then are "
                     "those of the zone until the first position comes, and where no directory "
                     "counts.");
  parameters.Read("zone_hysteresis_m", handover.choice.hysteresis_m, {0, 10000},
                  "The vehicle changes to another zone once it lies deeper in that by this.", "m");
  parameters.Read("zone_max_gap_m", handover.choice.max_gap_m, {0, 100000},
                  "A vehicle that no zone contains takes the nearest one within this distance.",
                  "m");
  parameters.Read("zone_near_m", handover.near_m, {0, 20000},
                  "The vehicle is also connected to zones whose area is this near, and tells them "
                  "where it is.",
                  "m");
  parameters.Read("zone_linger_s", handover.linger_s, {0, 3600},
                  "A zone left behind stays connected for this time after the last message to it. "
                  "It is longer than `resend_longest_s` of hazard_reporting.",
                  "s");
  parameters.Read("zone_longest_linger_s", handover.longest_linger_s, {0, 86400},
                  "Longest such time while messages to the zone still wait.", "s");
  int max_zones = static_cast<int>(handover.max_zones);
  parameters.Read("zone_max_connections", max_zones, {1, 16},
                  "Number of zones that are connected at the same time.");
  handover.max_zones = static_cast<std::size_t>(max_zones);
}

}  // namespace

BridgeConfig ReadBridgeConfig(ParameterReader& parameters) {
  BridgeConfig config;
  ReadBridgeNames(parameters, config);
  if (config.role == BridgeRole::kZone) SetZoneBridgeDefaults(config.mqtt);
  parameters.Section("Broker");
  parameters.Read(
      "host", config.mqtt.host,
      "Name or address of the broker. The launch files set it by the argument `broker_host`.");
  parameters.Read("port", config.mqtt.port, {1, 65535},
                  "Port of the broker. The launch files set it by the argument `broker_port`.");
  std::string other_brokers;
  parameters.Read("other_brokers", other_brokers,
                  "Addresses of the broker's other nodes, where it is a cluster "
                  "(docs/how-to/run-a-broker-cluster.md): HOST:PORT, several with commas between. "
                  "Each attempt to connect begins with host and port and takes the first that "
                  "answers. The launch files set it by the argument `other_brokers`.");
  config.mqtt.fallbacks = ParseBrokerAddresses(other_brokers);
  parameters.Read(
      "password_file", config.password_file,
      "File whose first line is the password. `livemap broker` writes DIRECTORY/credentials/USER. "
      "Empty: log in without a password. The launch files set it by the argument `password_file`.");
  parameters.Read("password_wait_s", config.password_wait_s, {0, 600},
                  "Time to wait at the start for a broker that is just writing the password file.",
                  "s");
  config.mqtt.tls = ReadMqttTlsOptions(parameters);
  ReadMqttConnection(parameters, config.mqtt);
  if (config.role == BridgeRole::kZone) {
    parameters.Read("active_timeout_s", config.active_timeout_s, {0, 600},
                    "The bridge is connected only while zone_cloudlet has said on zone/active, "
                    "less than this time ago, that it is the zone's active process "
                    "(docs/how-to/run-a-standby.md). 0: it is always connected. zone.launch sets "
                    "it by the argument `lease_s`.",
                    "s");
  }
  ReadBridgeZoneDirectory(parameters, config);
  if (config.role == BridgeRole::kZone) {
    ReadDirectoryHandout(parameters, config);
  } else {
    ReadZoneHandover(parameters, config);
  }
  parameters.Section("Period of the diagnostics");
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s, 0.1);
  config.mqtt.client_id = config.user;
  config.mqtt.user = config.user;
  parameters.Section("Topics");
  config.topics = ReadBridgeTopics(parameters);
  parameters.RejectUnknown();
  for (const BridgeTopic& topic : config.topics) CheckBridgeTopic(topic, config);
  return config;
}

std::string ReadPassword(const std::string& path, double wait_s) {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(wait_s);
  while (!std::filesystem::exists(path) && ros::WallTime::now() < deadline) {
    ros::WallDuration(0.1).sleep();
  }
  const std::string text = ReadTextFile(path, kMaxPasswordFileBytes);
  std::string password = text.substr(0, text.find_first_of("\r\n"));
  if (password.empty()) throw Error("password file '" + path + "' has an empty first line");
  return password;
}

}  // namespace livemap::ros_io
