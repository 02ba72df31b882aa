#include "imaging/image_header.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <vector>

namespace livemap::imaging {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes Encoded(const char* extension, int width, int height, const std::vector<int>& parameters = {},
              int type = CV_8UC3) {
  Bytes bytes;
  cv::imencode(extension, cv::Mat(height, width, type, cv::Scalar(10, 120, 200)), bytes,
               parameters);
  return bytes;
}

TEST(ImageHeader, ReadsWhatARealEncoderWrites) {
  struct Case {
    Bytes bytes;
    const char* format;
  };
  const std::vector<Case> cases{
      {Encoded(".jpg", 321, 123), "jpeg"},
      {Encoded(".jpg", 321, 123, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}), "jpeg"},
      {Encoded(".png", 321, 123), "png"},
      {Encoded(".webp", 321, 123, {cv::IMWRITE_WEBP_QUALITY, 80}), "webp"},
      {Encoded(".webp", 321, 123, {cv::IMWRITE_WEBP_QUALITY, 101}), "webp"}};
  for (const Case& image : cases) {
    const auto header = ReadImageHeader(image.bytes.data(), image.bytes.size());
    ASSERT_TRUE(header) << image.format;
    EXPECT_STREQ(FormatName(header->format), image.format);
    EXPECT_EQ(header->channels, 3);
    EXPECT_EQ(header->width, 321);
    EXPECT_EQ(header->height, 123);
  }
}

TEST(ImageHeader, StatesThatGreyIsOneChannel) {
  for (const char* extension : {".jpg", ".png"}) {
    const Bytes grey = Encoded(extension, 8, 9, {}, CV_8UC1);
    EXPECT_EQ(ReadImageHeader(grey.data(), grey.size())->channels, 1) << extension;
  }
}

TEST(ImageHeader, ReadsAnExtendedWebp) {
  Bytes bytes{'R', 'I', 'F', 'F', 22, 0, 0, 0, 'W', 'E',  'B',  'P', 'V',  'P', '8',
              'X', 10,  0,   0,   0,  0, 0, 0, 0,   0x3f, 0x01, 0,   0x7a, 0,   0};
  const auto header = ReadImageHeader(bytes.data(), bytes.size());
  ASSERT_TRUE(header);
  EXPECT_EQ(header->width, 320);
  EXPECT_EQ(header->height, 123);
}

TEST(ImageHeader, GivesNothingForForeignEmptyOrZeroSizedFiles) {
  EXPECT_FALSE(ReadImageHeader(nullptr, 0));
  const Bytes text{'<', 's', 'v', 'g', '>'};
  EXPECT_FALSE(ReadImageHeader(text.data(), text.size()));
  const Bytes no_width{0xff, 0xd8, 0xff, 0xc0, 0, 11, 8, 0, 100, 0, 0, 1, 1, 0x11, 0};
  EXPECT_FALSE(ReadImageHeader(no_width.data(), no_width.size()));
  const Bytes scan_first{0xff, 0xd8, 0xff, 0xda, 0, 8, 1, 1, 0, 0, 63, 0, 0, 0, 0};
  EXPECT_FALSE(ReadImageHeader(scan_first.data(), scan_first.size()));
}

TEST(ImageHeader, SurvivesEveryTruncationAndRandomDamage) {
  std::mt19937 generator(4);
  for (const char* extension : {".jpg", ".png", ".webp"}) {
    const Bytes whole = Encoded(extension, 64, 48);
    for (std::size_t size = 0; size < std::min<std::size_t>(whole.size(), 700); ++size) {
      const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
      const auto header = ReadImageHeader(cut.data(), cut.size());
      if (header) {
        EXPECT_EQ(header->width, 64);
      }
    }
    for (int round = 0; round < 2000; ++round) {
      Bytes damaged = whole;
      damaged.resize(std::min<std::size_t>(damaged.size(), 200));
      for (int i = 0; i < 4; ++i) {
        damaged[generator() % damaged.size()] = static_cast<std::uint8_t>(generator());
      }
      const auto header = ReadImageHeader(damaged.data(), damaged.size());
      if (header) {
        EXPECT_GT(header->width, 0);
      }
    }
  }
}

TEST(HasImageEnd, TellsWholeFilesFromCutOnes) {
  for (const char* extension : {".jpg", ".png", ".webp"}) {
    const Bytes whole = Encoded(extension, 64, 48);
    const auto format = ReadImageHeader(whole.data(), whole.size())->format;
    EXPECT_TRUE(HasImageEnd(whole.data(), whole.size(), format)) << extension;
    EXPECT_FALSE(HasImageEnd(whole.data(), whole.size() / 2, format)) << extension;
    EXPECT_FALSE(HasImageEnd(whole.data(), 0, format)) << extension;
  }
}

TEST(BytesBehindEnd, CountsWhatACameraAppends) {
  for (const Bytes& whole :
       {Encoded(".jpg", 64, 48), Encoded(".png", 64, 48), Encoded(".webp", 64, 48),
        Encoded(".jpg", 64, 48, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}),
        Encoded(".jpg", 64, 48, {cv::IMWRITE_JPEG_RST_INTERVAL, 2})}) {
    const auto format = ReadImageHeader(whole.data(), whole.size())->format;
    EXPECT_EQ(BytesBehindEnd(whole.data(), whole.size(), format), 0U) << FormatName(format);
    Bytes longer = whole;
    longer.resize(whole.size() + 5000, 0x55);
    EXPECT_EQ(BytesBehindEnd(longer.data(), longer.size(), format), 5000U) << FormatName(format);
    for (std::size_t size = 0; size < whole.size(); size += 7) {
      EXPECT_EQ(BytesBehindEnd(whole.data(), size, format), std::nullopt) << FormatName(format);
    }
  }
}

}  // namespace
}  // namespace livemap::imaging
