#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "common/error.h"
#include "ros/bridge/bridged_type.h"
#include "transport/envelope.h"
#include "transport/mqtt_client.h"

namespace livemap::bench {

/// A message as it travels between vehicles and a zone.
template <typename Message>
std::vector<std::uint8_t> Enclose(const Message& message) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return transport::EncodeEnvelope({ros::message_traits::datatype<Message>(),
                                    *transport::ParseMd5(ros::message_traits::md5sum<Message>()),
                                    {bytes.data(), bytes.size()}});
}

/// What Enclose has made. The zone is ours: what it sends is trusted but for its type. Throws Error
/// for another type.
template <typename Message>
Message Open(const transport::MqttMessage& message) {
  constexpr std::size_t kMaxBytes = 1 << 20;
  static const auto type =
      ros_io::MakeBridgedType(ros::message_traits::datatype<Message>(), kMaxBytes);
  const ros_io::DecodedBridgeMessage decoded = type->Decode(message.payload);
  if (!decoded.reason.empty()) throw Error("message of the zone: " + decoded.reason);
  Message content;
  const transport::ByteView payload = decoded.serialised;
  // The stream wants a writable pointer and only reads.
  ros::serialization::IStream stream(const_cast<std::uint8_t*>(payload.data),
                                     static_cast<std::uint32_t>(payload.size));
  ros::serialization::deserialize(stream, content);
  return content;
}

/// The first line of the file. Throws Error where there is none.
inline std::string PasswordOf(const std::string& path) {
  std::ifstream file(path);
  std::string password;
  if (!file) throw Error("'" + path + "' cannot be opened: " + std::strerror(errno));
  if (!std::getline(file, password)) throw Error("no password in '" + path + "'");
  return password;
}

}  // namespace livemap::bench
