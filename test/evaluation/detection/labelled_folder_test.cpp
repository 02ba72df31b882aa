#include "evaluation/detection/labelled_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/error.h"

namespace livemap::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

LabelledFolderConfig Options(std::vector<std::string> label_classes = {}, std::string split = "") {
  return {std::move(label_classes), {"pothole", "traffic_cone"}, std::move(split)};
}

class LabelledFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = std::filesystem::path(::testing::TempDir()) /
            (std::string("labelled_folder_") +
             ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(root_);
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  void Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << text;
  }
  std::string Path(const std::string& name) const { return (root_ / name).string(); }

  LabelledFolder Read(const std::string& name, const LabelledFolderConfig& options = Options()) {
    deduced_.reset();
    return ReadLabelledFolder(Path(name), options, &deduced_);
  }
  std::string ErrorOf(const std::string& name, const LabelledFolderConfig& options = Options()) {
    try {
      Read(name, options);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }

  std::filesystem::path root_;
  std::optional<std::string> deduced_;
};

TEST_F(LabelledFolderTest, ImagesAreReadInTheOrderOfTheirNamesWithTheirLabels) {
  Write("set/images/b.jpg", "");
  Write("set/images/a.PNG", "");
  Write("set/images/readme.txt", "");
  Write("set/labels/b.txt", "1 0.5 0.5 0.2 0.4\n\n0 0.25 0.25 0.5 0.5\n");
  const LabelledFolder folder = Read("set", Options({"pothole", "deer"}));
  EXPECT_FALSE(folder.is_drive);
  EXPECT_THAT(folder.classes, ElementsAre("pothole", "deer"));
  ASSERT_EQ(folder.frames.size(), 2U);
  EXPECT_TRUE(folder.frames[0].labels.empty()) << "no label file, nothing in the image";
  ASSERT_EQ(folder.frames[1].labels.size(), 2U);
  EXPECT_EQ(folder.frames[1].labels[0].class_name, "deer");
  EXPECT_DOUBLE_EQ(folder.frames[1].labels[0].box.x, 0.4);
  EXPECT_DOUBLE_EQ(folder.frames[1].labels[0].box.height, 0.4);
}

TEST_F(LabelledFolderTest, ALinkThatWasCopiedAsTextIsFollowed) {
  Write("first/images/a.jpg", "");
  Write("first/labels/a.txt", "");
  Write("second/images", "../first/images");
  Write("second/labels/a.txt", "0 0.5 0.5 0.1 0.1\n");
  Write("second/difficult/a.txt", "0 0.2 0.2 0.1 0.1\n");
  const LabelledFolder second = Read("second", Options({"pothole"}));
  ASSERT_EQ(second.frames.size(), 1U);
  EXPECT_EQ(second.frames[0].image_path, Path("first/images/a.jpg"));
  EXPECT_EQ(second.frames[0].labels.size(), 1U);
  EXPECT_EQ(second.frames[0].difficult.size(), 1U);
  Write("second/frames.csv", "frame,chainage_m\na,10\n");
  EXPECT_TRUE(Read("second", Options({"pothole"})).is_drive);
  Write("third/images", "../nowhere");
  EXPECT_THAT(ErrorOf("third"), HasSubstr("has no images/"));
}

TEST_F(LabelledFolderTest, ADriveIsReadInDrivingOrder) {
  Write("drive/frames.csv", "frame,chainage_m,potholes\r\nx,30.5,1\r\ny,10,0\r\n");
  Write("drive/images/x.jpg", "");
  Write("drive/images/y.jpg", "");
  Write("drive/labels/x.txt", "0 0.5 0.5 0.2 0.4\n");
  const LabelledFolder folder = Read("drive");
  EXPECT_TRUE(folder.is_drive);
  EXPECT_THAT(folder.classes, ElementsAre("pothole"));
  EXPECT_THAT(deduced_.value_or(""), HasSubstr("as pothole"));
  ASSERT_EQ(folder.frames.size(), 2U);
  EXPECT_EQ(folder.frames[0].chainage_m, 10);
  EXPECT_EQ(folder.frames[1].chainage_m, 30.5);
  EXPECT_EQ(folder.frames[1].labels.size(), 1U);
}

TEST_F(LabelledFolderTest, SplitsAreReadByFlagOrByPath) {
  Write("traffic_cones/images/val/a.jpg", "");
  Write("traffic_cones/labels/val/a.txt", "0 0.5 0.5 0.2 0.4\n");
  Write("traffic_cones/images/train/b.jpg", "");
  Write("traffic_cones/labels/train/b.txt", "");
  EXPECT_EQ(Read("traffic_cones", Options({}, "val")).frames[0].labels.size(), 1U);
  EXPECT_EQ(Read("traffic_cones/images/val").frames[0].labels.size(), 1U);
  EXPECT_EQ(Read("traffic_cones/images/val/").frames[0].labels[0].class_name, "traffic_cone");
  EXPECT_THAT(ErrorOf("traffic_cones"), AllOf(HasSubstr("--split"), HasSubstr("train, val")));
  EXPECT_THAT(ErrorOf("traffic_cones", Options({}, "test")),
              AllOf(HasSubstr("images/test"), HasSubstr("train, val")));
}

TEST_F(LabelledFolderTest, EverySpellingOfExtensionsIsReadInNumberOrder) {
  for (const char* name : {"10.jpg", "9.JPEG", "013.png", "13.PNG", "._9.jpg"}) {
    Write(std::string("pothole/images/") + name, "");
  }
  Write("pothole/labels/9.Txt",
        "\xef\xbb\xbf"
        "0 0.5 0.5 0.2 0.4\r\n");
  Write("pothole/labels/13.txt", "0 0.5 0.5 0.2 0.4");
  const LabelledFolder folder = Read("pothole");
  std::vector<std::string> told;
  for (const LabelledFrame& frame : folder.frames) {
    told.push_back(std::filesystem::path(frame.image_path).filename().string() + " " +
                   std::to_string(frame.labels.size()));
  }
  EXPECT_THAT(told, ElementsAre("9.JPEG 1", "10.jpg 0", "13.PNG 1", "013.png 0"))
      << "a set may hold 13 and 013";
}

TEST_F(LabelledFolderTest, WhatWouldBePassedOverIsRefused) {
  Write("pothole/images/7.jpg", "");
  Write("pothole/labels/007.txt", "0 0.5 0.5 0.2 0.4\n");
  EXPECT_THAT(ErrorOf("pothole"), AllOf(HasSubstr("007.txt"), HasSubstr("7.jpg")));
  std::filesystem::remove(root_ / "pothole/labels/007.txt");
  Write("pothole/images/7.png", "");
  EXPECT_THAT(ErrorOf("pothole"), AllOf(HasSubstr("7.png"), HasSubstr("7.jpg")));
  std::filesystem::remove(root_ / "pothole/images/7.png");
  Write("pothole/labels/7.txt", "");
  Write("pothole/labels/7.TXT", "");
  EXPECT_THAT(ErrorOf("pothole"), HasSubstr("one label file of each"));
}

TEST_F(LabelledFolderTest, ALabelFileThatBelongsToNoPictureIsRefused) {
  Write("pothole/images/IMG_0.jpg", "");
  Write("pothole/images/1.jpg", "");
  Write("pothole/labels/1.txt", "");
  for (const char* stray : {"0.jpg.txt", "img_0.txt", "renamed.txt"}) {
    Write(std::string("pothole/labels/") + stray, "0 0.5 0.5 0.2 0.4\n");
    EXPECT_THAT(ErrorOf("pothole"), AllOf(HasSubstr(std::string("labels/") + stray),
                                          HasSubstr("1 of the 2 label files"),
                                          HasSubstr("accepted is the name of a picture")));
    std::filesystem::remove(root_ / "pothole/labels" / stray);
  }
  Write("pothole/labels/classes.txt", "pothole\n");
  EXPECT_EQ(Read("pothole").frames.size(), 2U) << "classes.txt is no label file";
  Write("pothole/difficult/2.txt", "");
  EXPECT_THAT(ErrorOf("pothole"), HasSubstr("difficult/2.txt"));
  std::filesystem::remove_all(root_ / "pothole/difficult");
  Write("pothole/labels/train/1.txt", "");
  EXPECT_THAT(ErrorOf("pothole"),
              AllOf(HasSubstr("labels/train/1.txt"), HasSubstr("divided as the pictures are")));
  Write("pothole/images/train/1.jpg", "");
  EXPECT_EQ(Read("pothole").frames.size(), 2U) << "a split of its own";
}

TEST_F(LabelledFolderTest, PotholesThatADrivesTableCountsNeedALabelFile) {
  Write("drive/images/0.jpg", "");
  Write("drive/images/1.jpg", "");
  Write("drive/labels/1.txt", "0 0.5 0.5 0.2 0.4\n");
  Write("drive/frames.csv", "frame,chainage_m,potholes\n0,0,0\n1,5,1\n");
  EXPECT_THAT(Read("drive").notes, ElementsAre());
  Write("drive/frames.csv", "frame,chainage_m,potholes\n0,0,0\n1,5,2\n");
  EXPECT_THAT(Read("drive").notes,
              ElementsAre(AllOf(HasSubstr("frames.csv"), HasSubstr("1 frame,"), HasSubstr("'1'"))));
  Write("drive/frames.csv", "frame,chainage_m,potholes\n0,0,2\n1,5,1\n");
  EXPECT_THAT(ErrorOf("drive"), AllOf(HasSubstr("frames.csv"), HasSubstr("the frame '0'"),
                                      HasSubstr("has no label file")));
}

TEST_F(LabelledFolderTest, ABlankLineAmongTheClassesIsRefused) {
  Write("pothole/images/a.jpg", "");
  Write("pothole/labels/a.txt", "");
  Write("pothole/classes.txt", "pothole\n \ndeer\n");
  EXPECT_THAT(ErrorOf("pothole"), AllOf(HasSubstr("classes.txt', line 2"), HasSubstr("blank")));
  Write("pothole/classes.txt", "\n");
  EXPECT_THAT(ErrorOf("pothole"), AllOf(HasSubstr("classes.txt"), HasSubstr("names no class")));
}

TEST_F(LabelledFolderTest, ADrivesTableNamesEachPictureOnceAndWithoutItsExtension) {
  Write("drive/images/1.jpg", "");
  Write("drive/labels/1.txt", "");
  Write("drive/frames.csv", "frame,chainage_m,potholes\n1,0,0\n01,5,0\n");
  EXPECT_THAT(ErrorOf("drive"), AllOf(HasSubstr("1.jpg' twice"), HasSubstr("'1' and '01'")));
  Write("drive/frames.csv", "frame,chainage_m,potholes\n1.jpg,0,0\n");
  EXPECT_THAT(ErrorOf("drive"), AllOf(HasSubstr("'1.jpg'"), HasSubstr("without their extensions")));
}

TEST_F(LabelledFolderTest, ADrivesTableIsReadWhateverWroteItAndRefusedWhenItRepeats) {
  Write("drive/images/7.jpeg", "");
  Write("drive/labels/7.txt", "");
  Write("drive/frames.csv",
        "\xef\xbb\xbf"
        "frame,chainage_m,potholes\r\n007,10,0\r\n\r\n");
  EXPECT_EQ(Read("drive").frames.size(), 1U) << "a number is found however it is padded";
  Write("drive/frames.csv", "frame,chainage_m,potholes\n7,10,0\n7,10,0\n");
  EXPECT_THAT(ErrorOf("drive"), HasSubstr("'7' twice"));
  Write("drive/frames.csv", "frame,chainage_m,potholes\n");
  EXPECT_THAT(ErrorOf("drive"), HasSubstr("lists no frame"));
}

TEST_F(LabelledFolderTest, DifficultObjectsAreReadBesideTheLabels) {
  Write("pothole/images/val/a.jpg", "");
  Write("pothole/labels/val/a.txt", "");
  Write("pothole/difficult/val/a.txt", "0 0.5 0.5 0.2 0.4\n");
  const LabelledFolder folder = Read("pothole", Options({}, "val"));
  ASSERT_EQ(folder.frames.size(), 1U);
  EXPECT_TRUE(folder.frames[0].labels.empty());
  ASSERT_EQ(folder.frames[0].difficult.size(), 1U);
  EXPECT_DOUBLE_EQ(folder.frames[0].difficult[0].box.width, 0.2);
  Write("pothole/difficult/val/a.txt", "0 0.5\n");
  EXPECT_THAT(ErrorOf("pothole/images/val"), HasSubstr("difficult/val/a.txt"));
}

TEST_F(LabelledFolderTest, TheFoldersOwnNameSaysWhatClassZeroIs) {
  Write("deer/pothole_closeups/images/a.jpg", "");
  Write("deer/pothole_closeups/labels/a.txt", "");
  EXPECT_THAT(Read("deer/pothole_closeups").classes, ElementsAre("pothole"));
  EXPECT_THAT(deduced_.value_or(""), HasSubstr("as pothole"));
}

TEST_F(LabelledFolderTest, ClassesTxtAndTheFlagComeBeforeTheName) {
  Write("pothole/images/a.jpg", "");
  Write("pothole/labels/a.txt", "");
  Write("pothole/classes.txt", "traffic_cone\r\ndeer\n\n");
  EXPECT_THAT(Read("pothole").classes, ElementsAre("traffic_cone", "deer"));
  EXPECT_FALSE(deduced_.has_value());
  EXPECT_THAT(Read("pothole", Options({"debris"})).classes, ElementsAre("debris"));
}

TEST_F(LabelledFolderTest, AFolderThatDoesNotSayWhatClassZeroIsNeedsTheFlag) {
  Write("photos/images/a.jpg", "");
  Write("photos/labels/a.txt", "");
  EXPECT_THAT(ErrorOf("photos"), HasSubstr("--label-classes"));
}

TEST_F(LabelledFolderTest, FoldersOfAnotherLayoutAreRefused) {
  EXPECT_THAT(ErrorOf("nowhere"), HasSubstr("nowhere"));
  Write("no_images/labels/a.txt", "");
  EXPECT_THAT(ErrorOf("no_images"), HasSubstr("images/"));
  Write("no_labels/images/a.jpg", "");
  EXPECT_THAT(ErrorOf("no_labels"), HasSubstr("labels"));
  std::filesystem::create_directories(root_ / "empty/images");
  std::filesystem::create_directories(root_ / "empty/labels");
  EXPECT_THAT(ErrorOf("empty"), HasSubstr("no image"));
}

TEST_F(LabelledFolderTest, ABadDriveTableIsRefusedNamingTheLine) {
  Write("pothole/images/x.jpg", "");
  Write("pothole/labels/x.txt", "");
  for (const auto& [table, expected] : std::vector<std::pair<std::string, std::string>>{
           {"frame,metres\nx,1\n", "'frame,metres'"},
           {"frame,chainage_m\nx\n", "line 2"},
           {"frame,chainage_m\nx,nan\n", "'nan'"},
           {"frame,chainage_m\nx,1e999\n", "1e999"},
           {"frame,chainage_m\nx,1m\n", "'1m'"},
           {"frame,chainage_m\nother,1\n", "'other'"}}) {
    Write("pothole/frames.csv", table);
    EXPECT_THAT(ErrorOf("pothole"), AllOf(HasSubstr("frames.csv"), HasSubstr(expected))) << table;
  }
}

TEST(YoloLabels, BadLinesAreRefusedNamingTheLine) {
  for (const std::string bad :
       {"0 0.5 0.5 0.1", "0 0.5 0.5 0.1 0.1 0.9", "1 0.5 0.5 0.1 0.1", "-1 0.5 0.5 0.1 0.1",
        "0.5 0.5 0.5 0.1 0.1", "nan 0.5 0.5 0.1 0.1", "0 nan 0.5 0.1 0.1", "0 inf 0.5 0.1 0.1",
        "0 320 200 10 10", "0 0.5 0.5 0 0.1", "0 0.5 0.5 -0.1 0.1", "0 -0.4 0.5 0.1 0.1",
        "a 0.5 0.5 0.1 0.1", "0 0.5 0.5 0.1 0.1x"}) {
    try {
      ParseYoloLabels("0 0.5 0.5 0.1 0.1\n" + bad + "\n", {"pothole"}, "l.txt");
      FAIL() << "accepted: " << bad;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("l.txt"), HasSubstr("line 2"))) << bad;
    }
  }
}

TEST(YoloLabels, BoxesAreCutToTheImage) {
  const auto labels = ParseYoloLabels("0 0 0.5 0.2 1.2\n", {"pothole"}, "l.txt");
  ASSERT_EQ(labels.size(), 1U);
  EXPECT_NEAR(labels[0].box.x, 0, 1e-12);
  EXPECT_NEAR(labels[0].box.width, 0.1, 1e-12);
  EXPECT_NEAR(labels[0].box.height, 1, 1e-12);
}

}  // namespace
}  // namespace livemap::evaluation
