#include "perception/detection/annotation.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "common/error.h"

namespace livemap::perception {
namespace {

int ChangedPixels(const cv::Mat& before, const cv::Mat& after) {
  cv::Mat difference;
  cv::absdiff(before, after, difference);
  return cv::countNonZero(difference.reshape(1));
}

TEST(AnnotateImage, DrawsFrameAndLabelAndLeavesTheInsideVisible) {
  const cv::Mat before(400, 640, CV_8UC3, cv::Scalar(90, 90, 90));
  cv::Mat after = before.clone();
  AnnotateImage(after, {{"pothole", 0, 0.83F, {300, 200, 80, 60}}});
  EXPECT_NE(after.at<cv::Vec3b>(230, 300), before.at<cv::Vec3b>(230, 300)) << "left edge";
  EXPECT_EQ(after.at<cv::Vec3b>(230, 340), before.at<cv::Vec3b>(230, 340)) << "inside";
  EXPECT_GT(ChangedPixels(before(cv::Rect(300, 170, 100, 28)), after(cv::Rect(300, 170, 100, 28))),
            500)
      << "label above the frame";
}

TEST(AnnotateImage, NoLabelHidesTheFrameOfAnotherHazard) {
  const HazardDetection below{"pothole", 0, 0.5F, {100, 100, 40, 20}};
  const HazardDetection above{
      "traffic_cone", 1, 0.9F, {100, 118, 40, 20}};  // its label: on `below`
  cv::Mat both(300, 400, CV_8UC3, cv::Scalar::all(128));
  AnnotateImage(both, {above, below});
  cv::Mat alone(300, 400, CV_8UC3, cv::Scalar::all(128));
  AnnotateImage(alone, {below});
  EXPECT_EQ(both.at<cv::Vec3b>(105, 139), alone.at<cv::Vec3b>(105, 139));
  EXPECT_NE(both.at<cv::Vec3b>(105, 139), cv::Vec3b(128, 128, 128));
}

TEST(AnnotateImage, NothingDetectedChangesNothing) {
  const cv::Mat before(40, 64, CV_8UC3, cv::Scalar(90, 90, 90));
  cv::Mat after = before.clone();
  AnnotateImage(after, {});
  EXPECT_EQ(ChangedPixels(before, after), 0);
}

TEST(AnnotateImage, LabelsAtEveryEdgeStayInTheImage) {
  for (const cv::Rect2f& box : {cv::Rect2f(0, 0, 20, 10), cv::Rect2f(620, 0, 20, 10),
                                cv::Rect2f(0, 390, 20, 10), cv::Rect2f(620, 390, 20, 10)}) {
    const cv::Mat before(400, 640, CV_8UC3, cv::Scalar(90, 90, 90));
    cv::Mat after = before.clone();
    AnnotateImage(after, {{"traffic_cone", 1, 0.5F, box}});
    EXPECT_GT(ChangedPixels(before, after), 2500) << box << ": the whole plate is visible";
  }
}

TEST(AnnotateImage, TinyImagesAndOddNamesAreDrawnWithoutFault) {
  cv::Mat tiny(3, 2, CV_8UC3, cv::Scalar(90, 90, 90));
  AnnotateImage(tiny, {{"<b>\xff\n\xc3\xa4" + std::string(500, 'x'), 1000, 0.5F, {0, 0, 2, 3}}});
  EXPECT_EQ(tiny.size(), cv::Size(2, 3));
}

TEST(AnnotateImage, EmptyAndGreyImagesAreRefused) {
  cv::Mat empty;
  cv::Mat grey(4, 4, CV_8UC1, cv::Scalar(0));
  EXPECT_THROW(AnnotateImage(empty, {}), Error);
  EXPECT_THROW(AnnotateImage(grey, {}), Error);
}

}  // namespace
}  // namespace livemap::perception
