#include "evaluation/detection/detection_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kTableBegin[] = "image,class,score,x_min,y_min,x_max,y_max\n";

std::string WhyTableIsRefused(const std::string& text) {
  try {
    ParseDetectionTable(text, "found.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(DetectionTable, ListsDetectionsByTheirPicturesNameWhateverItsExtension) {
  const DetectionTable table = ParseDetectionTable(
      std::string(kTableBegin) +
          "b,pothole,0.5,1,2,11,22\na.jpg,pothole,1,0,0,4,4\nb,cone,0,3,3,5,9.5\n",
      "found.csv");
  ASSERT_EQ(table.size(), 2U);
  EXPECT_EQ(table.at("a").size(), 1U);
  ASSERT_EQ(table.at("b").size(), 2U);
  EXPECT_EQ(table.at("b")[0].class_name, "pothole");
  EXPECT_FLOAT_EQ(table.at("b")[0].confidence, 0.5F);
  EXPECT_EQ(table.at("b")[0].box, cv::Rect2f(1, 2, 10, 20));
  EXPECT_EQ(table.at("b")[1].box, cv::Rect2f(3, 3, 2, 6.5F));
}

TEST(DetectionTable, WithoutALineThereAreNoDetections) {
  EXPECT_TRUE(ParseDetectionTable(kTableBegin, "found.csv").empty());
}

TEST(DetectionTable, BlanksAroundValuesDoNotCount) {
  const DetectionTable table =
      ParseDetectionTable(std::string(kTableBegin) + " a , traffic cone ,0.5, 1,2 ,11,22\n",
                          "found.csv", {"traffic cone"});
  ASSERT_EQ(table.count("a"), 1U);
  EXPECT_EQ(table.at("a")[0].class_name, "traffic cone");
}

TEST(DetectionTable, OnlyAPicturesExtensionIsLeftOutOfItsName) {
  const DetectionTable table = ParseDetectionTable(
      std::string(kTableBegin) + "clip.01,pothole,0.5,1,2,11,22\nclip.02.PNG,pothole,1,0,0,4,4\n",
      "found.csv");
  EXPECT_EQ(table.count("clip.01"), 1U);
  EXPECT_EQ(table.count("clip.02"), 1U);
}

TEST(DetectionTable, RefusesAClassThatNobodyKnows) {
  const std::string text = kTableBegin + std::string("a,pothole,1,0,0,4,4\na,potholes,1,0,0,4,4\n");
  EXPECT_NO_THROW(ParseDetectionTable(text, "found.csv"));
  try {
    ParseDetectionTable(text, "found.csv", {"pothole", "debris"});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "line 3 of 'found.csv' has the class 'potholes', accepted are pothole, debris");
  }
}

TEST(DetectionTable, NamesTheLineTheValueAndWhatIsAccepted) {
  EXPECT_THAT(WhyTableIsRefused(""),
              AllOf(HasSubstr("line 1 of 'found.csv'"), HasSubstr("image,class")));
  for (const std::string line :
       {"a,pothole,0.5,1,2,11", "a,pothole,0.5,1,2,11,22,3", "a,pothole,1.5,1,2,11,22",
        "a,pothole,-0.1,1,2,11,22", "a,pothole,nan,1,2,11,22", "a,pothole,0.5,11,2,1,22",
        "a,pothole,0.5,1,2,1,22", "a,pothole,0.5,1,2,1e9,22", "a,,0.5,1,2,11,22",
        ",pothole,0.5,1,2,11,22", "../a,pothole,0.5,1,2,11,22"}) {
    EXPECT_THAT(
        WhyTableIsRefused(kTableBegin + std::string("b,pothole,0.5,1,2,11,22\n") + line + "\n"),
        AllOf(HasSubstr("line 3 of 'found.csv'"), HasSubstr(line), HasSubstr("accepted is")))
        << line;
  }
}

}  // namespace
}  // namespace livemap::evaluation
