#include "ros/bridge/bridged_type.h"

#include <livemap/CandidateFrame.h>
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

namespace livemap::ros_io {
namespace {

template <typename Message, typename = void>
struct HasVehicleId : std::false_type {};
template <typename Message>
struct HasVehicleId<Message, std::void_t<decltype(std::declval<Message&>().vehicle_id)>>
    : std::true_type {};

transport::Md5 RequireBridgedMd5(const std::string& name, const std::string& text) {
  const std::optional<transport::Md5> md5 = transport::ParseMd5(text);
  if (!md5) throw Error("message type '" + name + "' has no MD5 but '" + text + "'");
  return *md5;
}

template <typename Message>
class TypedBridge : public BridgedType {
 public:
  TypedBridge(std::size_t max_bytes, const transport::LayoutLimits& limits,
              const std::vector<EarlierDefinition>& earlier)
      : BridgedType(ros::message_traits::datatype<Message>(),
                    ros::message_traits::md5sum<Message>(),
                    ros::message_traits::definition<Message>(), max_bytes, limits, earlier) {}

  bool has_vehicle_id() const override { return HasVehicleId<Message>::value; }

  ros::Subscriber Subscribe(ros::NodeHandle& handle, const std::string& topic,
                            std::uint32_t queue_size, Send send) const override {
    using Pointer = boost::shared_ptr<Message const>;
    const boost::function<void(const Pointer&)> callback =
        [this, send = std::move(send)](const Pointer& message) {
          OutgoingBridgeMessage outgoing;
          if constexpr (HasVehicleId<Message>::value) outgoing.vehicle_id = message->vehicle_id;
          const std::vector<std::uint8_t> serialised = Serialise(*message);
          outgoing.fault = Check({serialised.data(), serialised.size()});
          if (!outgoing.fault) outgoing.envelope = Enclose(serialised);
          send(std::move(outgoing));
        };
    return handle.subscribe<Message>(topic, queue_size, callback);
  }

  ros::Publisher Advertise(ros::NodeHandle& handle, const std::string& topic,
                           std::uint32_t queue_size) const override {
    return handle.advertise<Message>(topic, queue_size);
  }

 private:
  static std::vector<std::uint8_t> Serialise(const Message& message) {
    std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
    ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::serialize(stream, message);
    return bytes;
  }

  void Publish(const ros::Publisher& publisher, transport::ByteView serialised,
               const std::optional<std::string>& vehicle_id) const override {
    const boost::shared_ptr<Message> message = boost::make_shared<Message>();
    // The stream wants a writable pointer and only reads.
    ros::serialization::IStream stream(const_cast<std::uint8_t*>(serialised.data),
                                       static_cast<std::uint32_t>(serialised.size));
    ros::serialization::deserialize(stream, *message);
    if constexpr (HasVehicleId<Message>::value) {
      if (vehicle_id) message->vehicle_id = *vehicle_id;
    }
    publisher.publish(message);
  }
};

using Factory = std::function<std::unique_ptr<BridgedType>(std::size_t max_bytes)>;

/// `bulk_fields` may fill a message to its own limit; all other strings and arrays are short.
template <typename Message>
std::pair<const std::string, Factory> BridgedTypeEntry(
    const std::vector<std::string>& bulk_fields = {},
    const std::vector<EarlierDefinition>& earlier = {}) {
  return {ros::message_traits::datatype<Message>(), [bulk_fields, earlier](std::size_t max_bytes) {
            transport::LayoutLimits limits;
            for (const std::string& field : bulk_fields) limits.fields[field] = max_bytes;
            return std::make_unique<TypedBridge<Message>>(max_bytes, limits, earlier);
          }};
}

/// A new message type joins the bridge by one line here. The earlier definitions are version 1 of
/// theirs, which did not say what a picture shows.
const std::map<std::string, Factory>& BridgedTypeRegistry() {
  static const std::map<std::string, Factory> kRegistry = {
      BridgedTypeEntry<CandidateFrame>({"image.data"}),
      BridgedTypeEntry<HazardNotice>({"image.data"}),
      BridgedTypeEntry<HazardPoll>({}, {{"71097a76ee723564ac4d8188dc96c5b0", 1}}),
      BridgedTypeEntry<HazardPollAnswer>({"image.data"}),
      BridgedTypeEntry<HazardReport>({"image.data"}, {{"6c9f383b83ba26551f53b42caa304fa7", 16}}),
      BridgedTypeEntry<MapChange>(),
      BridgedTypeEntry<ReportReceipt>(),
      BridgedTypeEntry<VehiclePosition>(),
  };
  return kRegistry;
}

}  // namespace

BridgedType::BridgedType(std::string name, const std::string& md5, const std::string& definition,
                         std::size_t max_bytes, const transport::LayoutLimits& limits,
                         const std::vector<EarlierDefinition>& earlier)
    : name_(std::move(name)),
      md5_(RequireBridgedMd5(name_, md5)),
      max_bytes_(max_bytes),
      layout_(name_, definition, limits) {
  for (const EarlierDefinition& definition_before : earlier) {
    earlier_.emplace_back(RequireBridgedMd5(name_, definition_before.md5),
                          definition_before.added_bytes);
  }
}

/// Bytes that the present definition has more than the one of that MD5; none: it is not known.
std::optional<std::size_t> BridgedType::AddedSince(const transport::Md5& md5) const {
  if (md5 == md5_) return 0;
  for (const auto& [earlier, added_bytes] : earlier_) {
    if (earlier == md5) return added_bytes;
  }
  return std::nullopt;
}

std::optional<std::string> BridgedType::Check(transport::ByteView serialised) const {
  return layout_.Check(serialised);
}

std::vector<std::uint8_t> BridgedType::Enclose(const std::vector<std::uint8_t>& serialised) const {
  return transport::EncodeEnvelope({name_, md5_, {serialised.data(), serialised.size()}});
}

std::optional<std::string> BridgedType::PublishChecked(
    const ros::Publisher& publisher, transport::ByteView bytes,
    const std::optional<std::string>& vehicle_id) const {
  const transport::DecodedEnvelope decoded = transport::DecodeEnvelope(bytes, max_bytes_);
  if (!decoded.envelope) return decoded.reason;
  if (decoded.envelope->type != name_) {
    return "the message is of type '" + std::string(decoded.envelope->type) + "', accepted is '" +
           name_ + "'";
  }
  const std::optional<std::size_t> added = AddedSince(decoded.envelope->md5);
  if (!added) return "the sender knows another definition of '" + name_ + "' (different MD5)";
  transport::ByteView payload = decoded.envelope->payload;
  std::vector<std::uint8_t> whole;
  if (*added > 0) {
    whole.reserve(payload.size + *added);
    whole.assign(payload.data, payload.data + payload.size);
    whole.resize(payload.size + *added, 0);
    payload = {whole.data(), whole.size()};
  }
  std::optional<std::string> fault = layout_.Check(payload);
  if (fault) return fault;
  Publish(publisher, payload, vehicle_id);
  return std::nullopt;
}

std::vector<std::string> BridgedTypeNames() {
  std::vector<std::string> names;
  for (const auto& entry : BridgedTypeRegistry()) names.push_back(entry.first);
  return names;
}

std::unique_ptr<BridgedType> MakeBridgedType(const std::string& name, std::size_t max_bytes) {
  const auto found = BridgedTypeRegistry().find(name);
  if (found != BridgedTypeRegistry().end()) return found->second(max_bytes);
  std::string accepted;
  for (const std::string& known : BridgedTypeNames()) {
    accepted += (accepted.empty() ? "" : ", ") + known;
  }
  throw Error("message type '" + name + "' is not known to the bridge, accepted are: " + accepted);
}

}  // namespace livemap::ros_io
