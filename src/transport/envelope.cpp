#include "transport/envelope.h"

#include <cstring>
#include <limits>

#include "common/error.h"
#include "common/number_text.h"

namespace livemap::transport {
namespace {

constexpr std::array<std::uint8_t, 4> kMagic = {'L', 'M', 'A', 'P'};
// Magic, version, flags, length of the type name.
constexpr std::size_t kFixedHeadBytes = 4 + 2 + 2 + 1;
constexpr std::size_t kPayloadLengthBytes = 4;

std::uint16_t ReadEnvelopeUint16(const std::uint8_t* bytes) {
  return static_cast<std::uint16_t>(bytes[0] | (bytes[1] << 8));
}

std::uint32_t ReadEnvelopeUint32(const std::uint8_t* bytes) {
  return static_cast<std::uint32_t>(bytes[0]) | (static_cast<std::uint32_t>(bytes[1]) << 8) |
         (static_cast<std::uint32_t>(bytes[2]) << 16) |
         (static_cast<std::uint32_t>(bytes[3]) << 24);
}

template <typename Integer>
void AppendToEnvelope(std::vector<std::uint8_t>& out, Integer value) {
  for (std::size_t byte = 0; byte < sizeof(Integer); ++byte) {
    out.push_back(static_cast<std::uint8_t>((value >> (8 * byte)) & 0xFFU));
  }
}

bool IsEnvelopeTypeCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '/';
}

DecodedEnvelope RefusedEnvelope(std::string reason) { return {std::nullopt, std::move(reason)}; }

}  // namespace

std::optional<Md5> ParseMd5(std::string_view hexadecimal) {
  Md5 md5{};
  if (hexadecimal.size() != 2 * md5.size()) return std::nullopt;
  for (std::size_t i = 0; i < md5.size(); ++i) {
    const int high = HexValue(hexadecimal[2 * i]);
    const int low = HexValue(hexadecimal[2 * i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    md5[i] = static_cast<std::uint8_t>(high * 16 + low);
  }
  return md5;
}

std::vector<std::uint8_t> EncodeEnvelope(const Envelope& envelope) {
  if (envelope.type.empty() || envelope.type.size() > kMaxTypeNameBytes) {
    throw Error("message type name '" + std::string(envelope.type) + "' has " +
                std::to_string(envelope.type.size()) + " bytes, accepted are 1 to " +
                std::to_string(kMaxTypeNameBytes));
  }
  if (envelope.payload.size > std::numeric_limits<std::uint32_t>::max()) {
    throw Error("a message of " + std::to_string(envelope.payload.size) +
                " bytes does not fit an envelope, accepted are less than 2^32");
  }
  std::vector<std::uint8_t> out;
  out.reserve(kFixedHeadBytes + envelope.type.size() + envelope.md5.size() + kPayloadLengthBytes +
              envelope.payload.size);
  out.insert(out.end(), kMagic.begin(), kMagic.end());
  AppendToEnvelope(out, kEnvelopeVersion);
  AppendToEnvelope(out, std::uint16_t{0});  // flags, none defined yet
  out.push_back(static_cast<std::uint8_t>(envelope.type.size()));
  out.insert(out.end(), envelope.type.begin(), envelope.type.end());
  out.insert(out.end(), envelope.md5.begin(), envelope.md5.end());
  AppendToEnvelope(out, static_cast<std::uint32_t>(envelope.payload.size));
  if (envelope.payload.size > 0) {
    out.insert(out.end(), envelope.payload.data, envelope.payload.data + envelope.payload.size);
  }
  return out;
}

DecodedEnvelope DecodeEnvelope(ByteView bytes, std::size_t max_payload_bytes) {
  if (bytes.size < kFixedHeadBytes) return RefusedEnvelope("the envelope is cut off in its head");
  if (std::memcmp(bytes.data, kMagic.data(), kMagic.size()) != 0) {
    return RefusedEnvelope("the payload is not an envelope (wrong magic)");
  }
  const std::uint16_t version = ReadEnvelopeUint16(bytes.data + 4);
  if (version != kEnvelopeVersion) {
    return RefusedEnvelope("wire version " + std::to_string(version) + " is unknown, accepted is " +
                           std::to_string(kEnvelopeVersion));
  }
  const std::uint16_t flags = ReadEnvelopeUint16(bytes.data + 6);
  if (flags != 0)
    return RefusedEnvelope("envelope flags " + std::to_string(flags) + " are unknown");
  const std::size_t type_bytes = bytes.data[8];
  if (type_bytes == 0 || type_bytes > kMaxTypeNameBytes) {
    return RefusedEnvelope("the type name has " + std::to_string(type_bytes) + " bytes");
  }
  const std::size_t head_bytes =
      kFixedHeadBytes + type_bytes + std::tuple_size<Md5>::value + kPayloadLengthBytes;
  if (bytes.size < head_bytes) return RefusedEnvelope("the envelope is cut off in its head");

  Envelope envelope;
  envelope.type = {reinterpret_cast<const char*>(bytes.data + kFixedHeadBytes), type_bytes};
  for (const char c : envelope.type) {
    if (!IsEnvelopeTypeCharacter(c)) return RefusedEnvelope("the type name is not one");
  }
  const std::uint8_t* md5 = bytes.data + kFixedHeadBytes + type_bytes;
  std::memcpy(envelope.md5.data(), md5, envelope.md5.size());
  const std::size_t payload_bytes = ReadEnvelopeUint32(md5 + envelope.md5.size());
  if (payload_bytes > max_payload_bytes) {
    return RefusedEnvelope("the message has " + std::to_string(payload_bytes) + " bytes, at most " +
                           std::to_string(max_payload_bytes) + " are accepted");
  }
  if (payload_bytes != bytes.size - head_bytes) {
    return RefusedEnvelope("the envelope announces " + std::to_string(payload_bytes) +
                           " message bytes but holds " + std::to_string(bytes.size - head_bytes));
  }
  envelope.payload = {bytes.data + head_bytes, payload_bytes};
  return {envelope, ""};
}

}  // namespace livemap::transport
