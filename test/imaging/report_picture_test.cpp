#include "imaging/report_picture.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

namespace livemap::imaging {
namespace {

/// Noise: what JPEG compresses worst.
Picture Noise(int width, int height) {
  Picture picture{cv::Mat(height, width, CV_8UC3), nullptr};
  cv::RNG random(17);
  random.fill(picture.bgr, cv::RNG::UNIFORM, 0, 256);
  return picture;
}

/// Whether all of `inner` lies in `outer`.
bool Contains(const PixelRegion& outer, const PixelRegion& inner) {
  return inner.x >= outer.x && inner.y >= outer.y &&
         inner.x + inner.width <= outer.x + outer.width &&
         inner.y + inner.height <= outer.y + outer.height;
}

TEST(PixelRegion, TheUnionContainsBoth) {
  const PixelRegion a{10, 20, 30, 40};
  const PixelRegion b{50, 5, 10, 10};
  const PixelRegion both = Union(a, b);
  EXPECT_TRUE(Contains(both, a) && Contains(both, b));
  EXPECT_EQ(both.x + both.width, 60U);
  EXPECT_EQ(both.y + both.height, 60U);
  EXPECT_TRUE(Union(a, {}).IsWholeImage());
}

TEST(CropPicture, NothingIsShownBeyondTheWidestCrop) {
  const Picture picture{cv::Mat(400, 640, CV_8UC3, cv::Scalar(9, 9, 9)), nullptr};
  for (const std::size_t max_bytes : {12000U, 900U}) {
    CropConfig config;
    config.max_bytes = max_bytes;
    for (const Box& box : {Box{600, 380, 660, 420}, Box{100, 100, 400, 180}, Box{5, 5, 9, 9}}) {
      const CroppedPicture cropped = CropPicture(picture, box, config);
      ASSERT_FALSE(cropped.shown.IsWholeImage());
      EXPECT_TRUE(Contains(WidestCrop(box, 640, 400, config), cropped.shown));
    }
  }
  EXPECT_TRUE(WidestCrop({700, 0, 800, 9}, 640, 400, {}).IsWholeImage());
  CropConfig whole;
  whole.context = 0;
  EXPECT_TRUE(WidestCrop({10, 10, 20, 20}, 640, 400, whole).IsWholeImage());
}

TEST(EncodeJpeg, KeepsSizeWithinTheBudget) {
  const auto file = EncodeJpeg(Noise(320, 200), 90, 200000);
  EXPECT_EQ(cv::imdecode(file, cv::IMREAD_COLOR).size(), cv::Size(320, 200));
}

TEST(EncodeJpeg, MeetsTheBudgetByLowerQualityAndThenBySize) {
  for (const std::size_t budget : {60000u, 20000u, 8000u}) {
    const auto file = EncodeJpeg(Noise(320, 200), 90, budget);
    ASSERT_FALSE(file.empty());
    EXPECT_LE(file.size(), budget);
    EXPECT_FALSE(cv::imdecode(file, cv::IMREAD_COLOR).empty());
  }
}

TEST(EncodeJpeg, ImpossibleBudgetGivesNoPicture) {
  EXPECT_TRUE(EncodeJpeg(Noise(320, 200), 90, 100).empty());
  EXPECT_TRUE(EncodeJpeg(Noise(320, 200), 90, 0).empty());
}

TEST(EncodeJpeg, WhatIsNoColourImageGivesNoPicture) {
  EXPECT_TRUE(EncodeJpeg(Picture{}, 90, 100000).empty());
  EXPECT_TRUE(EncodeJpeg({cv::Mat(10, 10, CV_16UC1, cv::Scalar(1)), nullptr}, 90, 100000).empty());
}

/// A road with some texture and a pothole at 300..360, 250..280.
Picture Road() {
  Picture picture{cv::Mat(400, 640, CV_8UC3, cv::Scalar(110, 112, 115)), nullptr};
  cv::Mat grain(picture.bgr.size(), CV_8UC3);
  cv::RNG random(3);
  random.fill(grain, cv::RNG::NORMAL, 0, 12);
  picture.bgr += grain;
  cv::ellipse(picture.bgr, {330, 265}, {30, 15}, 0, 0, 360, {40, 42, 45}, cv::FILLED);
  return picture;
}
const Box kPothole{300, 250, 360, 280};

/// First entry of the first quantisation table (ITU-T T.81): 16 at quality 50, more below it.
int CoarsestLuminance(const std::vector<std::uint8_t>& jpeg) {
  for (std::size_t i = 0; i + 6 < jpeg.size(); ++i) {
    if (jpeg[i] == 0xff && jpeg[i + 1] == 0xdb) return jpeg[i + 5];
  }
  return 255;
}

/// Why the picture of a box is not what CropPicture promises; empty: it is.
std::string WhyNotLegible(const CroppedPicture& cropped, const Picture& picture, const Box& box,
                          std::size_t max_bytes) {
  if (cropped.jpeg.empty()) return "there is none";
  if (cropped.jpeg.size() > max_bytes) return std::to_string(cropped.jpeg.size()) + " bytes";
  const PixelRegion& shown = cropped.shown;
  const bool inside = shown.x + shown.width <= static_cast<std::uint32_t>(picture.bgr.cols) &&
                      shown.y + shown.height <= static_cast<std::uint32_t>(picture.bgr.rows);
  if (!inside) return "the region is not within the image";
  const auto edge = [](float at) { return static_cast<std::uint32_t>(std::max(0.0F, at)); };
  const std::uint32_t right = std::min<std::uint32_t>(edge(box.x_max), shown.x + shown.width);
  if (edge(box.x_min) < shown.x || edge(box.y_min) < shown.y || right < edge(box.x_max) - 1) {
    return "the box is not within the region";
  }
  const cv::Size decoded = cv::imdecode(cropped.jpeg, cv::IMREAD_COLOR).size();
  const double scale = 1.0 * decoded.width / shown.width;
  if (std::abs(scale - 1.0 * decoded.height / shown.height) > 0.02) return "it is distorted";
  const double side = std::min(box.x_max - box.x_min, box.y_max - box.y_min);
  if (side * scale < std::min(side, 1.0 * kLegibleSidePx) - 0.5) {
    return "the box has " + std::to_string(side * scale) + " pixels";
  }
  const bool wide = decoded.width >= kMinCropPx;
  if (CoarsestLuminance(cropped.jpeg) > (wide ? 32 : 20)) {
    return std::string("its quality is below ") + (wide ? "25" : "40");
  }
  return "";
}

TEST(CropPicture, ShowsTheBoxAndItsSurroundingsInTheirOwnPixels) {
  const CroppedPicture cropped = CropPicture(Road(), kPothole, {});
  EXPECT_TRUE(cropped.legible);
  // 480 pixels wide at least, 3 to 2, the box in the middle as far as the image goes.
  EXPECT_EQ(cropped.shown.width, 480u);
  EXPECT_EQ(cropped.shown.height, 320u);
  EXPECT_NEAR(cropped.shown.x + 240.0, 330, 1);
  EXPECT_EQ(cropped.shown.y, 80u);
  const cv::Mat seen = cv::imdecode(cropped.jpeg, cv::IMREAD_COLOR);
  ASSERT_EQ(seen.size(), cv::Size(480, 320));
  EXPECT_LE(cropped.jpeg.size(), CropConfig().max_bytes);
  const cv::Rect part(static_cast<int>(cropped.shown.x), static_cast<int>(cropped.shown.y), 480,
                      320);
  EXPECT_GT(cv::PSNR(seen, Road().bgr(part)), 25) << "the same pixels";
}

TEST(CropPicture, AnImageThatIsSmallerIsShownAsWideAsItIs) {
  const Picture small{cv::Mat(200, 320, CV_8UC3, cv::Scalar(110, 112, 115)), nullptr};
  const CroppedPicture cropped = CropPicture(small, {100, 100, 140, 130}, {});
  EXPECT_EQ(cropped.shown.width, 320u);
  EXPECT_EQ(cropped.shown.height, 200u);
  EXPECT_EQ(cropped.scale, 1);
}

TEST(CropPicture, TheMarksAreDrawnIntoThePictureAloneAtItsOwnSize) {
  const Picture road = Road();
  const cv::Mat before = road.bgr.clone();
  const PictureMarks marks{kPothole, "pothole 0.83", {}};
  for (const std::size_t max_bytes : {12000u, 5000u}) {
    const CroppedPicture plain = CropPicture(road, kPothole, {max_bytes, 80, 3.0});
    const CroppedPicture marked = CropPicture(road, kPothole, {max_bytes, 80, 3.0}, &marks);
    EXPECT_LE(marked.jpeg.size(), max_bytes);
    const cv::Mat seen = cv::imdecode(marked.jpeg, cv::IMREAD_COLOR);
    const auto pixel = [&marked](double at, std::uint32_t begin) {
      return cvRound((at - begin) * marked.scale);
    };
    const cv::Point left(pixel(kPothole.x_min, marked.shown.x), pixel(265, marked.shown.y));
    const cv::Vec3b line = seen.at<cv::Vec3b>(left);
    EXPECT_GT(line[2], line[0] + 50) << "the left edge is red in " << max_bytes << " bytes";
    EXPECT_NE(marked.jpeg, plain.jpeg);
  }
  EXPECT_EQ(cv::norm(before, road.bgr, cv::NORM_INF), 0) << "others look at the image";
}

TEST(CropPicture, KeepsTheBoxLegibleWithinTheBytesWhereverItLies) {
  const Picture road = Road();
  for (const Box& box : {kPothole, Box{0, 380, 20, 400}, Box{600, 0, 640, 60}, Box{5, 200, 12, 205},
                         Box{100, 100, 500, 380}, Box{-1, -1, 641, 401}, Box{310, 10, 330, 390}}) {
    const CroppedPicture cropped = CropPicture(road, box, {});
    EXPECT_TRUE(cropped.legible);
    EXPECT_EQ(WhyNotLegible(cropped, road, box, 12000), "") << box.x_min << " " << box.y_min;
  }
}

TEST(CropPicture, GivesUpPixelsAndSurroundingsBeforeTheBoxIsLost) {
  const Picture noise = Noise(640, 400);
  const CroppedPicture wide = CropPicture(noise, kPothole, {});
  EXPECT_EQ(WhyNotLegible(wide, noise, kPothole, 12000), "");
  const CroppedPicture tight = CropPicture(noise, {100, 100, 400, 300}, {7000, 80, 3.0});
  EXPECT_EQ(WhyNotLegible(tight, noise, {100, 100, 400, 300}, 7000), "");
  EXPECT_LT(tight.scale, 1);
}

TEST(CropPicture, IsRatherCoarserThanNarrowerThan480Pixels) {
  const Picture road = Road();
  const CroppedPicture best = CropPicture(road, kPothole, {1'000'000, 80, 3.0});
  const cv::Mat part = road.bgr(
      cv::Rect(static_cast<int>(best.shown.x), static_cast<int>(best.shown.y), kMinCropPx, 320));
  const auto bytes_at = [&part](int quality) {
    std::vector<std::uint8_t> file;
    cv::imencode(".jpg", part, file,
                 {cv::IMWRITE_JPEG_QUALITY, quality, cv::IMWRITE_JPEG_OPTIMIZE, 1});
    return file.size();
  };
  const std::size_t budget = bytes_at(kWideQuality);
  ASSERT_LT(budget, bytes_at(kLegibleQuality));
  const CroppedPicture coarse = CropPicture(road, kPothole, {budget, 80, 3.0});
  EXPECT_EQ(coarse.scale, 1);
  EXPECT_EQ(coarse.quality, kWideQuality);
  EXPECT_EQ(WhyNotLegible(coarse, road, kPothole, budget), "");
  const CroppedPicture narrow = CropPicture(road, kPothole, {budget - 1, 80, 3.0});
  EXPECT_LT(cv::imdecode(narrow.jpeg, cv::IMREAD_COLOR).cols, kMinCropPx);
  EXPECT_GE(narrow.quality, kLegibleQuality);
}

TEST(CropPicture, ABudgetThatLeavesNothingToSeeIsSaidAndKept) {
  const CroppedPicture cropped = CropPicture(Noise(640, 400), kPothole, {2500, 80, 3.0});
  EXPECT_FALSE(cropped.legible);
  EXPECT_LE(cropped.jpeg.size(), 2500u);
  const CroppedPicture none = CropPicture(Noise(640, 400), kPothole, {100, 80, 3.0});
  EXPECT_FALSE(none.legible);
  EXPECT_TRUE(none.jpeg.empty());
  EXPECT_TRUE(none.shown.IsWholeImage());
}

TEST(CropPicture, ShowsTheWholeImageWithoutContextOrWithoutAPlaceInIt) {
  const float nan = std::nanf("");
  for (const Box& box : {Box{700, 10, 720, 30}, Box{nan, 0, 10, 10}, Box{}}) {
    const CroppedPicture cropped = CropPicture(Road(), box, {});
    EXPECT_EQ(cropped.shown.width, 640u);
    EXPECT_EQ(cropped.shown.height, 400u);
    EXPECT_LE(cropped.jpeg.size(), 12000u);
  }
  EXPECT_EQ(CropPicture(Road(), kPothole, {100000, 80, 0}).shown.width, 640u);
  EXPECT_TRUE(CropPicture(Picture{}, kPothole, {}).jpeg.empty());
}

/// "class x y width height", shares of the image.
std::vector<Box> ReadBoxes(const std::filesystem::path& labels, const cv::Size& image) {
  std::vector<Box> boxes;
  std::ifstream file(labels);
  float kind = 0, x = 0, y = 0, width = 0, height = 0;
  while (file >> kind >> x >> y >> width >> height) {
    const auto columns = static_cast<float>(image.width);
    const auto rows = static_cast<float>(image.height);
    boxes.push_back({(x - width / 2) * columns, (y - height / 2) * rows, (x + width / 2) * columns,
                     (y + height / 2) * rows});
  }
  return boxes;
}

TEST(CropPicture, EveryPotholeOfARealRoadIsLegibleInTwelveKilobytes) {
  const char* set = std::getenv("LIVEMAP_DATA_DIR");
  const std::filesystem::path data =
      set != nullptr ? set : std::string(LIVEMAP_SOURCE_DIR) + "/../shared/data";
  const auto section = data / "road_survey" / "386RS169832";
  if (!std::filesystem::is_directory(section)) GTEST_SKIP() << "skipped, no data";
  std::size_t pictures = 0, bytes = 0, reduced = 0, narrow = 0;
  for (const auto& entry : std::filesystem::directory_iterator(section / "labels")) {
    std::filesystem::path photo = section / "images" / entry.path().filename();
    photo.replace_extension(".jpg");
    const Picture picture{cv::imread(photo.string()), nullptr};
    ASSERT_FALSE(picture.bgr.empty()) << photo;
    for (const Box& box : ReadBoxes(entry.path(), picture.bgr.size())) {
      const CroppedPicture cropped = CropPicture(picture, box, {});
      EXPECT_TRUE(cropped.legible) << photo;
      EXPECT_EQ(WhyNotLegible(cropped, picture, box, 12000), "") << photo;
      ++pictures;
      bytes += cropped.jpeg.size();
      if (cropped.scale < 1 || cropped.quality < 60) ++reduced;
      if (cropped.shown.width * cropped.scale < kMinCropPx - 0.5) ++narrow;
    }
  }
  ASSERT_GT(pictures, 20u);
  EXPECT_LE(narrow, pictures / 20) << "a person judges by 480 pixels";
  std::cout << pictures << " potholes, mean " << bytes / pictures << " bytes, " << reduced
            << " of them below quality 60 or reduced, " << narrow << " narrower than " << kMinCropPx
            << " pixels\n";
}

}  // namespace
}  // namespace livemap::imaging
