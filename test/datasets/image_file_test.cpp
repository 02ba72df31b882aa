#include "datasets/image_file.h"

#include <gmock/gmock.h>

#include <fstream>

#include "common/error.h"
#include "test/support/oriented_jpeg.h"
#include "test/support/temporary_directory.h"

namespace livemap::datasets {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class ImageFileTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::vector<std::uint8_t>& bytes) const {
    const std::string path = folder_.path() + "/" + name;
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    return path;
  }
  std::string WritePng(const std::string& name, int type) const {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".png", cv::Mat(48, 64, type, cv::Scalar::all(9)), bytes);
    return Write(name, bytes);
  }
  test::TemporaryDirectory folder_;
};

TEST_F(ImageFileTest, APictureIsTurnedUprightBeforeItIsComparedWithTheCalibration) {
  const cv::Mat lying(48, 64, CV_8UC3, cv::Scalar(10, 20, 30));
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const std::string path = Write("a.jpg", test::OrientedJpeg(lying, orientation));
    const bool turned = orientation >= 5;
    const int width = turned ? 48 : 64;
    const int height = turned ? 64 : 48;
    EXPECT_EQ(ReadImageFile(path, 0, 0).header.width, width);
    EXPECT_EQ(ReadImageFile(path, width, height).header.height, height);
    EXPECT_EQ(ReadPictureFile(path, width, height, imaging::DecodeConfig::Pixels::kColour).size(),
              cv::Size(width, height));
    const std::string words = turned ? "after turning it as its EXIF orientation" : "the camera's";
    EXPECT_THAT([&] { ReadImageFile(path, height, width); },
                ThrowsMessage<Error>(AllOf(HasSubstr(path), HasSubstr(words))));
  }
}

TEST_F(ImageFileTest, ADepthImageOfAnotherKindIsNamedInPlainWords) {
  EXPECT_EQ(ReadDepthFile(WritePng("depth.png", CV_16UC1), 64, 48).type(), CV_16UC1);
  for (const auto& [type, words] :
       {std::pair(CV_8UC3, "8 bits, three channels"), std::pair(CV_8UC1, "8 bits, one channel"),
        std::pair(CV_16UC3, "16 bits, three channels"),
        std::pair(CV_8UC4, "8 bits, four channels")}) {
    const std::string path = WritePng("other.png", type);
    EXPECT_THAT([&] { ReadDepthFile(path, 64, 48); },
                ThrowsMessage<Error>(
                    AllOf(HasSubstr(path), HasSubstr(words), HasSubstr("16 bits, one channel"))));
  }
}

TEST_F(ImageFileTest, ATrailerBehindThePictureDoesNotCutItOff) {
  std::vector<std::uint8_t> bytes = test::OrientedJpeg(cv::Mat::zeros(8, 8, CV_8UC3), 1);
  bytes.resize(bytes.size() + 65, 0x41);
  EXPECT_EQ(ReadImageFile(Write("a.jpg", bytes), 8, 8).header.width, 8);
}

}  // namespace
}  // namespace livemap::datasets
