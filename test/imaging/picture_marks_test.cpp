#include "imaging/picture_marks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace livemap::imaging {
namespace {

/// A grey picture of 480 x 320 pixels that shows the part from (100, 50) on of an image.
constexpr PixelRegion kShown{100, 50, 480, 320};
const cv::Scalar kGround = cv::Scalar::all(120);

cv::Mat Grey(int width = 480, int height = 320) { return {height, width, CV_8UC3, kGround}; }

cv::Mat Drawn(const PictureMarks& marks, cv::Mat picture = Grey(),
              const PixelRegion& shown = kShown, double scale = 1) {
  DrawMarks(picture, marks, shown, scale);
  return picture;
}

/// Where the label's plate and the box's line are: as red as nothing else.
cv::Mat Red(const cv::Mat& picture) {
  cv::Mat mask;
  cv::inRange(picture, cv::Scalar(0, 0, 200), cv::Scalar(60, 60, 255), mask);
  return mask;
}

/// By how much the pixel differs from the ground in its strongest channel.
double Contrast(const cv::Mat& picture, const cv::Point& at) {
  return cv::norm(picture(cv::Rect(at, cv::Size(1, 1))) - kGround, cv::NORM_INF);
}

/// The rectangle of the label: what is red beyond the box and its line.
cv::Rect PlateOf(const PictureMarks& marks, const cv::Rect& box_in_picture,
                 const cv::Mat& picture) {
  PictureMarks unlabelled = marks;
  unlabelled.label.clear();
  cv::Mat differs;
  cv::absdiff(picture, Drawn(unlabelled, Grey(picture.cols, picture.rows)), differs);
  cv::cvtColor(differs, differs, cv::COLOR_BGR2GRAY);
  const cv::Rect plate = cv::boundingRect(differs);
  EXPECT_GT(plate.area(), 0) << "no label beside " << box_in_picture;
  return plate;
}

TEST(DrawMarks, TheSubjectIsTheOneLoudBox) {
  const PictureMarks marks{{300, 200, 380, 260}, "", {{120, 80, 180, 120}, {300, 200, 380, 260}}};
  const cv::Mat picture = Drawn(marks);
  const cv::Point subject(300 - 100, 230 - 50), other(120 - 100, 100 - 50);
  EXPECT_GT(Contrast(picture, subject), 100) << "the subject's left edge is red";
  EXPECT_GT(Red(picture).at<uchar>(subject), 0);
  EXPECT_GT(Contrast(picture, other), 20) << "the other's left edge is seen";
  EXPECT_LT(Contrast(picture, other), 70) << "and faint";
  EXPECT_EQ(cv::countNonZero(Red(picture)(cv::Rect(0, 0, 100, 100))), 0) << "nothing red there";
  EXPECT_EQ(Contrast(picture, other + cv::Point(1, 0)), 0) << "one pixel thin";
  EXPECT_EQ(Contrast(picture, {240, 180}), 0) << "the inside stays as it is";
}

TEST(DrawMarks, LinesHaveThePicturesOwnPixelsWhateverItsScale) {
  const PictureMarks marks{{300, 200, 380, 260}, "", {}};
  const cv::Mat half = Drawn(marks, Grey(240, 160), kShown, 0.5);
  EXPECT_GT(Red(half).at<uchar>(cv::Point((300 - 100) / 2, (230 - 50) / 2)), 0);
  EXPECT_GT(Red(half).at<uchar>(cv::Point((340 - 100) / 2, (260 - 50) / 2)), 0);
  EXPECT_EQ(Contrast(half, {120, 90}), 0);
}

TEST(DrawMarks, TheLabelLiesAboveTheBoxElseBelowElseWithinAndIsNeverCut) {
  struct Case {
    Box box;
    const char* where;
  };
  const cv::Rect whole(0, 0, 480, 320);
  for (const Case& each : {Case{{300, 200, 380, 260}, "above"}, Case{{300, 52, 380, 120}, "below"},
                           Case{{110, 51, 570, 369}, "within"}, Case{{100, 50, 580, 370}, "within"},
                           Case{{560, 200, 580, 260}, "above"}, Case{{90, 300, 120, 390}, "above"},
                           Case{{540, 40, 600, 90}, "below"}}) {
    const PictureMarks marks{each.box, "road_work_sign 0.83", {}};
    const cv::Mat picture = Drawn(marks);
    const cv::Rect box(cv::Point(cvRound(each.box.x_min) - 100, cvRound(each.box.y_min) - 50),
                       cv::Point(cvRound(each.box.x_max) - 100, cvRound(each.box.y_max) - 50));
    const cv::Rect plate = PlateOf(marks, box, picture);
    EXPECT_EQ(plate & whole, plate) << each.where;
    EXPECT_GT(plate.width, 120) << "all letters are there: " << plate;
    EXPECT_GT(plate.height, 12) << plate;
    const std::string found = plate.br().y <= box.y                       ? "above"
                              : plate.y >= box.br().y                     ? "below"
                              : (plate & box).area() > 0.9 * plate.area() ? "within"
                                                                          : "across the box's edge";
    EXPECT_EQ(found, each.where) << "box " << box << ", label " << plate;
  }
}

TEST(DrawMarks, ALabelThatIsTooWideIsMadeSmallerAndThenShortened) {
  const PictureMarks marks{{110, 200, 140, 230}, std::string(500, 'W'), {}};
  for (const int width : {480, 200, 64}) {
    const cv::Mat picture = Drawn(marks, Grey(width, 200));
    const cv::Rect plate = PlateOf(marks, {}, picture);
    EXPECT_LE(plate.br().x, width);
    EXPECT_GT(plate.width, width / 3) << "what fits is written";
  }
}

TEST(DrawMarks, BoxesAndNamesOfAnyKindAreDrawnWithoutFault) {
  const float nan = std::nanf("");
  const float huge = std::numeric_limits<float>::max();
  for (const Box& box : {Box{}, Box{nan, 0, 10, nan}, Box{-huge, -huge, huge, huge},
                         Box{10, 10, 5, 5}, Box{huge, huge, huge, huge}}) {
    for (const int side : {1, 3, 480}) {
      const cv::Mat picture = Drawn({box, "\xff<b>\n", {box, {1, 2, 3, 4}}}, Grey(side, side));
      EXPECT_EQ(picture.size(), cv::Size(side, side));
    }
  }
  const cv::Mat untouched = Drawn({{600, 10, 700, 40}, "beside", {{0, 0, 50, 40}}});
  EXPECT_EQ(cv::norm(untouched - kGround, cv::NORM_INF), 0) << "what is not in the picture";
}

TEST(MarkLabel, SaysClassAndConfidence) {
  EXPECT_EQ(MarkLabel("pothole", 0.834), "pothole 0.83");
  EXPECT_EQ(MarkLabel("pothole", 7), "pothole 1.00");
}

}  // namespace
}  // namespace livemap::imaging
