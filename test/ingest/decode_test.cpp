#include "ingest/decode.h"

#include <gmock/gmock.h>

#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "ingest/image_header.h"

namespace livemap {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<std::uint8_t> Encode(const std::string& extension, int width, int height,
                                 int type = CV_8UC3) {
  cv::Mat image(height, width, type);
  cv::RNG generator(7);
  generator.fill(image, cv::RNG::UNIFORM, 0, 255);
  std::vector<std::uint8_t> bytes;
  cv::imencode(extension, image, bytes);
  return bytes;
}

void SetBigEndian16(std::vector<std::uint8_t>& bytes, std::size_t at, int value) {
  bytes[at] = static_cast<std::uint8_t>(value >> 8);
  bytes[at + 1] = static_cast<std::uint8_t>(value);
}

/// Where a JPEG states its height.
std::size_t FrameHeaderAt(const std::vector<std::uint8_t>& jpeg) {
  for (std::size_t at = 2; at + 9 < jpeg.size(); ++at) {
    if (jpeg[at] == 0xff && jpeg[at + 1] == 0xc0) return at + 5;
  }
  return 0;
}

TEST(FrameHeader, StatesSizeAndChannelsOfJpegAndPng) {
  for (const char* extension : {".jpg", ".png"}) {
    const std::vector<std::uint8_t> colour = Encode(extension, 123, 45);
    const auto header = ReadFrameHeader(colour.data(), colour.size());
    ASSERT_TRUE(header) << extension;
    EXPECT_EQ(header->width, 123);
    EXPECT_EQ(header->height, 45);
    EXPECT_EQ(header->channels, 3);
    const std::vector<std::uint8_t> grey = Encode(extension, 8, 9, CV_8UC1);
    EXPECT_EQ(ReadFrameHeader(grey.data(), grey.size())->channels, 1);
  }
}

TEST(FrameHeader, IsNoneForAnyStartThatEndsBeforeTheSize) {
  const std::vector<std::uint8_t> jpeg = Encode(".jpg", 64, 64);
  const std::size_t stated_at = FrameHeaderAt(jpeg);
  ASSERT_GT(stated_at, 0U);
  for (std::size_t size = 0; size < stated_at; ++size) {
    const std::vector<std::uint8_t> start(jpeg.begin(),
                                          jpeg.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_FALSE(ReadFrameHeader(start.data(), start.size())) << size;
  }
}

TEST(FrameHeader, SurvivesRandomBytesBehindAJpegStart) {
  std::mt19937 generator(3);
  for (int round = 0; round < 20000; ++round) {
    std::vector<std::uint8_t> bytes = {0xff, 0xd8};
    for (int i = 0; i < 40; ++i)
      bytes.push_back(static_cast<std::uint8_t>(generator() % 4 ? generator() : 0xff));
    const auto header = ReadFrameHeader(bytes.data(), bytes.size());
    EXPECT_TRUE(!header || header->width > 0);
  }
}

TEST(DecodeImage, KeepsGreyGreyAndColourColour) {
  const std::vector<std::uint8_t> grey = Encode(".png", 20, 10, CV_8UC1);
  const std::vector<std::uint8_t> colour = Encode(".jpg", 20, 10);
  EXPECT_EQ(DecodeImage(grey.data(), grey.size(), 1000).type(), CV_8UC1);
  const cv::Mat image = DecodeImage(colour.data(), colour.size(), 1000);
  EXPECT_EQ(image.type(), CV_8UC3);
  EXPECT_EQ(image.size(), cv::Size(20, 10));
}

TEST(DecodeImage, RefusesAHugeHeaderBeforeDecoding) {
  std::vector<std::uint8_t> bytes = Encode(".jpg", 64, 64);
  SetBigEndian16(bytes, FrameHeaderAt(bytes), 65000);
  SetBigEndian16(bytes, FrameHeaderAt(bytes) + 2, 65000);
  EXPECT_THAT([&] { DecodeImage(bytes.data(), bytes.size(), 20000000); },
              ThrowsMessage<Error>(HasSubstr("65000x65000, accepted are 20000000 pixels")));
}

TEST(DecodeImage, RefusesWhatIsCutOff) {
  for (const char* extension : {".jpg", ".png"}) {
    const std::vector<std::uint8_t> bytes = Encode(extension, 64, 64);
    EXPECT_THAT([&] { DecodeImage(bytes.data(), bytes.size() / 2, 1000000); },
                ThrowsMessage<Error>(HasSubstr("is cut off after")));
  }
}

TEST(DecodeImage, RefusesWhatIsNoImage) {
  const std::string text = "no picture";
  EXPECT_THAT(
      [&] { DecodeImage(reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), 1000); },
      ThrowsMessage<Error>(HasSubstr("neither a JPEG nor a PNG")));
  EXPECT_THROW(DecodeImage(nullptr, 0, 1000), Error);
}

}  // namespace
}  // namespace livemap
