#include "zone/pictures/picture_allowance.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "common/error.h"

namespace livemap::zone {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;

std::vector<std::uint8_t> Jpeg(int side, bool is_progressive = false) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", cv::Mat(side, side, CV_8UC3, cv::Scalar(90, 120, 150)), bytes,
               {cv::IMWRITE_JPEG_PROGRESSIVE, is_progressive ? 1 : 0});
  return bytes;
}

/// Keeps the picture if it may.
bool Keeps(PictureAllowance& pictures, const std::string& vehicle_id,
           const std::vector<std::uint8_t>& image, std::int64_t now_ns) {
  const auto cost = pictures.Ask(vehicle_id, image, {}, now_ns);
  if (cost) pictures.Spend(vehicle_id, *cost, now_ns);
  return cost.has_value();
}

std::uint64_t Refused(const PictureAllowance& pictures, PictureRefusal kind) {
  return pictures.refused()[static_cast<std::size_t>(kind)];
}

TEST(PictureAllowance, BoundsTheVehiclesPixelsPerHourAndNobodyElses) {
  PictureAllowance pictures({3.0 * 100 * 100, 10});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(Keeps(pictures, "car-1", Jpeg(100), 0));
  EXPECT_FALSE(Keeps(pictures, "car-1", Jpeg(100), 0));
  EXPECT_TRUE(Keeps(pictures, "car-2", Jpeg(100), 0));
  EXPECT_TRUE(Keeps(pictures, "car-1", Jpeg(100), kHourNs));
  EXPECT_EQ(Refused(pictures, PictureRefusal::kTooMany), 1U);
}

TEST(PictureAllowance, TakesNoPictureThatCostsTooMuch) {
  PictureAllowance pictures({});
  EXPECT_FALSE(Keeps(pictures, "car-1", Jpeg(4470, true), 0));
  EXPECT_TRUE(Keeps(pictures, "car-1", Jpeg(1000, true), 0));
  EXPECT_EQ(Refused(pictures, PictureRefusal::kTooCostly), 1U);
}

TEST(PictureAllowance, AskingCostsNothingAndWhatIsReservedIsLeftOut) {
  const std::vector<std::uint8_t> image = Jpeg(100);
  const auto bytes = static_cast<std::int64_t>(image.size());
  PictureAllowance pictures({3.0 * 100 * 100, 10, 3.0 * static_cast<double>(bytes)});
  for (int i = 0; i < 10; ++i) EXPECT_EQ(pictures.Ask("car-1", image, {}, 0)->px, 10'000);
  EXPECT_EQ(pictures.Ask("car-1", image, {20'000, 2 * bytes}, 0)->bytes, bytes);
  EXPECT_FALSE(pictures.Ask("car-1", image, {20'001, 0}, 0));
  EXPECT_FALSE(pictures.Ask("car-1", image, {0, 2 * bytes + 1}, 0));
}

TEST(PictureAllowance, BoundsTheVehiclesBytesPerHourHoweverFewPixelsTheyShow) {
  std::vector<std::uint8_t> padded = Jpeg(100);
  padded.resize(100'000);
  PictureAllowance pictures({2e9, 10, 250'000});
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(Keeps(pictures, "car-1", padded, 0));
  EXPECT_FALSE(Keeps(pictures, "car-1", padded, 0));
  EXPECT_TRUE(Keeps(pictures, "car-2", padded, 0));
  EXPECT_TRUE(Keeps(pictures, "car-1", padded, kHourNs));
  EXPECT_EQ(Refused(pictures, PictureRefusal::kTooMany), 1U);
}

TEST(PictureAllowance, RefusesSettingsThatTakeNothing) {
  EXPECT_THROW(PictureAllowance({0, 10}), Error);
  EXPECT_THROW(PictureAllowance({1, 0}), Error);
  EXPECT_THROW(PictureAllowance({1, 10, 0}), Error);
}

}  // namespace
}  // namespace livemap::zone
