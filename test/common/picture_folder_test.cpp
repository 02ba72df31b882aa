#include "common/picture_folder.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "common/error.h"
#include "test/support/temporary_directory.h"

namespace livemap {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(NaturalOrder, ReadsRunsOfDigitsAsNumbers) {
  std::vector<std::string> names = {"10",   "9",    "1",    "img-10", "img-9b", "img-9", "img",
                                    "a2b1", "a2b0", "a10b", "009",    "",       "a"};
  std::sort(names.begin(), names.end(),
            [](const std::string& a, const std::string& b) { return NaturalLess(a, b); });
  EXPECT_THAT(names, ElementsAre("", "1", "009", "9", "10", "a", "a2b0", "a2b1", "a10b", "img",
                                 "img-9", "img-9b", "img-10"));
  EXPECT_TRUE(NaturalLess("99999999999999999999998", "99999999999999999999999")) << "of any length";
  EXPECT_FALSE(NaturalLess("7", "7"));
}

TEST(NaturalOrder, TakesNumbersOutOfNames) {
  EXPECT_EQ(WithoutLeadingZeros("gt_007_0_x00"), "gt_7_0_x0");
  EXPECT_EQ(NumberOf("frame_0012"), 12U);
  EXPECT_EQ(NumberOf("3_left"), 3U);
  EXPECT_EQ(NumberOf("1403636579763555584"), std::nullopt) << "a stamp in nanoseconds";
  EXPECT_EQ(NumberOf("left"), std::nullopt);
  EXPECT_EQ(StemOf("a/b/007.jpeg"), "007");
}

class PictureFolderTest : public ::testing::Test {
 protected:
  void Touch(const std::string& name) const { std::ofstream(folder_.path() + "/" + name); }
  std::vector<std::string> Names(PictureNames names = PictureNames::kNumbered) const {
    std::vector<std::string> found;
    for (const std::string& path : PictureFolder(folder_.path(), names).paths()) {
      found.push_back(std::filesystem::path(path).filename().string());
    }
    return found;
  }
  test::TemporaryDirectory folder_;
};

TEST_F(PictureFolderTest, ListsEverySpellingInNumberOrderAndNothingElse) {
  for (const char* name : {"10.png", "1.jpeg", "2.JPG", "11.JPEG", "3.Png", "4.jpe", "5.JFIF",
                           "._1.jpeg", ".hidden.png", "times.txt", "README"}) {
    Touch(name);
  }
  std::filesystem::create_directory(folder_.path() + "/0.png");
  EXPECT_THAT(Names(),
              ElementsAre("1.jpeg", "2.JPG", "3.Png", "4.jpe", "5.JFIF", "10.png", "11.JPEG"));
}

TEST_F(PictureFolderTest, RefusesTwoFilesForOnePictureByNamingBoth) {
  Touch("7.png");
  for (const char* twin : {"7.jpg", "7.PNG"}) {
    Touch(twin);
    for (const PictureNames names : {PictureNames::kNumbered, PictureNames::kNamed}) {
      EXPECT_THAT([&] { Names(names); },
                  ThrowsMessage<Error>(AllOf(HasSubstr("/7.png'"), HasSubstr(twin))));
    }
    std::filesystem::remove(folder_.path() + "/" + twin);
  }
  Touch("007.jpg");
  EXPECT_THAT([&] { Names(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("/7.png'"), HasSubstr("/007.jpg'"))));
  EXPECT_THAT(Names(PictureNames::kNamed), ElementsAre("007.jpg", "7.png"));
}

TEST_F(PictureFolderTest, PassesNoPictureOverInSilence) {
  Touch("1.png");
  for (const char* other : {"2.bmp", "2.TIFF", "2.webp", "2.pgm"}) {
    Touch(other);
    EXPECT_THAT([&] { Names(); }, ThrowsMessage<Error>(HasSubstr(other)));
    std::filesystem::remove(folder_.path() + "/" + other);
  }
  std::filesystem::create_symlink("nothing", folder_.path() + "/3.png");
  EXPECT_THAT([&] { Names(); }, ThrowsMessage<Error>(HasSubstr("3.png' is a link")));
  EXPECT_THAT([&] { PictureFolder(folder_.path() + "/none", PictureNames::kNamed); },
              ThrowsMessage<Error>(HasSubstr("/none' cannot be read")));
}

TEST_F(PictureFolderTest, FindsANumberHoweverItIsPadded) {
  for (const char* name : {"1_07.png", "013.jpg", "13.jpg"}) Touch(name);
  const PictureFolder folder(folder_.path(), PictureNames::kNamed);
  EXPECT_EQ(folder.Find("1_7"), folder_.path() + "/1_07.png");
  EXPECT_EQ(folder.Find("01_007"), folder_.path() + "/1_07.png");
  EXPECT_EQ(folder.Find("13"), folder_.path() + "/13.jpg") << "letter by letter first";
  EXPECT_EQ(folder.Find("14"), std::nullopt);
  EXPECT_THAT([&] { folder.Find("0013"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("/13.jpg"), HasSubstr("/013.jpg"))));
}

}  // namespace
}  // namespace livemap
