// Whatever comes from the broker: a topic and the bytes of an envelope, up to the structural check
// of the message in it.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "common/error.h"
#include "transport/envelope.h"
#include "transport/message_layout.h"
#include "transport/topic_template.h"

namespace livemap::fuzz {
namespace {

constexpr std::size_t kMaxPayloadBytes = 4096;

void Require(bool holds) {
  if (!holds) std::abort();
}

/// One of everything that a layout can have.
const char kEverything[] = R"(
Header header
uint8[4] id
Part[] parts
Part[2] pair
string[] names
time[] times
string name
bool flag
Empty[] nothings
uint8[] data
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: fuzz/Part
string label
float64[] numbers
================================================================================
MSG: fuzz/Empty
)";

const char kImageTypes[] = R"(
================================================================================
MSG: sensor_msgs/CompressedImage
std_msgs/Header header
string format
uint8[] data
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
)";

const transport::MessageLayout& LayoutOf(std::string_view type) {
  static const transport::MessageLayout kAll("fuzz/Everything", kEverything,
                                             {64, 8, {{"data", 256}}});
  static const transport::MessageLayout kReport(
      "livemap/HazardReport",
      ReadFile(std::string(LIVEMAP_SOURCE_DIR) + "/msg/HazardReport.msg", 1 << 20) + kImageTypes,
      {1024, 1024, {{"image.data", kMaxPayloadBytes}}});
  return type == "livemap/HazardReport" ? kReport : kAll;
}

void CheckEnvelope(transport::ByteView bytes) {
  const transport::DecodedEnvelope decoded = transport::DecodeEnvelope(bytes, kMaxPayloadBytes);
  Require(decoded.envelope.has_value() == decoded.reason.empty());
  if (!decoded.envelope) return;
  const std::vector<std::uint8_t> again = transport::EncodeEnvelope(*decoded.envelope);
  Require(again == std::vector<std::uint8_t>(bytes.data, bytes.data + bytes.size));
  LayoutOf(decoded.envelope->type).Check(decoded.envelope->payload);
}

/// The layout alone, so that the fuzzer need not find its way through the envelope first. What
/// passes must not pass any more when its last byte is missing.
void CheckLayout(transport::ByteView bytes) {
  for (const char* type : {"fuzz/Everything", "livemap/HazardReport"}) {
    if (LayoutOf(type).Check(bytes)) continue;
    Require(bytes.size > 0);
    Require(LayoutOf(type).Check({bytes.data, bytes.size - 1}).has_value());
  }
}

void CheckTopic(const std::string& topic) {
  static const transport::TopicTemplate kTemplate("livemap/v1/{zone}/vehicle/{vehicle}/report");
  const std::optional<transport::TopicNames> names = kTemplate.Match(topic);
  if (names) Require(kTemplate.Expand(*names) == topic);
}

}  // namespace
}  // namespace livemap::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  livemap::fuzz::CheckEnvelope({data, size});
  livemap::fuzz::CheckLayout({data, size});
  livemap::fuzz::CheckTopic(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
