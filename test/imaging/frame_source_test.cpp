#include "imaging/frame_source.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "common/error.h"
#include "imaging/orientation.h"
#include "imaging/video_orientation.h"
#include "test/support/temporary_directory.h"

namespace livemap::imaging {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class FrameSourceTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.path() + "/" + name; }
  void Write(const std::string& name) const {
    std::vector<std::uint8_t> file;
    cv::imencode(".png", cv::Mat::zeros(4, 4, CV_8UC1), file);
    std::ofstream(Path(name), std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()),
               static_cast<std::streamsize>(file.size()));
  }
  std::vector<std::string> Names() const {
    const auto source = OpenFolder(folder_.path(), 10000);
    std::vector<std::string> names;
    while (const auto frame = source->Next()) names.push_back(frame->name);
    return names;
  }
  test::TemporaryDirectory folder_;
};

TEST_F(FrameSourceTest, PlaysAFolderInTheOrderOfItsNumbersWhateverTheExtension) {
  for (const char* name : {"0.png", "1.jpeg", "2.PNG", "10.jpg", "9.JPG", "times.txt"}) Write(name);
  EXPECT_THAT(Names(), ElementsAre("0.png", "1.jpeg", "2.PNG", "9.JPG", "10.jpg"));
  Write("02.png");
  EXPECT_THAT([&] { Names(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("/02.png"), HasSubstr("/2.PNG"))));
}

TEST_F(FrameSourceTest, AMissingPictureLeavesTheTimeOfItsFrame) {
  const auto steps = [this] {
    const auto source = OpenFolder(folder_.path(), 10000);
    std::vector<int> found;
    while (const auto frame = source->Next()) found.push_back(frame->steps);
    return found;
  };
  for (const char* name : {"000010.png", "000011.png", "000012.png", "000016.png", "000017.png"}) {
    Write(name);
  }
  EXPECT_THAT(steps(), ElementsAre(1, 1, 1, 4, 1));
  Write("001000.png");
  Write("002000.png");
  Write("003500.png");
  EXPECT_THAT(steps(), ElementsAre(1, 1, 1, 1, 1, 1, 1, 1)) << "no usual step";
}

TEST_F(FrameSourceTest, APictureThatCannotBeReadSaysHowManyFramesItComesAfterTheOneBefore) {
  for (const char* name : {"10.png", "11.png", "12.png", "16.png", "17.png"}) Write(name);
  std::filesystem::resize_file(Path("16.png"), 20000);
  const auto source = OpenFolder(folder_.path(), 10000);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(source->Next()->steps, 1);
  try {
    source->Next();
    ADD_FAILURE() << "it is too large";
  } catch (const UnreadableFrame& unreadable) {
    EXPECT_EQ(unreadable.steps(), 4);
    EXPECT_THAT(unreadable.what(), HasSubstr("/16.png"));
  }
  EXPECT_EQ(source->Next()->steps, 1) << "after the one that could not be read";
}

TEST_F(FrameSourceTest, RefusesAFolderWithoutPictures) {
  EXPECT_THAT([&] { Names(); }, ThrowsMessage<Error>(HasSubstr(folder_.path())));
}

/// A video of one colour right and another one left, 64x48; false where no encoder is installed.
bool WriteVideo(const std::string& path) {
  cv::VideoWriter writer(path, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 10, {64, 48});
  if (!writer.isOpened()) return false;
  cv::Mat frame(48, 64, CV_8UC3, cv::Scalar(0, 0, 255));
  frame.colRange(32, 64) = cv::Scalar(255, 0, 0);
  for (int i = 0; i < 3; ++i) writer.write(frame);
  return true;
}

/// Enters the matrix into the header of the video's track.
void TurnVideo(const std::string& path, const std::vector<std::int32_t>& abcd) {
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  const std::size_t header = bytes.find("tkhd");
  ASSERT_NE(header, std::string::npos);
  for (const std::size_t i : {0U, 1U, 2U, 3U}) {
    const std::uint32_t value = static_cast<std::uint32_t>(abcd[i]) << 16U;
    const std::size_t at = header + 4 + 40 + 4 * (i < 2 ? i : i + 1);
    file.seekp(static_cast<std::streamoff>(at));
    for (const int shift : {24, 16, 8, 0}) file.put(static_cast<char>(value >> shift & 0xffU));
  }
}

TEST_F(FrameSourceTest, TurnsTheFramesOfAVideoAsItsTrackSays) {
  const std::string path = Path("drive.mp4");
  if (!WriteVideo(path)) GTEST_SKIP() << "no encoder of MPEG-4";
  EXPECT_EQ(ReadVideoOrientation(path), kUpright);
  EXPECT_EQ(OpenVideo(path)->Next()->image.size(), cv::Size(64, 48));
  TurnVideo(path, {0, 1, -1, 0});
  EXPECT_EQ(ReadVideoOrientation(path), 6);
  const auto video = OpenVideo(path);
  for (int round = 0; round < 2; ++round) {
    const cv::Mat image = video->Next()->image;
    ASSERT_EQ(image.size(), cv::Size(48, 64));
    EXPECT_GT(image.at<cv::Vec3b>(8, 24)[2], 150) << "what was left is above: clockwise";
    EXPECT_GT(image.at<cv::Vec3b>(56, 24)[0], 150);
    video->Rewind();
  }
  TurnVideo(path, {-1, 0, 0, -1});
  const cv::Mat image = OpenVideo(path)->Next()->image;
  ASSERT_EQ(image.size(), cv::Size(64, 48));
  EXPECT_GT(image.at<cv::Vec3b>(24, 8)[0], 150);
}

}  // namespace
}  // namespace livemap::imaging
