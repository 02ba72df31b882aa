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
  std::string zone;        ///< The same of the field `zone`, which the envelope does not have.
  /// Quadkey of the cell in which the message's place lies; empty where it has no valid one.
  std::string cell;
  /// Why every receiver would refuse the message (a field over its limit); it has no envelope then.
  std::optional<std::string> fault;
};

/// An older definition of a message that is still accepted: the present one without its last
/// fields. Those are filled with zeros, `schema_version` stays the sender's.
struct EarlierDefinition {
  int version = 0;              ///< Its SCHEMA_VERSION.
  std::string md5;              ///< 32 hex digits, as ROS computes it.
  std::size_t added_bytes = 0;  ///< That the fields added since take, where arrays are empty.
};

/// What a bridge writes into a message that comes in, whatever the message says itself.
struct BridgeOrigin {
  std::optional<std::string> vehicle_id;  ///< Nothing: the message's own stays.
  std::string zone;                       ///< Id; empty on the zone's side.
};

/// The serialisation of a received message by the type's present definition.
struct DecodedBridgeMessage {
  transport::ByteView serialised;       ///< Points into the received bytes or into `completed`.
  std::vector<std::uint8_t> completed;  ///< Empty where the sender's definition is the present one.
  std::string reason;                   ///< Why there is none; empty when there is one.
};

/// One message type that the MQTT bridge can carry in both directions.
///
/// A last field `string zone` says on a vehicle to which zone a message goes or from which it
/// comes. On the wire the topic says that: there the message travels by the definition without the
/// field, which is the one that vehicles and zones knew before they had it.
class BridgedType {
 public:
  using Send = std::function<void(OutgoingBridgeMessage)>;

  virtual ~BridgedType() = default;

  const std::string& name() const { return name_; }
  /// Whether the type has a field `vehicle_id` for the sender or the addressee.
  virtual bool has_vehicle_id() const = 0;
  /// Whether the type has a place, fields `latitude` and `longitude`.
  virtual bool has_place() const = 0;

  /// Hands every message on `topic` to `send`, in its envelope.
  virtual ros::Subscriber Subscribe(ros::NodeHandle& handle, const std::string& topic,
                                    std::uint32_t queue_size, Send send) const = 0;
  virtual ros::Publisher Advertise(ros::NodeHandle& handle, const std::string& topic,
                                   std::uint32_t queue_size) const = 0;

  /// Reads untrusted MQTT bytes, which must outlive the result: envelope, type, definition and
  /// every length are checked, so that the result can be deserialised.
  DecodedBridgeMessage Decode(transport::ByteView bytes) const;
  /// Publishes the message in untrusted MQTT bytes, after Decode, with the fields that `origin`
  /// gives. Returns why the bytes were refused, or nothing.
  std::optional<std::string> PublishChecked(const ros::Publisher& publisher,
                                            transport::ByteView bytes,
                                            const BridgeOrigin& origin) const;

 protected:
  /// `md5` is that of the definition. `md5_without_zone` is empty where that has no field `zone`;
  /// the earlier ones have none. `write_version` is as for MakeBridgedType.
  BridgedType(std::string name, const std::string& md5, const std::string& md5_without_zone,
              const std::string& definition, std::size_t max_bytes,
              const transport::LayoutLimits& limits, const std::vector<EarlierDefinition>& earlier,
              int write_version);

  /// The earlier definition by which messages are written; null: the present one.
  const EarlierDefinition* written() const { return written_ ? &*written_ : nullptr; }

  std::optional<std::string> Check(transport::ByteView serialised) const;
  /// `zone_size` is the length of the text in the field `zone`, where there is one.
  std::vector<std::uint8_t> Enclose(const std::vector<std::uint8_t>& serialised,
                                    std::size_t zone_size) const;

 private:
  /// `serialised` has passed all checks.
  virtual void Publish(const ros::Publisher& publisher, transport::ByteView serialised,
                       const BridgeOrigin& origin) const = 0;

  std::optional<std::size_t> AddedSince(const transport::Md5& md5) const;

  std::string name_;
  std::optional<EarlierDefinition> written_;
  transport::Md5 wire_md5_;
  bool has_zone_;
  std::vector<std::pair<transport::Md5, std::size_t>> known_;  // And what was added since, bytes.
  std::size_t max_bytes_;
  transport::MessageLayout layout_;
};

/// The names that MakeBridgedType accepts, sorted.
std::vector<std::string> BridgedTypeNames();

/// The type called `name` ("livemap/HazardReport"), whose serialised messages may have up to
/// `max_bytes` bytes. Messages are written as their SCHEMA_VERSION `write_version` defines them,
/// for receivers that know no newer one; 0: the present one. Throws Error listing the known names,
/// or the versions that can be written, for any other.
std::unique_ptr<BridgedType> MakeBridgedType(const std::string& name, std::size_t max_bytes,
                                             int write_version = 0);

}  // namespace livemap::ros_io
