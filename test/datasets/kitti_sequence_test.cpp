#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "common/error.h"
#include "datasets/sequences.h"
#include "test/support/temporary_directory.h"

namespace livemap::datasets {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr std::int64_t kTenth = 100'000'000;

std::string Calibration(double baseline_px) {
  return "P0: 300 0 160 0 0 300 120 0 0 0 1 0\nP1: 300 0 160 " + std::to_string(-baseline_px) +
         " 0 300 120 0 0 0 1 0\n";
}

/// A folder whose picture of number n has the stamp n / 10 s and the pose n m ahead.
class KittiFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    Write("calib.txt", Calibration(60));
    WriteLines(12);
  }
  void Write(const std::string& name, const std::string& text) const {
    const fs::path path = fs::path(folder_.path()) / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  void WriteLines(int count) const {
    std::string times, poses;
    for (int i = 0; i < count; ++i) {
      times += std::to_string(0.1 * i) + "\n";
      poses += "1 0 0 0 0 1 0 0 0 0 1 " + std::to_string(i) + "\n";
    }
    Write("times.txt", times);
    Write("poses.txt", poses);
  }
  void Pictures(const std::vector<std::string>& names, const std::string& in = "image_0") const {
    for (const std::string& name : names) Write(in + "/" + name, "not opened");
  }
  Sequence Read() const { return ReadKittiSequence(folder_.path(), 10); }
  /// "NAME@tenths of a second@metres ahead" of each picture.
  std::vector<std::string> Frames() const {
    std::vector<std::string> told;
    const Sequence sequence = Read();
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
      std::string text = fs::path(sequence.frames[i].image_path).filename().string() + "@" +
                         std::to_string(sequence.frames[i].stamp_ns / kTenth);
      if (!sequence.poses.empty()) {
        EXPECT_EQ(sequence.poses[i].stamp_ns, sequence.frames[i].stamp_ns);
        text += "@" + std::to_string(
                          static_cast<int>(sequence.poses[i].world_from_camera.translation().z()));
      }
      told.push_back(text);
    }
    return told;
  }
  test::TemporaryDirectory folder_;
};

TEST_F(KittiFolder, UnpaddedNamesRunInNumberOrder) {
  Pictures({"0.png", "1.jpeg", "10.png", "11.JPG", "2.png", "3.PNG", "4.png", "5.png", "6.png",
            "7.png", "8.png", "9.png"});
  EXPECT_THAT(Frames(), ElementsAre("0.png@0@0", "1.jpeg@1@1", "2.png@2@2", "3.PNG@3@3",
                                    "4.png@4@4", "5.png@5@5", "6.png@6@6", "7.png@7@7", "8.png@8@8",
                                    "9.png@9@9", "10.png@10@10", "11.JPG@11@11"));
}

TEST_F(KittiFolder, AMissingPictureMovesNoOther) {
  Pictures({"000000.png", "000001.png", "000005.png", "000011.png"});
  EXPECT_THAT(Frames(), ElementsAre("000000.png@0@0", "000001.png@1@1", "000005.png@5@5",
                                    "000011.png@11@11"));
  fs::remove(folder_.path() + "/image_0/000000.png");
  EXPECT_THAT(Frames(), ElementsAre("000001.png@1@1", "000005.png@5@5", "000011.png@11@11"));
}

TEST_F(KittiFolder, WithoutTimesAMissingPictureLeavesAGap) {
  fs::remove(folder_.path() + "/times.txt");
  Pictures({"000002.png", "000003.png", "000007.png"});
  EXPECT_THAT(Frames(), ElementsAre("000002.png@2@2", "000003.png@3@3", "000007.png@7@7"));
  fs::remove(folder_.path() + "/poses.txt");
  EXPECT_THAT(Frames(), ElementsAre("000002.png@0", "000003.png@1", "000007.png@5"));
}

TEST_F(KittiFolder, NumbersThatBeginElsewhereAreTakenLineByLineWhereTheLinesAreAsMany) {
  WriteLines(3);
  Pictures({"101.png", "102.png", "103.png"});
  EXPECT_THAT(Frames(), ElementsAre("101.png@0@0", "102.png@1@1", "103.png@2@2"));
  fs::remove(folder_.path() + "/image_0/102.png");
  EXPECT_THAT([&] { Frames(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("103.png"), HasSubstr("number 103"),
                                         HasSubstr("times.txt"), HasSubstr("3 lines"))));
}

TEST_F(KittiFolder, StampsAndNamesWithoutNumbersAreTakenLineByLineOrRefused) {
  WriteLines(2);
  Pictures({"1403636579763555584.png", "1403636579813555456.png"});
  EXPECT_EQ(Frames()[1], "1403636579813555456.png@1@1");
  WriteLines(3);
  EXPECT_THAT([&] { Frames(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("no number of a frame"), HasSubstr("3 lines"))));
}

TEST_F(KittiFolder, ANumberBehindTheLastLineIsRefused) {
  Pictures({"000000.png", "000012.png"});
  EXPECT_THAT([&] { Frames(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("000012.png"), HasSubstr("12 lines"))));
  WriteLines(0);
  EXPECT_THAT([&] { Frames(); }, ThrowsMessage<Error>(HasSubstr("0 lines")));
}

TEST_F(KittiFolder, TwoFilesOfOneNumberAreRefusedByNamingBoth) {
  Pictures({"0.png", "1.png", "000001.jpg"});
  EXPECT_THAT([&] { Frames(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("/1.png"), HasSubstr("/000001.jpg"))));
}

TEST_F(KittiFolder, RightPicturesBelongToTheLeftOnesOfTheirNumber) {
  Pictures({"000000.png", "000001.png", "000002.png"});
  Pictures({"0.jpeg", "2.png"}, "image_1");
  const Sequence sequence = Read();
  EXPECT_DOUBLE_EQ(sequence.baseline_m, 0.2);
  EXPECT_THAT(sequence.frames[0].right_path, EndsWith("image_1/0.jpeg"));
  EXPECT_EQ(sequence.frames[1].right_path, "");
  EXPECT_THAT(sequence.frames[2].right_path, EndsWith("image_1/2.png"));
}

TEST_F(KittiFolder, NamedProjectionsAreThoseOfTheirNamesInAnyOrder) {
  const auto projection = [](int focal_px, int shift_px) {
    const std::string f = std::to_string(focal_px);
    return f + " 0 160 " + std::to_string(shift_px) + " 0 " + f + " 120 0 0 0 1 0\n";
  };
  Pictures({"0.png", "1.png"}, "image_2");
  Pictures({"0.png", "1.png"}, "image_3");
  Write("calib.txt", "calib_time: 09-Jan-2012\nP3: " + projection(400, -80) +
                         "P0: " + projection(300, 0) + "P2: " + projection(400, 0));
  EXPECT_DOUBLE_EQ(Read().intrinsics.fx, 400);
  EXPECT_DOUBLE_EQ(Read().baseline_m, 0.2);
  Write("calib.txt", "P0: " + projection(300, 0));
  EXPECT_DOUBLE_EQ(Read().intrinsics.fx, 300) << "one line is enough for one camera";
  EXPECT_DOUBLE_EQ(Read().baseline_m, 0);
  Write("calib.txt", "Tr: " + projection(300, 0));
  EXPECT_THAT([&] { Read(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("calib.txt"), HasSubstr("'Tr: 300"),
                                         HasSubstr("'P0: ' to 'P3: '"))));
}

TEST_F(KittiFolder, MarksAndLineEndsOfOtherSystemsDoNotCount) {
  Pictures({"0.png", "1.png"});
  Write("calib.txt", "\xef\xbb\xbf" + Calibration(60));
  Write("times.txt",
        "\xef\xbb\xbf"
        "0\r\n0.1\r\n\r\n");
  Write("poses.txt",
        "\xef\xbb\xbf"
        "1 0 0 0 0 1 0 0 0 0 1 0 \r\n1 0 0 0 0 1 0 0 0 0 1 1\t");
  EXPECT_THAT(Frames(), ElementsAre("0.png@0@0", "1.png@1@1"));
}

TEST(KittiPoses, SayWhatIsWrongWithALine) {
  const std::string good = "1 0 0 0 0 1 0 0 0 0 1 0\n";
  for (const auto& [line, words] : {std::pair("2 0 0 0 0 2 0 0 0 0 2 0", "no rotation"),
                                    std::pair("1 0 0 0 0 1 0 0 0 0 -1 0", "determinant is -1"),
                                    std::pair("1 0 0 0 0 1 0 0 0 0 1", "11 columns"),
                                    std::pair("1 0 0 0 0 1 0 0 0 0 1 nan", "not 12 numbers"),
                                    std::pair("1,0,0,0,0,1,0,0,0,0,1,0", "separated by ','")}) {
    EXPECT_THAT([text = good + line] { ParseKittiPoses(text, "poses.txt"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("line 2 of 'poses.txt'"), HasSubstr(words))))
        << line;
  }
}

}  // namespace
}  // namespace livemap::datasets
