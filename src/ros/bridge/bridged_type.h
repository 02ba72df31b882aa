#pragma once

#include <ros/node_handle.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "transport/envelope.h"
#include "transport/message_layout.h"

namespace livemap::ros_io {

/// A message on its way from ROS to the broker.
struct OutgoingBridgeMessage {
  std::vector<std::uint8_t> envelope;
  std::string vehicle_id;  ///< The message's own field; empty where the type has none.
  /// Why every receiver would refuse the message (a field over its limit); it has no envelope then.
  std::optional<std::string> fault;
};

/// An older definition of a message that is still accepted: the present one without its last
/// fields. Those are filled with zeros, `schema_version` stays the sender's.
struct EarlierDefinition {
  std::string md5;              ///< 32 hex digits, as ROS computes it.
  std::size_t added_bytes = 0;  ///< That the fields added since take, all of them of fixed size.
};

/// One message type that the MQTT bridge can carry in both directions.
class BridgedType {
 public:
  using Send = std::function<void(OutgoingBridgeMessage)>;

  virtual ~BridgedType() = default;

  const std::string& name() const { return name_; }
  /// Whether the type has a field `vehicle_id` for the sender or the addressee.
  virtual bool has_vehicle_id() const = 0;

  /// Hands every message on `topic` to `send`, in its envelope.
  virtual ros::Subscriber Subscribe(ros::NodeHandle& handle, const std::string& topic,
                                    std::uint32_t queue_size, Send send) const = 0;
  virtual ros::Publisher Advertise(ros::NodeHandle& handle, const std::string& topic,
                                   std::uint32_t queue_size) const = 0;

  /// Publishes the message in untrusted MQTT bytes: envelope, type, definition and every length are
  /// checked before anything is deserialised. When `vehicle_id` is given, the message's field
  /// becomes that, whatever the bytes say. Returns why the bytes were refused, or nothing.
  std::optional<std::string> PublishChecked(const ros::Publisher& publisher,
                                            transport::ByteView bytes,
                                            const std::optional<std::string>& vehicle_id) const;

 protected:
  BridgedType(std::string name, const std::string& md5, const std::string& definition,
              std::size_t max_bytes, const transport::LayoutLimits& limits,
              const std::vector<EarlierDefinition>& earlier);

  std::optional<std::string> Check(transport::ByteView serialised) const;
  std::vector<std::uint8_t> Enclose(const std::vector<std::uint8_t>& serialised) const;

 private:
  /// `serialised` has passed all checks.
  virtual void Publish(const ros::Publisher& publisher, transport::ByteView serialised,
                       const std::optional<std::string>& vehicle_id) const = 0;

  std::optional<std::size_t> AddedSince(const transport::Md5& md5) const;

  std::string name_;
  transport::Md5 md5_;
  std::vector<std::pair<transport::Md5, std::size_t>> earlier_;  // And what was added since, bytes.
  std::size_t max_bytes_;
  transport::MessageLayout layout_;
};

/// The names that MakeBridgedType accepts, sorted.
std::vector<std::string> BridgedTypeNames();

/// The type called `name` ("livemap/HazardReport"), whose serialised messages may have up to
/// `max_bytes` bytes. Throws Error listing the known names for any other.
std::unique_ptr<BridgedType> MakeBridgedType(const std::string& name, std::size_t max_bytes);

}  // namespace livemap::ros_io
