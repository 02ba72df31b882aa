#include "zone/pictures/picture_recoder.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "imaging/image_header.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using Bytes = std::vector<std::uint8_t>;

/// Grey ground with a bright blot, smooth as a camera's picture.
cv::Mat Scene(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) image.row(y).setTo(cv::Scalar(90, 100 + 60 * y / height, 110));
  cv::circle(image, {width / 4, height / 2}, std::max(1, height / 10), cv::Scalar(230, 240, 240),
             -1);
  return image;
}

Bytes Encode(const std::string& extension, const cv::Mat& image,
             const std::vector<int>& options = {}) {
  Bytes bytes;
  cv::imencode(extension, image, bytes, options);
  return bytes;
}

cv::Mat Decode(const Bytes& bytes) { return cv::imdecode(bytes, cv::IMREAD_UNCHANGED); }

/// Inserts a segment behind the start marker of a JPEG.
Bytes WithSegment(Bytes jpeg, std::uint8_t marker, const std::string& content) {
  const std::size_t length = content.size() + 2;
  Bytes segment{0xff, marker, static_cast<std::uint8_t>(length >> 8),
                static_cast<std::uint8_t>(length & 0xff)};
  segment.insert(segment.end(), content.begin(), content.end());
  jpeg.insert(jpeg.begin() + 2, segment.begin(), segment.end());
  return jpeg;
}

bool Holds(const Bytes& bytes, const std::string& text) {
  return std::search(bytes.begin(), bytes.end(), text.begin(), text.end()) != bytes.end();
}

/// Where a JPEG states its height, then its width, two bytes each.
std::size_t StatedSizeAt(const Bytes& jpeg) {
  for (std::size_t at = 2; at + 9 < jpeg.size(); ++at) {
    if (jpeg[at] == 0xff && (jpeg[at + 1] == 0xc0 || jpeg[at + 1] == 0xc2)) return at + 5;
  }
  return 0;
}

void StateSize(Bytes& jpeg, int width, int height) {
  const std::size_t at = StatedSizeAt(jpeg);
  jpeg[at] = static_cast<std::uint8_t>(height >> 8);
  jpeg[at + 1] = static_cast<std::uint8_t>(height & 0xff);
  jpeg[at + 2] = static_cast<std::uint8_t>(width >> 8);
  jpeg[at + 3] = static_cast<std::uint8_t>(width & 0xff);
}

TEST(RecodePicture, MakesAJpegOfTheSamePixelsOfEveryFormat) {
  const cv::Mat scene = Scene(320, 200);
  for (const char* extension : {".jpg", ".png"}) {
    const cv::Mat seen = Decode(RecodePicture(Encode(extension, scene)));
    ASSERT_EQ(seen.size(), scene.size()) << extension;
    EXPECT_LT(cv::norm(seen, scene, cv::NORM_L1) / static_cast<double>(scene.total() * 3), 3.0)
        << extension;
  }
}

TEST(RecodePicture, MakesColourOfGreyAlphaAndDeepPictures) {
  cv::Mat grey, alpha, deep;
  cv::cvtColor(Scene(64, 48), grey, cv::COLOR_BGR2GRAY);
  cv::cvtColor(Scene(64, 48), alpha, cv::COLOR_BGR2BGRA);
  Scene(64, 48).convertTo(deep, CV_16U, 257);
  const double red = cv::mean(Scene(64, 48))[2];
  for (const auto& [image, mean] :
       {std::pair{grey, cv::mean(grey)[0]}, {alpha, red}, {deep, red}}) {
    const cv::Mat seen = Decode(RecodePicture(Encode(".png", image)));
    EXPECT_EQ(seen.type(), CV_8UC3);
    EXPECT_NEAR(cv::mean(seen)[2], mean, 2.0);
  }
}

TEST(RecodePicture, ShrinksToTheLongestSideAndNeverEnlarges) {
  PictureLimits limits;
  limits.longest_side_px = 100;
  EXPECT_EQ(Decode(RecodePicture(Encode(".jpg", Scene(640, 320)), limits)).size(),
            cv::Size(100, 50));
  EXPECT_EQ(Decode(RecodePicture(Encode(".png", Scene(300, 900)), limits)).size(),
            cv::Size(33, 100));
  EXPECT_EQ(Decode(RecodePicture(Encode(".jpg", Scene(40, 30)), limits)).size(), cv::Size(40, 30));
  EXPECT_EQ(Decode(RecodePicture(Encode(".png", Scene(2000, 1)), limits)).size(), cv::Size(100, 1));
}

TEST(RecodePicture, LeavesNothingOfTheFileButItsPixels) {
  const std::string markup = "<script>alert(1)</script>";
  Bytes file = Encode(".jpg", Scene(64, 48));
  file = WithSegment(file, 0xfe, markup);  // A comment.
  file = WithSegment(file, 0xe2, std::string("ICC_PROFILE\0\1\1", 14) + markup);
  file = WithSegment(file, 0xe1, "http://ns.adobe.com/xap/1.0/ GPSLatitude");
  file.insert(file.end(), markup.begin(), markup.end());  // Behind the end.
  ASSERT_TRUE(Holds(file, markup));
  const Bytes recoded = RecodePicture(file);
  EXPECT_EQ(Decode(recoded).size(), cv::Size(64, 48));
  EXPECT_FALSE(Holds(recoded, "script"));
  EXPECT_FALSE(Holds(recoded, "GPS"));
  EXPECT_FALSE(Holds(recoded, "ICC_PROFILE"));
}

TEST(RecodePicture, APolyglotOfPngAndArchiveComesOutAsAPicture) {
  Bytes file = Encode(".png", Scene(64, 48));
  for (const char c : std::string("PK\x03\x04 payload.js")) {
    file.push_back(static_cast<std::uint8_t>(c));
  }
  EXPECT_FALSE(Holds(RecodePicture(file), "payload.js"));
}

TEST(RecodePicture, IgnoresAndDropsTheOrientationTag) {
  // Exif with a little-endian IFD of one entry: orientation 6, a quarter turn.
  const std::string exif("Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0",
                         32);
  const Bytes file = WithSegment(Encode(".jpg", Scene(64, 48)), 0xe1, exif);
  ASSERT_EQ(cv::imdecode(file, cv::IMREAD_COLOR).size(), cv::Size(48, 64)) << "no valid tag";
  const Bytes recoded = RecodePicture(file);
  EXPECT_EQ(cv::imdecode(recoded, cv::IMREAD_COLOR).size(), cv::Size(64, 48));
  EXPECT_FALSE(Holds(recoded, "Exif"));
}

TEST(RecodePicture, RefusesHugeDimensionsBeforeDecoding) {
  Bytes jpeg = Encode(".jpg", Scene(64, 48));
  StateSize(jpeg, 65000, 65000);
  EXPECT_THAT([&] { RecodePicture(jpeg); },
              ThrowsMessage<Error>(HasSubstr("says it has 65000 x 65000 pixels")));
  Bytes png = Encode(".png", Scene(64, 48));
  png[16] = 0x7f;  // Two thousand million pixels wide.
  EXPECT_THAT([&] { RecodePicture(png); },
              ThrowsMessage<Error>(HasSubstr("accepted are 20000000")));
}

TEST(DecodingWork, OfAPngWhoseHeaderSaysMoreThanAnInt64HoldsIsTheMost) {
  // Width, height, depth, colour type and interlacing are 0x6b6b6b6b or 0x6b each.
  Bytes png{0x89, 'P', 'N', 'G', 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 0x0d, 'I', 'H', 'D', 'R'};
  png.resize(png.size() + 100, 0x6b);
  EXPECT_EQ(DecodingWork(png), std::numeric_limits<std::int64_t>::max());
  EXPECT_THAT([&] { RecodePicture(png); },
              ThrowsMessage<Error>(HasSubstr("says it has 1802201963 x 1802201963 pixels")));
}

TEST(RecodePicture, RefusesTooManyBytes) {
  PictureLimits limits;
  limits.max_bytes = 100;
  EXPECT_THAT([&] { RecodePicture(Encode(".jpg", Scene(64, 48)), limits); },
              ThrowsMessage<Error>(HasSubstr("bytes, accepted are 100")));
}

TEST(RecodePicture, RefusesWhatIsCutOffAnywhere) {
  for (const char* extension : {".jpg", ".png"}) {
    const Bytes whole = Encode(extension, Scene(96, 64));
    for (std::size_t size = 0; size + 1 < whole.size(); size += 7) {
      const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_THROW(RecodePicture(cut), Error) << extension << " of " << size << " bytes";
    }
  }
}

TEST(RecodePicture, ACutFileWithAnEndMarkerOnItStaysCut) {
  const Bytes whole = Encode(".jpg", Scene(96, 64));
  // Inside the header's tables: the marker is a table's content.
  Bytes cut(whole.begin(), whole.begin() + 60);
  cut.insert(cut.end(), {0xff, 0xd9});
  EXPECT_THROW(RecodePicture(cut), Error);
}

/// Rows that are missing must be of one colour, whatever lay in memory.
TEST(RecodePicture, MissingPixelsNeverShowMemory) {
  const Bytes whole = Encode(".jpg", Scene(400, 400));
  Bytes half(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() * 6 / 10));
  half.insert(half.end(), {0xff, 0xd9});
  {
    const cv::Mat secret(400, 400, CV_8UC3, cv::Scalar(1, 254, 1));
    ASSERT_FALSE(secret.empty());
  }
  const cv::Mat seen = Decode(RecodePicture(half));
  const cv::Mat last = seen.row(seen.rows - 1);
  double least = 0, most = 0;
  cv::minMaxLoc(last.reshape(1), &least, &most);
  EXPECT_LT(most - least, 40) << "the rest of a cut picture is not plain";
  EXPECT_LT(most, 250);
}

TEST(RecodePicture, LyingHeadersAreRefusedOrGiveTheSizeTheyState) {
  for (const auto& [width, height] : {std::pair{64, 4000}, {4000, 48}, {63, 48}, {1, 1}}) {
    Bytes jpeg = Encode(".jpg", Scene(64, 48));
    StateSize(jpeg, width, height);
    try {
      const cv::Mat seen = Decode(RecodePicture(jpeg));
      EXPECT_LE(std::max(seen.cols, seen.rows), PictureLimits().longest_side_px);
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("the picture"));
    }
  }
}

TEST(RecodePicture, RefusesADamagedPng) {
  Bytes png = Encode(".png", Scene(64, 48));
  png[png.size() / 2] ^= 0x55U;
  EXPECT_THROW(RecodePicture(png), Error);
}

TEST(RecodePicture, RefusesWhatIsNoPicture) {
  for (const std::string text :
       {"", "GIF89a\1\0\1\0", "BM................", "<svg xmlns='http://www.w3.org/2000/svg'/>",
        "RIFF\xff\xff\xff\x7fWEBPVP8 ", "\xff\xd8\xff\xd9"}) {
    EXPECT_THROW(RecodePicture(Bytes(text.begin(), text.end())), Error) << text;
  }
}

/// OpenCV asks one decoder after the other whether it knows the bytes, GDAL's and GDCM's too, which
/// look for their marks in the middle of a file. JPEG's and PNG's marks at the start keep them out;
/// a WebP that libwebp does not accept does not.
TEST(RecodePicture, RefusesWebpSoThatNoOtherDecoderIsAsked) {
  EXPECT_THAT([] { RecodePicture(Encode(".webp", Scene(64, 48))); },
              ThrowsMessage<Error>(HasSubstr("is no JPEG or PNG")));
}

TEST(RecodePicture, RefusesAProgressivePictureOfThousandsOfScans) {
  Bytes jpeg = Encode(".jpg", Scene(64, 48), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  EXPECT_NO_THROW(RecodePicture(jpeg));
  const std::uint8_t start[] = {0xff, 0xda};
  const auto scan = std::find_end(jpeg.begin(), jpeg.end(), start, start + 2);
  const Bytes last(scan, jpeg.end() - 2);
  for (int i = 0; i < 1000; ++i) jpeg.insert(jpeg.end() - 2, last.begin(), last.end());
  EXPECT_THAT([&] { RecodePicture(jpeg); },
              ThrowsMessage<Error>(HasSubstr("has more than 32 scans")));
}

TEST(RecodePicture, RefusesAPictureThatCostsMoreThanItsPixelsSay) {
  PictureLimits limits;
  limits.max_work_px = 64 * 48 * 4;
  EXPECT_NO_THROW(RecodePicture(Encode(".jpg", Scene(64, 48)), limits));
  EXPECT_THAT(
      [&] {
        RecodePicture(Encode(".jpg", Scene(64, 48), {cv::IMWRITE_JPEG_PROGRESSIVE, 1}), limits);
      },
      ThrowsMessage<Error>(HasSubstr("accepted are 12288")));
}

TEST(RecodePicture, RefusesAnArithmeticJpeg) {
  Bytes jpeg = Encode(".jpg", Scene(64, 48));
  jpeg[StatedSizeAt(jpeg) - 4] = 0xc9;
  EXPECT_THAT([&] { RecodePicture(jpeg); }, ThrowsMessage<Error>(HasSubstr("as no camera does")));
}

TEST(DecodingWork, IsThePixelsOfAPlainJpegAndMoreForEachScan) {
  EXPECT_EQ(DecodingWork(Encode(".jpg", Scene(64, 48))), 64 * 48);
  const Bytes progressive = Encode(".jpg", Scene(64, 48), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  EXPECT_GE(DecodingWork(progressive), 6 * 64 * 48);
}

TEST(DecodingWork, CountsABombOfScansInBigPicturesAboveTheLimit) {
  const Bytes bomb = Encode(".jpg", Scene(4470, 4470), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  EXPECT_LT(bomb.size(), 1U << 20);
  EXPECT_GT(DecodingWork(bomb), PictureLimits().max_work_px);
  EXPECT_LE(DecodingWork(Encode(".jpg", Scene(1920, 1080), {cv::IMWRITE_JPEG_PROGRESSIVE, 1})),
            PictureLimits().max_work_px);
}

TEST(DecodingWork, APngCostsByItsBytesPerPixelAndItsInterlacing) {
  EXPECT_EQ(DecodingWork(Encode(".png", Scene(64, 48))), 64 * 48);
  Bytes deep = Encode(".png", cv::Mat::zeros(48, 64, CV_16UC4));
  EXPECT_EQ(DecodingWork(deep), 64 * 48 * 3);
  deep[28] = 1;  // Adam7.
  EXPECT_EQ(DecodingWork(deep), 64 * 48 * 6);
}

TEST(DecodingWork, IsNothingForWhatIsNoPicture) {
  EXPECT_EQ(DecodingWork({}), 0);
  EXPECT_EQ(DecodingWork({0xff, 0xd8, 0xff}), 0);
}

TEST(RecodePicture, TheHeaderDecidesNotTheNameOfTheFormat) {
  // Reports carry a format's name that nobody reads: a PNG under the name of a JPEG is a PNG.
  protocol::Report report = MakeReport();
  report.image_format = "jpeg";
  report.image = Encode(".png", Scene(64, 48));
  EXPECT_EQ(imaging::ReadImageHeader(RecodePicture(report.image).data(), 3000)->format,
            imaging::ImageHeader::Format::kJpeg);
}

class SmallPictureTest : public testing::Test {
 protected:
  /// Red pixels: the frame that is drawn around the box.
  static cv::Rect FrameOf(const cv::Mat& picture) {
    std::vector<cv::Point> red;
    for (int y = 0; y < picture.rows; ++y) {
      for (int x = 0; x < picture.cols; ++x) {
        const auto& pixel = picture.at<cv::Vec3b>(y, x);
        if (pixel[2] > pixel[1] + 60 && pixel[2] > pixel[0] + 60) red.emplace_back(x, y);
      }
    }
    return cv::boundingRect(red);
  }
};

TEST_F(SmallPictureTest, KeepsToTheBudgetWithTheBoxInView) {
  cv::Mat noise(720, 1280, CV_8UC3);
  cv::RNG(5).fill(noise, cv::RNG::UNIFORM, 0, 120);
  const imaging::Box box{600, 400, 700, 460};
  for (const cv::Mat& image : {noise, Scene(1280, 720)}) {
    for (const std::size_t budget : {1500U, 4096U, 12000U}) {
      SmallPictureLimits limits;
      limits.max_bytes = budget;
      const Bytes file = SmallPicture(Encode(".jpg", image), box, {0, 0, 1280, 720}, limits);
      ASSERT_FALSE(file.empty()) << budget;
      EXPECT_LE(file.size(), budget);
      EXPECT_EQ(file[0], 0xff);
    }
  }
}

TEST_F(SmallPictureTest, TheBoxIsDrawnWhereTheHazardIs) {
  const imaging::Box box{600, 400, 700, 460};
  const cv::Mat seen =
      Decode(SmallPicture(Encode(".jpg", Scene(1280, 720)), box, {0, 0, 1280, 720}));
  ASSERT_EQ(seen.size(), cv::Size(192, 128));
  const cv::Rect frame = FrameOf(seen);
  // The view is 250 pixels wide, the box 100 of them and in its middle.
  EXPECT_NEAR(frame.width, 77, 6);
  EXPECT_NEAR(frame.height, 46, 6);
  EXPECT_NEAR(frame.x + frame.width / 2.0, 96, 4);
  EXPECT_NEAR(frame.y + frame.height / 2.0, 64, 4);
}

TEST_F(SmallPictureTest, TheBoxIsOfTheOriginalAlsoWhereThePictureIsASmallerCopy) {
  const imaging::Box box{1800, 1200, 2100, 1380};
  const cv::Mat seen =
      Decode(SmallPicture(Encode(".png", Scene(1280, 720)), box, {0, 0, 3840, 2160}));
  const cv::Rect frame = FrameOf(seen);
  EXPECT_NEAR(frame.width, 77, 6);
  EXPECT_NEAR(frame.x + frame.width / 2.0, 96, 4);
}

TEST_F(SmallPictureTest, TheBoxIsOfTheOriginalAlsoWhereThePictureShowsAPartOfIt) {
  // 640 x 360 pixels of the original by as many, and by half of them.
  const cv::Rect part(500, 250, 640, 360);
  const imaging::Box box{600, 400, 700, 460};
  for (const int divisor : {1, 2}) {
    cv::Mat picture;
    cv::resize(Scene(1280, 720)(part), picture, part.size() / divisor, 0, 0, cv::INTER_AREA);
    const imaging::PixelRegion shown{500, 250, 640, 360};
    const cv::Mat seen = Decode(SmallPicture(Encode(".png", picture), box, shown));
    // In the part the box lies at 100..200, and the view 25..275: in the middle. Taken for a box of
    // the whole image it would stand at the right edge.
    const cv::Rect frame = FrameOf(seen);
    EXPECT_NEAR(1.0 * frame.width / frame.height, 100.0 / 60, 0.25) << divisor;
    EXPECT_NEAR(frame.x + frame.width / 2.0, seen.cols * 0.5, 6) << divisor;
  }
  EXPECT_THROW(SmallPicture(Encode(".png", Scene(64, 36)), {10, 10, 40, 40}, {500, 250, 640, 360}),
               Error);
}

TEST_F(SmallPictureTest, ABoxInTheCornerOrAsLargeAsTheImageIsStillSeen) {
  const Bytes file = Encode(".jpg", Scene(640, 480));
  for (const imaging::Box& box : {imaging::Box{0, 0, 30, 20}, imaging::Box{610, 460, 641, 481},
                                  imaging::Box{-1, -1, 641, 481}, imaging::Box{5, 5, 6, 6},
                                  imaging::Box{300, 0, 340, 480}, imaging::Box{0, 200, 640, 260}}) {
    const Bytes small = SmallPicture(file, box, {0, 0, 640, 480});
    ASSERT_FALSE(small.empty());
    const cv::Mat seen = Decode(small);
    EXPECT_LE(seen.cols, 192);
    EXPECT_LE(seen.rows, 128);
    EXPECT_GT(FrameOf(seen).area(), 0) << box.x_min << " " << box.y_min;
  }
}

TEST_F(SmallPictureTest, RefusesBoxesOutsideAndWhatNoPictureIs) {
  const Bytes file = Encode(".jpg", Scene(64, 48));
  const float nan = std::nanf("");
  for (const imaging::Box& box :
       {imaging::Box{70, 10, 90, 20}, imaging::Box{10, 10, 10, 20}, imaging::Box{nan, 0, 10, 10},
        imaging::Box{0, 0, nan, 10}, imaging::Box{-9, -9, -1, -1}}) {
    EXPECT_THROW(SmallPicture(file, box, {0, 0, 64, 48}), Error);
  }
  EXPECT_THROW(SmallPicture({1, 2, 3}, {0, 0, 5, 5}, {0, 0, 64, 48}), Error);
  EXPECT_THROW(SmallPicture(file, {0, 0, 5, 5}, {0, 0, 0, 0}), Error);
}

TEST_F(SmallPictureTest, IsEmptyWhereTheBudgetLeavesNothingToSee) {
  SmallPictureLimits limits;
  limits.max_bytes = 50;
  EXPECT_TRUE(SmallPicture(Encode(".jpg", Scene(64, 48)), {10, 10, 40, 40}, {0, 0, 64, 48}, limits)
                  .empty());
}

TEST_F(SmallPictureTest, WithoutABoxItShowsTheWholePicture) {
  const Bytes file = SmallPicture(Encode(".jpg", Scene(1280, 720)));
  EXPECT_LE(file.size(), 4096U);
  EXPECT_EQ(Decode(file).size(), cv::Size(192, 108));
}

}  // namespace
}  // namespace livemap::zone
