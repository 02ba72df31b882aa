#include "imaging/orientation.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "imaging/decode.h"
#include "imaging/image_header.h"
#include "test/support/oriented_jpeg.h"

namespace livemap::imaging {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// 48x32: red, green and blue quarters, the fourth black.
cv::Mat Quarters() {
  cv::Mat image(32, 48, CV_8UC3, cv::Scalar(0, 0, 0));
  image(cv::Rect(0, 0, 24, 16)) = cv::Scalar(0, 0, 255);
  image(cv::Rect(24, 0, 24, 16)) = cv::Scalar(0, 255, 0);
  image(cv::Rect(0, 16, 24, 16)) = cv::Scalar(255, 0, 0);
  return image;
}

/// 'r', 'g', 'b' or 'k' of the quarters top left, top right, bottom left, bottom right.
std::string CornersOf(const cv::Mat& image) {
  std::string corners;
  for (const cv::Point2d at : {cv::Point2d(0.25, 0.25), cv::Point2d(0.75, 0.25),
                               cv::Point2d(0.25, 0.75), cv::Point2d(0.75, 0.75)}) {
    const auto pixel = image.at<cv::Vec3b>(static_cast<int>(at.y * image.rows),
                                           static_cast<int>(at.x * image.cols));
    corners += pixel[2] > 128 ? 'r' : pixel[1] > 128 ? 'g' : pixel[0] > 128 ? 'b' : 'k';
  }
  return corners;
}

class EachOrientation : public ::testing::TestWithParam<int> {};

TEST_P(EachOrientation, IsReadAndTurnedAsOpenCvDoesIt) {
  const int orientation = GetParam();
  for (const bool big_endian : {false, true}) {
    const Bytes file = test::OrientedJpeg(Quarters(), orientation, big_endian);
    EXPECT_EQ(ReadOrientation(file.data(), file.size()), orientation);
    const cv::Mat upright = DecodeImage(file.data(), file.size(), 100000);
    const cv::Mat theirs = cv::imdecode(file, cv::IMREAD_COLOR);
    EXPECT_EQ(upright.size(), theirs.size());
    EXPECT_EQ(CornersOf(upright), CornersOf(theirs));
    EXPECT_EQ(upright.cols, SwapsSides(orientation) ? 32 : 48);
  }
}

INSTANTIATE_TEST_SUITE_P(Exif, EachOrientation, ::testing::Range(1, 9));

TEST(Orientation, TurnsWhatIsKnown) {
  // Stored red green / blue black; a phone that was turned.
  EXPECT_EQ(CornersOf(Upright(Quarters(), 6)), "brkg");
  EXPECT_EQ(CornersOf(Upright(Quarters(), 3)), "kbgr");
  EXPECT_EQ(CornersOf(Upright(Quarters(), 2)), "grkb");
}

TEST(Orientation, IsLeftAloneWherePixelsAreWantedAsStored) {
  const Bytes file = test::OrientedJpeg(Quarters(), 6);
  const cv::Mat stored =
      DecodeImage(file.data(), file.size(), 100000, {DecodeConfig::Pixels::kGreyOrColour, false});
  EXPECT_EQ(stored.size(), cv::Size(48, 32));
  EXPECT_EQ(CornersOf(stored), "rgbk");
}

TEST(Orientation, IsUprightForDamagedTags) {
  const Bytes whole = test::OrientedJpeg(Quarters(), 6);
  for (const int value : {0, 9, 255}) {
    const Bytes file = test::OrientedJpeg(Quarters(), value);
    EXPECT_EQ(ReadOrientation(file.data(), file.size()), kUpright) << value;
  }
  EXPECT_EQ(ReadOrientation(nullptr, 0), kUpright);
  for (std::size_t size = 0; size < 100; ++size) ReadOrientation(whole.data(), size);
  Bytes far = whole;
  far[16] = 0xff;  // The directory begins far behind the end.
  EXPECT_EQ(ReadOrientation(far.data(), far.size()), kUpright);
}

TEST(Orientation, IsReadFromAPngsChunk) {
  Bytes png;
  cv::imencode(".png", Quarters(), png);
  const Bytes exif = {'I', 'I', 42, 0, 8, 0, 0, 0, 1, 0, 0x12, 1, 3,
                      0,   1,   0,  0, 0, 8, 0, 0, 0, 0, 0,    0, 0};
  Bytes chunk = {0, 0, 0, static_cast<std::uint8_t>(exif.size()), 'e', 'X', 'I', 'f'};
  chunk.insert(chunk.end(), exif.begin(), exif.end());
  chunk.insert(chunk.end(), {0, 0, 0, 0});
  EXPECT_EQ(ReadOrientation(png.data(), png.size()), kUpright);
  png.insert(png.begin() + 33, chunk.begin(), chunk.end());
  EXPECT_EQ(ReadOrientation(png.data(), png.size()), 8);
}

}  // namespace
}  // namespace livemap::imaging
