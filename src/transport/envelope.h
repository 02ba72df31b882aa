#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "transport/byte_view.h"

namespace livemap::transport {

/// The wire version that this program writes, and the only one that it reads.
inline constexpr std::uint16_t kEnvelopeVersion = 1;
/// A ROS type name such as "livemap/HazardReport", bytes.
inline constexpr std::size_t kMaxTypeNameBytes = 127;

using Md5 = std::array<std::uint8_t, 16>;

/// What travels as one MQTT payload: a serialised message and what is needed to know whether the
/// receiver understands it. docs/reference/wire.md gives the format byte by byte.
struct Envelope {
  std::string_view type;  ///< ROS type name, e.g. "livemap/HazardReport".
  Md5 md5{};              ///< MD5 of the message's definition, as ROS computes it.
  ByteView payload;       ///< The ROS serialisation of the message, little-endian.
};

/// Parses 32 hexadecimal digits (what ros::message_traits::MD5Sum gives); nullopt for anything
/// else.
std::optional<Md5> ParseMd5(std::string_view hexadecimal);

/// The bytes of `envelope`. Throws Error when the type name is empty or longer than
/// kMaxTypeNameBytes, or when the payload does not fit the format's 32-bit length.
std::vector<std::uint8_t> EncodeEnvelope(const Envelope& envelope);

/// An envelope that points into the decoded bytes, or the sentence that says why there is none.
struct DecodedEnvelope {
  std::optional<Envelope> envelope;
  std::string reason;  ///< Empty when there is an envelope.
};

/// Reads untrusted bytes. Nothing is allocated but the reason; every length is checked against
/// what is really there, and payloads over `max_payload_bytes` are refused.
DecodedEnvelope DecodeEnvelope(ByteView bytes, std::size_t max_payload_bytes);

}  // namespace livemap::transport
