#include <gmock/gmock.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "common/error.h"
#include "datasets/sequences.h"
#include "datasets/stamp_pairs.h"

namespace livemap::datasets {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::ThrowsMessage;

constexpr std::int64_t kMillisecond = 1'000'000;

/// A folder as TUM packs its sequences: three lists, no associations.txt, no camera.yaml.
class TumFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "livemap-tum-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    temporary_ = name;
    folder_ = temporary_ / "rgbd_dataset_freiburg2_made_up";
    Write("rgb.txt",
          "# color images\n# file: 'made_up.bag'\n# timestamp filename\n"
          "1311868164.363181 rgb/1.png\n1311868164.399026 rgb/2.png\n"
          "1311868164.430940 rgb/3.png\n1311868164.463055 rgb/4.png\n");
    Write("depth.txt",
          "# depth maps\n1311868164.373557 depth/1.png\n1311868164.407784 depth/2.png\n"
          "1311868164.505000 depth/4.png\n");
    Write("groundtruth.txt", "# ground truth\n1311868163.8697 -0.1 1.4 1.5 0 0 0 1\n");
    for (const char* picture : {"1", "2", "3", "4"}) {
      Write("rgb/" + std::string(picture) + ".png", "not opened");
      Write("depth/" + std::string(picture) + ".png", "not opened");
    }
  }
  void TearDown() override { fs::remove_all(temporary_); }

  void Write(const std::string& name, const std::string& text) const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }

  fs::path temporary_, folder_;
};

TEST_F(TumFolder, AFileOfTruthWithoutAPoseIsRefused) {
  for (const char* text : {"", "# ground truth\n"}) {
    Write("groundtruth.txt", text);
    EXPECT_THAT([&] { ReadTumSequence(folder_.string()); },
                ThrowsMessage<Error>(HasSubstr("groundtruth.txt' has no pose")));
  }
  fs::remove(folder_ / "groundtruth.txt");
  EXPECT_TRUE(ReadTumSequence(folder_.string()).poses.empty());
}

TEST_F(TumFolder, PairsPicturesWithTheNearestDepthWithinTwentyMilliseconds) {
  const Sequence sequence = ReadTumSequence(folder_.string());
  ASSERT_EQ(sequence.frames.size(), 2U) << "3.png and 4.png have no depth of their own";
  EXPECT_EQ(sequence.frames[0].stamp_ns, 1311868164363181000);
  EXPECT_EQ(sequence.frames[0].depth_stamp_ns, 1311868164373557000);
  EXPECT_EQ(sequence.frames[1].image_path, (folder_ / "rgb/2.png").string());
  EXPECT_EQ(sequence.frames[1].depth_path, (folder_ / "depth/2.png").string());
  EXPECT_EQ(sequence.poses.size(), 1U);
}

TEST_F(TumFolder, HasTheCameraThatIsPublishedForItsName) {
  const Sequence second = ReadTumSequence(folder_.string() + "/");
  EXPECT_EQ(second.intrinsics.fx, 520.9);
  EXPECT_EQ(second.intrinsics.cy, 249.7);
  EXPECT_EQ(second.intrinsics.width, 640);
  EXPECT_EQ(second.depth_scale, 5000);
  EXPECT_EQ(PublishedTumCamera("a/rgbd_dataset_freiburg1_xyz")->fx, 517.3);
  EXPECT_EQ(PublishedTumCamera("fr3_office")->fy, 539.2);
  EXPECT_FALSE(PublishedTumCamera("freiburg1/office"))
      << "of the folder itself, not of its parents";
}

TEST_F(TumFolder, ACameraFileGoesBeforeTheFoldersAndBothBeforeTheName) {
  const std::string numbers = "width: 320\nheight: 240\nfy: 300\ncx: 160\ncy: 120\n";
  Write("camera.yaml", numbers + "fx: 301\n");
  EXPECT_EQ(ReadTumSequence(folder_.string()).intrinsics.fx, 301);
  EXPECT_THAT(ReadTumSequence(folder_.string()).notes,
              ElementsAre(HasSubstr("camera.yaml' does not say depth_scale")));
  Write("mine.yaml", numbers + "fx: 302\ndepth_scale: 1000\n");
  const Sequence sequence = ReadTumSequence(folder_.string(), (folder_ / "mine.yaml").string());
  EXPECT_EQ(sequence.intrinsics.fx, 302);
  EXPECT_EQ(sequence.depth_scale, 1000);
  EXPECT_THAT(sequence.notes, IsEmpty());
}

TEST_F(TumFolder, WithoutAnyCameraIsRefused) {
  const fs::path office = temporary_ / "office";
  fs::rename(folder_, office);
  EXPECT_THAT([&] { ReadTumSequence(office.string()); },
              ThrowsMessage<Error>(HasSubstr("its camera is not known")));
}

TEST_F(TumFolder, ListsThatShareNoTimeAreRefused) {
  Write("depth.txt", "1 depth/1.png\n");
  EXPECT_THAT([&] { ReadTumSequence(folder_.string()); },
              ThrowsMessage<Error>(HasSubstr("within 0.02 s")));
}

TEST_F(TumFolder, AMissingDepthImageIsNamedWithItsList) {
  fs::remove(folder_ / "depth/2.png");
  EXPECT_THAT([&] { ReadTumSequence(folder_.string()); },
              ThrowsMessage<Error>(HasSubstr("depth.txt' is missing")));
}

TEST_F(TumFolder, WithoutADepthListHasEveryPictureAndNoDepth) {
  fs::remove(folder_ / "depth.txt");
  const Sequence sequence = ReadTumSequence(folder_.string());
  ASSERT_EQ(sequence.frames.size(), 4U);
  EXPECT_EQ(sequence.frames[0].depth_path, "");
}

TEST_F(TumFolder, WhoseDepthIsIgnoredHasEveryPictureAndNeedsNoDepthImage) {
  fs::remove_all(folder_ / "depth");
  const Sequence lists = ReadTumSequence(folder_.string(), "", DepthImages::kIgnored);
  ASSERT_EQ(lists.frames.size(), 4U);
  EXPECT_EQ(lists.frames[0].depth_path, "");
  Write("associations.txt", "1 rgb/1.png 1 depth/1.png\n2 rgb/2.png 2 depth/2.png\n");
  const Sequence associated = ReadTumSequence(folder_.string(), "", DepthImages::kIgnored);
  ASSERT_EQ(associated.frames.size(), 2U);
  EXPECT_EQ(associated.frames[1].depth_path, "");
  EXPECT_EQ(associated.frames[1].image_path, (folder_ / "rgb/2.png").string());
  EXPECT_THAT([&] { ReadTumSequence(folder_.string()); },
              ThrowsMessage<Error>(HasSubstr("associations.txt' is missing")));
}

TEST_F(TumFolder, WhatIsNoSequenceOrNoFolderIsSaidToBeNone) {
  EXPECT_THAT([&] { ReadTumSequence((folder_ / "rgb").string()); },
              ThrowsMessage<Error>(HasSubstr("is no TUM sequence")));
  EXPECT_THAT([&] { ReadTumSequence((folder_ / "rgb.txt").string()); },
              ThrowsMessage<Error>(HasSubstr("is no folder")));
  EXPECT_THAT([&] { ReadKittiSequence((folder_ / "rgb.txt").string(), 10); },
              ThrowsMessage<Error>(HasSubstr("is no folder")));
  EXPECT_THAT([&] { ReadTumSequence((folder_ / "nothing").string()); },
              ThrowsMessage<Error>(HasSubstr("does not exist")));
}

TEST_F(TumFolder, ListsMayBeginWithAByteOrderMark) {
  for (const char* list : {"rgb.txt", "depth.txt", "groundtruth.txt"}) {
    std::ifstream file(folder_ / list);
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    Write(list, "\xef\xbb\xbf" + text.substr(text.find('\n') + 1));
  }
  Write("camera.yaml", "\xef\xbb\xbfwidth: 320\nheight: 240\nfx: 300\nfy: 300\ncx: 160\ncy: 120\n");
  const Sequence sequence = ReadTumSequence(folder_.string());
  EXPECT_EQ(sequence.frames.size(), 2U);
  EXPECT_EQ(sequence.poses.size(), 1U);
  EXPECT_EQ(sequence.intrinsics.fx, 300);
  Write("rgb.txt", "\xff\xfe");
  EXPECT_THAT([&] { ReadTumSequence(folder_.string()); },
              ThrowsMessage<Error>(AllOf(HasSubstr("rgb.txt"), HasSubstr("UTF-16"))));
}

TEST(TumTrajectory, APoseThatIsSaidTwiceIsTakenOnceAndNoted) {
  std::vector<std::string> notes;
  const auto poses = ParseTumTrajectory(
      "# fr2\n1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n2.0 1.001 0 0 0 0 0.001 1\n3 2 0 0 0 0 0 1\n", "t",
      &notes);
  ASSERT_EQ(poses.size(), 3U);
  EXPECT_EQ(poses[1].world_from_camera.translation().x(), 1) << "the first";
  EXPECT_THAT(notes, ElementsAre(AllOf(HasSubstr("1 line of 't'"), HasSubstr("line 4"))));
}

TEST(TumTrajectory, TwoPosesWithOneStampAreRefusedWithBothLines) {
  for (const char* other : {"2 1.1 0 0 0 0 0 1", "2 1 0 0 0 0 0.1 0.995"}) {
    EXPECT_THAT([text = "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n" +
                        std::string(other)] { ParseTumTrajectory(text, "t.txt"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("lines 2 and 3 of 't.txt'"),
                                           HasSubstr("2 1 0 0 0 0 0 1"), HasSubstr(other))));
  }
}

TEST(TumTrajectory, SaysWhatALineLooksLike) {
  for (const auto& [line, words] :
       {std::pair("1403636579763555584 0 0 0 0 0 0 1", "looks like nanoseconds"),
        std::pair("1.403636579763555584e+18 0 0 0 0 0 0 1", "looks like nanoseconds"),
        std::pair("1403636579763555 0 0 0 0 0 0 1", "looks like microseconds"),
        std::pair("1403636579763 0 0 0 0 0 0 1", "looks like milliseconds"),
        std::pair("-1 0 0 0 0 0 0 1", "stamp is negative"),
        std::pair("1,0,0,0,0,0,0,1", "separated by ','"),
        std::pair("1;0;0;0;0;0;0;1", "separated by ';'"),
        std::pair("1 0 0 0 0 0 0 2", "unit quaternion"), std::pair("1 0 0 nan 0 0 0 1", "nan")}) {
    EXPECT_THAT([text = std::string(line)] { ParseTumTrajectory(text, "t.txt"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("line 1 of 't.txt'"), HasSubstr(words))))
        << line;
  }
}

TEST(TumAssociations, ALineThatIsRepeatedIsTakenOnceAndAnotherImageIsRefused) {
  std::vector<std::string> notes;
  EXPECT_EQ(ParseTumAssociations("1 a.png\n1.0 a.png\n2 b.png\n", "rgb.txt", &notes).size(), 2U);
  EXPECT_EQ(notes.size(), 1U);
  EXPECT_THAT([] { ParseTumAssociations("1 a.png\n1 b.png\n", "rgb.txt"); },
              ThrowsMessage<Error>(
                  AllOf(HasSubstr("lines 1 and 2"), HasSubstr("a.png"), HasSubstr("b.png"))));
}

TEST(StampPairs, TheNearestPairGoesFirstAndEachStampOnce) {
  // 13 is the nearest to 10, but 14 is nearer to it.
  EXPECT_THAT(PairNearestStamps({10, 14}, {13, 30}, 100), ElementsAre(Pair(0, 1), Pair(1, 0)));
  EXPECT_THAT(PairNearestStamps({10, 12}, {13}, 100), ElementsAre(Pair(1, 0)));
  EXPECT_THAT(PairNearestStamps({10, 12}, {11}, 100), ElementsAre(Pair(0, 0)))
      << "of equally near ones the earlier";
}

TEST(StampPairs, AreLessThanTheMaximumApart) {
  EXPECT_THAT(PairNearestStamps({0}, {20 * kMillisecond}, 20 * kMillisecond), IsEmpty());
  EXPECT_THAT(PairNearestStamps({0}, {20 * kMillisecond - 1}, 20 * kMillisecond),
              ElementsAre(Pair(0, 0)));
  EXPECT_THAT(PairNearestStamps({}, {1}, 5), IsEmpty());
}

}  // namespace
}  // namespace livemap::datasets
