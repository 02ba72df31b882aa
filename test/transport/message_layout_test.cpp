#include "transport/message_layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::transport {
namespace {

using ::testing::HasSubstr;

const char kDefinition[] = R"(# A comment
uint8 SMALL=1
string GREETING=hello # world
Header header
uint8[4] id
Part[] parts      # variable
float64[2] pair
string[] names
uint8[] data
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: pkg/Part
string label
int16 count
)";

/// Serialises as ROS does: little-endian, length before every string and variable array.
class Writer {
 public:
  Writer& Uint32(std::uint32_t value) {
    for (int i = 0; i < 4; ++i) bytes_.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
    return *this;
  }
  Writer& Zeros(std::size_t count) {
    bytes_.resize(bytes_.size() + count);
    return *this;
  }
  Writer& String(const std::string& text) {
    Uint32(static_cast<std::uint32_t>(text.size()));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    return *this;
  }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

/// Header and id, which every message below begins with.
Writer Head() {
  Writer writer;
  writer.Uint32(7).Zeros(8).String("map").Zeros(4);
  return writer;
}

Writer Valid() {
  Writer writer = Head();
  writer.Uint32(2).String("left").Zeros(2).String("").Zeros(2);
  writer.Zeros(16);
  writer.Uint32(2).String("a").String("bc");
  writer.Uint32(5).Zeros(5);
  return writer;
}

LayoutLimits Limits() {
  LayoutLimits limits;
  limits.max_string_bytes = 10;
  limits.max_array_elements = 3;
  limits.fields["data"] = 100;
  limits.fields["parts.label"] = 20;
  return limits;
}

std::string Fault(const std::vector<std::uint8_t>& bytes) {
  static const MessageLayout layout("pkg/Whole", kDefinition, Limits());
  return layout.Check({bytes.data(), bytes.size()}).value_or("");
}

TEST(MessageLayout, AcceptsAWholeMessage) { EXPECT_EQ(Fault(Valid().bytes()), ""); }

TEST(MessageLayout, RefusesAMessageWhereverItIsCutOff) {
  const std::vector<std::uint8_t> bytes = Valid().bytes();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const std::vector<std::uint8_t> cut(bytes.begin(), bytes.begin() + static_cast<long>(size));
    EXPECT_THAT(Fault(cut), HasSubstr("cut off")) << size;
  }
}

TEST(MessageLayout, RefusesBytesBehindTheEnd) {
  EXPECT_THAT(Fault(Valid().Zeros(3).bytes()), HasSubstr("3 bytes follow the end"));
}

TEST(MessageLayout, RefusesAnAnnouncedLengthThatIsNotThere) {
  Writer writer;
  writer.Uint32(7).Zeros(8).Uint32(9).Zeros(3);
  EXPECT_THAT(Fault(writer.bytes()), HasSubstr("cut off in field 'header.frame_id'"));
}

TEST(MessageLayout, RefusesHugeLengthsBeforeLookingFurther) {
  Writer writer;
  writer.Uint32(7).Zeros(8).Uint32(0xFFFFFFFF);
  EXPECT_THAT(Fault(writer.bytes()), HasSubstr("'header.frame_id' has 4294967295 bytes"));
  Writer parts = Head();
  parts.Uint32(0x80000000);
  EXPECT_THAT(Fault(parts.bytes()), HasSubstr("'parts' has 2147483648 elements"));
}

TEST(MessageLayout, RefusesMoreElementsThanFitTheRemainingBytes) {
  Writer writer = Head();
  writer.Uint32(3).Zeros(17);  // Three parts need at least 18 bytes.
  EXPECT_THAT(Fault(writer.bytes()), HasSubstr("cut off in field 'parts'"));
}

TEST(MessageLayout, AppliesTheGeneralLimits) {
  Writer longer = Head();
  longer.Uint32(0).Zeros(16).Uint32(1).String("eleven char");
  EXPECT_THAT(Fault(longer.bytes()), HasSubstr("'names' has 11 bytes, at most 10"));
  Writer more = Head();
  more.Uint32(0).Zeros(16).Uint32(4).String("").String("").String("").String("");
  EXPECT_THAT(Fault(more.bytes()), HasSubstr("'names' has 4 elements, at most 3"));
}

TEST(MessageLayout, AppliesTheLimitOfAField) {
  const auto with_data = [](std::uint32_t count) {
    Writer writer = Head();
    writer.Uint32(0).Zeros(16).Uint32(0).Uint32(count).Zeros(count);
    return Fault(writer.bytes());
  };
  EXPECT_EQ(with_data(100), "");
  EXPECT_THAT(with_data(101), HasSubstr("'data' has 101 elements, at most 100"));
  Writer label = Head();
  label.Uint32(1).String("seventeen letters").Zeros(2).Zeros(16).Uint32(0).Uint32(0);
  EXPECT_EQ(Fault(label.bytes()), "");
}

TEST(MessageLayout, HoldsElementsWithoutBytesToTheLimitToo) {
  const MessageLayout layout("pkg/A", "B[] b\n====\nMSG: pkg/B\n", {10, 5, {}});
  const auto fault = [&](std::uint32_t count) {
    const Writer writer = Writer().Uint32(count);
    return layout.Check({writer.bytes().data(), writer.bytes().size()});
  };
  EXPECT_FALSE(fault(5));
  EXPECT_TRUE(fault(6));
}

TEST(MessageLayout, AcceptsATypeWithoutFields) {
  const MessageLayout layout("std_msgs/Empty", "\n");
  EXPECT_FALSE(layout.Check({nullptr, 0}));
  const std::uint8_t byte = 0;
  EXPECT_TRUE(layout.Check({&byte, 1}));
}

TEST(MessageLayout, RefusesDefinitionsThatItCannotKeep) {
  EXPECT_THROW(MessageLayout("pkg/A", "Missing m"), Error);
  EXPECT_THROW(MessageLayout("pkg/A", "uint8"), Error);
  EXPECT_THROW(MessageLayout("pkg/A", "uint8[x] a"), Error);
  EXPECT_THROW(MessageLayout("pkg/A", "uint8[99999999] a"), Error);
  EXPECT_THROW(MessageLayout("pkg/A", "uint8 a b"), Error);
  EXPECT_THROW(MessageLayout("pkg/A", "B b\n====\nMSG: pkg/B\nA a"), Error);
}

TEST(MessageLayout, RefusesALimitOnAFieldThatIsNotThere) {
  EXPECT_THROW(MessageLayout("pkg/A", "uint8[] data", {10, 10, {{"dta", 5}}}), Error);
  EXPECT_THROW(MessageLayout("pkg/A", "uint8[4] data", {10, 10, {{"data", 5}}}), Error);
}

}  // namespace
}  // namespace livemap::transport
