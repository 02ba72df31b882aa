#include "ros/bridge/bridged_type.h"

#include <livemap/CandidateFrame.h>
#include <livemap/CellHazards.h>
#include <livemap/CellRequest.h>
#include <livemap/HazardNotice.h>
#include <livemap/HazardPoll.h>
#include <livemap/HazardPollAnswer.h>
#include <livemap/HazardReport.h>
#include <livemap/MapChange.h>
#include <livemap/ReportReceipt.h>
#include <livemap/VehiclePosition.h>
#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <map>
#include <type_traits>
#include <utility>

#include "common/error.h"
#include "geo/map_cell.h"

namespace livemap::ros_io {
namespace {

template <typename Message, typename = void>
struct HasVehicleId : std::false_type {};
template <typename Message>
struct HasVehicleId<Message, std::void_t<decltype(std::declval<Message&>().vehicle_id)>>
    : std::true_type {};

template <typename Message, typename = void>
struct HasZone : std::false_type {};
template <typename Message>
struct HasZone<Message, std::void_t<decltype(std::declval<Message&>().zone)>> : std::true_type {};

template <typename Message, typename = void>
struct HasPlace : std::false_type {};
template <typename Message>
struct HasPlace<Message, std::void_t<decltype(std::declval<Message&>().latitude),
                                     decltype(std::declval<Message&>().longitude)>>
    : std::true_type {};

template <typename Message, typename = void>
struct HasCourses : std::false_type {};
template <typename Message>
struct HasCourses<Message, std::void_t<decltype(std::declval<Message&>().courses)>>
    : std::true_type {};

template <typename Message, typename = void>
struct HasTrails : std::false_type {};
template <typename Message>
struct HasTrails<Message, std::void_t<decltype(std::declval<Message&>().trails)>> : std::true_type {
};

/// Of a serialised text before its characters.
constexpr std::size_t kTextLengthBytes = 4;

transport::Md5 RequireBridgedMd5(const std::string& name, const std::string& text) {
  const std::optional<transport::Md5> md5 = transport::ParseMd5(text);
  if (!md5) throw Error("message type '" + name + "' has no MD5 but '" + text + "'");
  return *md5;
}

/// None for version 0, which is the present one.
std::optional<EarlierDefinition> FindWritten(const std::string& name,
                                             const std::vector<EarlierDefinition>& earlier,
                                             int write_version) {
  if (write_version == 0) return std::nullopt;
  std::string accepted = "0 (the present one)";
  for (const EarlierDefinition& definition : earlier) {
    if (definition.version == write_version) return definition;
    accepted += ", " + std::to_string(definition.version);
  }
  throw Error("message type '" + name + "' cannot be written as version " +
              std::to_string(write_version) + ", accepted is " + accepted);
}

template <typename Message>
class TypedBridge : public BridgedType {
 public:
  TypedBridge(std::size_t max_bytes, const std::string& md5_without_zone,
              const transport::LayoutLimits& limits, const std::vector<EarlierDefinition>& earlier,
              int write_version)
      : BridgedType(ros::message_traits::datatype<Message>(),
                    ros::message_traits::md5sum<Message>(), md5_without_zone,
                    ros::message_traits::definition<Message>(), max_bytes, limits, earlier,
                    write_version) {}

  bool has_vehicle_id() const override { return HasVehicleId<Message>::value; }
  bool has_place() const override { return HasPlace<Message>::value; }

  ros::Subscriber Subscribe(ros::NodeHandle& handle, const std::string& topic,
                            std::uint32_t queue_size, Send send) const override {
    using Pointer = boost::shared_ptr<Message const>;
    const boost::function<void(const Pointer&)> callback =
        [this, send = std::move(send)](const Pointer& message) {
          OutgoingBridgeMessage outgoing;
          if constexpr (HasVehicleId<Message>::value) outgoing.vehicle_id = message->vehicle_id;
          if constexpr (HasZone<Message>::value) outgoing.zone = message->zone;
          if constexpr (HasPlace<Message>::value) {
            const geo::GeoPoint place{message->latitude, message->longitude};
            if (geo::IsValid(place)) outgoing.cell = geo::MapCell::At(place).Quadkey();
          }
          const std::vector<std::uint8_t> serialised =
              written() == nullptr ? Serialise(*message) : Serialise(AsEarlier(*message));
          outgoing.fault = Check({serialised.data(), serialised.size()});
          if (!outgoing.fault) outgoing.envelope = Enclose(serialised, outgoing.zone.size());
          send(std::move(outgoing));
        };
    return handle.subscribe<Message>(topic, queue_size, callback);
  }

  ros::Publisher Advertise(ros::NodeHandle& handle, const std::string& topic,
                           std::uint32_t queue_size) const override {
    return handle.advertise<Message>(topic, queue_size);
  }

 private:
  /// With nothing in the arrays that the earlier definition does not have.
  Message AsEarlier(Message message) const {
    message.schema_version = static_cast<std::uint16_t>(written()->version);
    constexpr int kCellsWithCourses = 2;
    if constexpr (HasTrails<Message>::value) message.trails.clear();
    if constexpr (HasCourses<Message>::value) {
      if (written()->version < kCellsWithCourses) message.courses.clear();
    }
    return message;
  }

  static std::vector<std::uint8_t> Serialise(const Message& message) {
    std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
    ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::serialize(stream, message);
    return bytes;
  }

  void Publish(const ros::Publisher& publisher, transport::ByteView serialised,
               const BridgeOrigin& origin) const override {
    const boost::shared_ptr<Message> message = boost::make_shared<Message>();
    // The stream wants a writable pointer and only reads.
    ros::serialization::IStream stream(const_cast<std::uint8_t*>(serialised.data),
                                       static_cast<std::uint32_t>(serialised.size));
    ros::serialization::deserialize(stream, *message);
    if constexpr (HasVehicleId<Message>::value) {
      if (origin.vehicle_id) message->vehicle_id = *origin.vehicle_id;
    }
    if constexpr (HasZone<Message>::value) message->zone = origin.zone;
    publisher.publish(message);
  }
};

using Factory =
    std::function<std::unique_ptr<BridgedType>(std::size_t max_bytes, int write_version)>;

/// `bulk_fields` may fill a message to its own limit; all other strings and arrays are short.
template <typename Message>
std::pair<const std::string, Factory> BridgedTypeEntry(
    const std::string& md5_without_zone, const std::vector<std::string>& bulk_fields = {},
    const std::vector<EarlierDefinition>& earlier = {}) {
  return {ros::message_traits::datatype<Message>(), [=](std::size_t max_bytes, int write_version) {
            transport::LayoutLimits limits;
            for (const std::string& field : bulk_fields) limits.fields[field] = max_bytes;
            return std::make_unique<TypedBridge<Message>>(max_bytes, md5_without_zone, limits,
                                                          earlier, write_version);
          }};
}

/// A new message type joins the bridge by one line here. Of reports and polls version 1 did not say
/// what a picture shows, of positions version 2 not how old the outbox is, and what a zone tells of
/// hazards did not have their courses, and then not their trails.
const std::map<std::string, Factory>& BridgedTypeRegistry() {
  static const std::map<std::string, Factory> kRegistry = {
      BridgedTypeEntry<CandidateFrame>("", {"image.data"}),
      BridgedTypeEntry<CellHazards>(
          "1703bed8d13e8657113584719179292f", {},
          {{1, "83fa272e40c3f88a9c695865cbe9209e", 8}, {2, "ef3eb3b08eefca405332cf9c2d023276", 4}}),
      BridgedTypeEntry<CellRequest>("eceb8c87685360e56aeb929ad7c324e1"),
      BridgedTypeEntry<HazardNotice>(
          "03acdf49de664439a0bbf08c02931b45", {"image.data"},
          {{2, "88d23041ceb511154d96daa5ff718aef", 8}, {3, "635a641ecabd332c30bfc02d4414dff3", 4}}),
      BridgedTypeEntry<HazardPoll>("78c6f168c0bc4ed892e7fbea24487d70", {},
                                   {{1, "71097a76ee723564ac4d8188dc96c5b0", 1}}),
      BridgedTypeEntry<HazardPollAnswer>("8f9e01f2a6d515909b89b0b9949f6e21", {"image.data"}),
      BridgedTypeEntry<HazardReport>("157e70184e3e48f3be020c650d2f788a", {"image.data"},
                                     {{1, "6c9f383b83ba26551f53b42caa304fa7", 16}}),
      BridgedTypeEntry<MapChange>("f0c59a6ee1ac17ed9fe4b38192a4afe1"),
      BridgedTypeEntry<ReportReceipt>("3bb0f7c51314b5a5e3dd08cca0268f28"),
      BridgedTypeEntry<VehiclePosition>("c1b41f81adbf946a004a6ca4f4769454", {},
                                        {{2, "9146c7869de30f12ed97927d98d9681d", 4}}),
  };
  return kRegistry;
}

}  // namespace

BridgedType::BridgedType(std::string name, const std::string& md5,
                         const std::string& md5_without_zone, const std::string& definition,
                         std::size_t max_bytes, const transport::LayoutLimits& limits,
                         const std::vector<EarlierDefinition>& earlier, int write_version)
    : name_(std::move(name)),
      written_(FindWritten(name_, earlier, write_version)),
      wire_md5_(RequireBridgedMd5(name_, md5_without_zone.empty() ? md5 : md5_without_zone)),
      has_zone_(!md5_without_zone.empty()),
      max_bytes_(max_bytes),
      layout_(name_, definition, limits) {
  const std::size_t zone_bytes = has_zone_ ? kTextLengthBytes : 0;  // Of an empty one.
  known_ = {{RequireBridgedMd5(name_, md5), 0}, {wire_md5_, zone_bytes}};
  for (const EarlierDefinition& definition_before : earlier) {
    known_.emplace_back(RequireBridgedMd5(name_, definition_before.md5),
                        definition_before.added_bytes + zone_bytes);
  }
}

/// Bytes that the present definition has more than the one of that MD5; none: it is not known.
std::optional<std::size_t> BridgedType::AddedSince(const transport::Md5& md5) const {
  for (const auto& [known, added_bytes] : known_) {
    if (known == md5) return added_bytes;
  }
  return std::nullopt;
}

std::optional<std::string> BridgedType::Check(transport::ByteView serialised) const {
  return layout_.Check(serialised);
}

std::vector<std::uint8_t> BridgedType::Enclose(const std::vector<std::uint8_t>& serialised,
                                               std::size_t zone_size) const {
  const std::size_t left_out =
      (has_zone_ ? kTextLengthBytes + zone_size : 0) + (written_ ? written_->added_bytes : 0);
  const transport::Md5 md5 = written_ ? RequireBridgedMd5(name_, written_->md5) : wire_md5_;
  return transport::EncodeEnvelope({name_, md5, {serialised.data(), serialised.size() - left_out}});
}

DecodedBridgeMessage BridgedType::Decode(transport::ByteView bytes) const {
  DecodedBridgeMessage message;
  const transport::DecodedEnvelope decoded = transport::DecodeEnvelope(bytes, max_bytes_);
  if (!decoded.envelope) {
    message.reason = decoded.reason;
    return message;
  }
  if (decoded.envelope->type != name_) {
    message.reason = "the message is of type '" + std::string(decoded.envelope->type) +
                     "', accepted is '" + name_ + "'";
    return message;
  }
  const std::optional<std::size_t> added = AddedSince(decoded.envelope->md5);
  if (!added) {
    message.reason = "the sender knows another definition of '" + name_ + "' (different MD5)";
    return message;
  }
  message.serialised = decoded.envelope->payload;
  if (*added > 0) {
    const transport::ByteView payload = decoded.envelope->payload;
    message.completed.reserve(payload.size + *added);
    message.completed.assign(payload.data, payload.data + payload.size);
    message.completed.resize(payload.size + *added, 0);
    message.serialised = {message.completed.data(), message.completed.size()};
  }
  message.reason = layout_.Check(message.serialised).value_or("");
  return message;
}

std::optional<std::string> BridgedType::PublishChecked(const ros::Publisher& publisher,
                                                       transport::ByteView bytes,
                                                       const BridgeOrigin& origin) const {
  DecodedBridgeMessage message = Decode(bytes);
  if (!message.reason.empty()) return std::move(message.reason);
  Publish(publisher, message.serialised, origin);
  return std::nullopt;
}

std::vector<std::string> BridgedTypeNames() {
  std::vector<std::string> names;
  for (const auto& entry : BridgedTypeRegistry()) names.push_back(entry.first);
  return names;
}

std::unique_ptr<BridgedType> MakeBridgedType(const std::string& name, std::size_t max_bytes,
                                             int write_version) {
  const auto found = BridgedTypeRegistry().find(name);
  if (found != BridgedTypeRegistry().end()) return found->second(max_bytes, write_version);
  std::string accepted;
  for (const std::string& known : BridgedTypeNames()) {
    accepted += (accepted.empty() ? "" : ", ") + known;
  }
  throw Error("message type '" + name + "' is not known to the bridge, accepted are: " + accepted);
}

}  // namespace livemap::ros_io
