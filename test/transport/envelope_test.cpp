#include "transport/envelope.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::transport {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kMaxBytes = 1000;
const Md5 kMd5 = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
const std::vector<std::uint8_t> kPayload = {'a', 'b', 'c'};

std::vector<std::uint8_t> Encoded() {
  return EncodeEnvelope({"pkg/Type", kMd5, {kPayload.data(), kPayload.size()}});
}

DecodedEnvelope Decode(const std::vector<std::uint8_t>& bytes) {
  return DecodeEnvelope({bytes.data(), bytes.size()}, kMaxBytes);
}

TEST(Envelope, IsTheDocumentedBytes) {
  const std::vector<std::uint8_t> expected = {'L', 'M', 'A', 'P',  // magic
                                              1,   0,              // version
                                              0,   0,              // flags
                                              8,   'p', 'k', 'g', '/', 'T', 'y', 'p', 'e',  // type
                                              0,   1,   2,   3,   4,   5,   6,   7,   8,
                                              9,   10,  11,  12,  13,  14,  15,  // md5
                                              3,   0,   0,   0,                  // length
                                              'a', 'b', 'c'};
  EXPECT_EQ(Encoded(), expected);
}

TEST(Envelope, ComesBackAsItWas) {
  const std::vector<std::uint8_t> bytes = Encoded();
  const DecodedEnvelope decoded = Decode(bytes);
  ASSERT_TRUE(decoded.envelope) << decoded.reason;
  EXPECT_EQ(decoded.envelope->type, "pkg/Type");
  EXPECT_EQ(decoded.envelope->md5, kMd5);
  const ByteView payload = decoded.envelope->payload;
  EXPECT_EQ(std::vector<std::uint8_t>(payload.data, payload.data + payload.size), kPayload);
}

TEST(Envelope, HoldsAnEmptyMessage) {
  const std::vector<std::uint8_t> bytes = EncodeEnvelope({"std_msgs/Empty", kMd5, {}});
  const DecodedEnvelope decoded = Decode(bytes);
  ASSERT_TRUE(decoded.envelope) << decoded.reason;
  EXPECT_EQ(decoded.envelope->payload.size, 0U);
}

TEST(Envelope, IsRefusedWhereverItIsCutOff) {
  const std::vector<std::uint8_t> bytes = Encoded();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    // A copy of exactly this size, so that a sanitizer sees any read behind its end.
    const std::vector<std::uint8_t> cut(bytes.begin(), bytes.begin() + static_cast<long>(size));
    const DecodedEnvelope decoded = Decode(cut);
    EXPECT_FALSE(decoded.envelope) << size;
    EXPECT_FALSE(decoded.reason.empty());
  }
}

TEST(Envelope, IsRefusedWithBytesBehindItsEnd) {
  std::vector<std::uint8_t> bytes = Encoded();
  bytes.push_back(0);
  EXPECT_THAT(Decode(bytes).reason, HasSubstr("announces 3 message bytes but holds 4"));
}

TEST(Envelope, IsRefusedForAnUnknownMagicVersionOrFlag) {
  for (const std::size_t offset : {0U, 4U, 6U}) {
    std::vector<std::uint8_t> bytes = Encoded();
    bytes[offset] = 9;
    EXPECT_FALSE(Decode(bytes).envelope) << offset;
  }
  std::vector<std::uint8_t> newer = Encoded();
  newer[4] = 2;
  EXPECT_THAT(Decode(newer).reason, HasSubstr("wire version 2 is unknown"));
}

TEST(Envelope, IsRefusedForATypeNameThatIsNone) {
  std::vector<std::uint8_t> bytes = Encoded();
  bytes[9] = '<';
  EXPECT_THAT(Decode(bytes).reason, HasSubstr("type name"));
  bytes = Encoded();
  bytes[8] = 0;
  EXPECT_FALSE(Decode(bytes).envelope);
  bytes[8] = 255;
  EXPECT_FALSE(Decode(bytes).envelope);
}

TEST(Envelope, IsRefusedOverTheSizeLimitBeforeAnythingElseIsDone) {
  std::vector<std::uint8_t> bytes = Encoded();
  // Announces 4 GiB.
  for (std::size_t i = 0; i < 4; ++i) bytes[bytes.size() - kPayload.size() - 4 + i] = 0xFF;
  EXPECT_THAT(Decode(bytes).reason, HasSubstr("4294967295 bytes, at most 1000 are accepted"));
}

TEST(Envelope, CannotBeMadeWithoutATypeName) {
  EXPECT_THROW(EncodeEnvelope({"", kMd5, {}}), Error);
  EXPECT_THROW(EncodeEnvelope({std::string(128, 'a'), kMd5, {}}), Error);
}

TEST(ParseMd5, AcceptsThirtyTwoHexadecimalDigits) {
  const auto md5 = ParseMd5("000102030405060708090a0B0c0d0e0f");
  ASSERT_TRUE(md5);
  EXPECT_EQ(*md5, kMd5);
  EXPECT_FALSE(ParseMd5("00"));
  EXPECT_FALSE(ParseMd5("*"));
  EXPECT_FALSE(ParseMd5("g00102030405060708090a0b0c0d0e0f"));
}

}  // namespace
}  // namespace livemap::transport
