#include "imaging/decode.h"

#include <gmock/gmock.h>

#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::imaging {
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
std::size_t StatedSizeAt(const std::vector<std::uint8_t>& jpeg) {
  for (std::size_t at = 2; at + 9 < jpeg.size(); ++at) {
    if (jpeg[at] == 0xff && jpeg[at + 1] == 0xc0) return at + 5;
  }
  return 0;
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
  SetBigEndian16(bytes, StatedSizeAt(bytes), 65000);
  SetBigEndian16(bytes, StatedSizeAt(bytes) + 2, 65000);
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

TEST(DecodeImage, ReadsAWholePictureWhateverStandsBehindIt) {
  for (const char* extension : {".jpg", ".png"}) {
    std::vector<std::uint8_t> bytes = Encode(extension, 64, 64);
    for (const std::size_t more : {64U, 65U, 100000U}) {
      bytes.resize(bytes.size() + more, 0x20);
      EXPECT_FALSE(DecodeImage(bytes.data(), bytes.size(), 1000000).empty()) << extension << more;
    }
  }
}

TEST(DecodeImage, RefusesWhatIsNoImage) {
  const std::string text = "no picture";
  EXPECT_THAT(
      [&] { DecodeImage(reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), 1000); },
      ThrowsMessage<Error>(HasSubstr("is no JPEG or PNG")));
  EXPECT_THROW(DecodeImage(nullptr, 0, 1000), Error);
}

}  // namespace
}  // namespace livemap::imaging
