#include "nodelets/hazard_reporting/picture_maker.h"

#include <gmock/gmock.h>
#include <ros/time.h>

#include <cmath>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "test/perception/privacy/drawn_people.h"

namespace livemap::nodelets {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

const cv::Rect kEyes(290, 180, 60, 30);

/// A street with grain and a face of 100 pixels around (320, 200).
cv::Mat StreetWithFace() {
  cv::Mat street(400, 640, CV_8UC3);
  cv::RNG random(7);
  random.fill(street, cv::RNG::NORMAL, 120, 6);
  perception::DrawFace(street, {320, 205}, 100);
  cv::GaussianBlur(street, street, {}, 1.5);
  return street;
}

/// An order of one picture about `subject`, of a street with a face.
vehicle::PictureOrder About(const imaging::Box& subject) {
  vehicle::PictureOrder order;
  order.image.picture.bgr = StreetWithFace();
  imaging::CropConfig crop;
  crop.max_bytes = 1'000'000;
  crop.quality = 95;
  order.cuts.push_back({subject, crop, ""});
  return order;
}

/// The likeness of a part of the camera's image to the same part of the picture, at most 1.
double Likeness(const vehicle::PictureOrder& order, const imaging::CroppedPicture& picture,
                const cv::Rect& part) {
  cv::Mat shown = cv::imdecode(picture.jpeg, cv::IMREAD_COLOR);
  const cv::Point offset(static_cast<int>(picture.shown.x), static_cast<int>(picture.shown.y));
  cv::Mat score;
  cv::matchTemplate(shown(part - offset), order.image.picture.bgr(part), score,
                    cv::TM_CCOEFF_NORMED);
  return score.at<float>(0, 0);
}

TEST(PictureMaker, AFaceBesideTheHazardIsMaskedAndTheCamerasImageStaysAsItIs) {
  PictureMaker maker(perception::PictureMasker::Config{}, "test");
  const vehicle::PictureOrder order = About({200, 200, 260, 240});
  const cv::Mat before = order.image.picture.bgr.clone();
  const auto pictures = maker.Make(order);
  ASSERT_THAT(pictures, SizeIs(1));
  EXPECT_LT(Likeness(order, pictures[0], kEyes), 0.8);
  EXPECT_EQ(cv::norm(before, order.image.picture.bgr, cv::NORM_INF), 0);
  EXPECT_GE(maker.counters().masked_regions, 1u);
}

TEST(PictureMaker, AClearFaceOnTheHazardIsMaskedToo) {
  PictureMaker maker(perception::PictureMasker::Config{}, "test");
  const vehicle::PictureOrder order = About({240, 130, 400, 280});
  EXPECT_LT(Likeness(order, maker.Make(order).at(0), kEyes), 0.8);
}

TEST(PictureMaker, WithoutPrivacyTheFaceIsSeenAndTheCamerasImageStaysAsItIs) {
  perception::PictureMasker::Config config;
  config.privacy = false;
  PictureMaker maker(config, "test");
  vehicle::PictureOrder order = About({200, 200, 260, 240});
  order.image.sightings = {{"x", 0.8F, {200, 200, 260, 240}}};
  const cv::Mat before = order.image.picture.bgr.clone();
  EXPECT_GT(Likeness(order, maker.Make(order).at(0), kEyes), 0.8);
  EXPECT_EQ(cv::norm(before, order.image.picture.bgr, cv::NORM_INF), 0) << "others look at it";
}

TEST(PictureMaker, TheSubjectsBoxIsLoudAndAnotherHazardsFaint) {
  PictureMaker maker(perception::PictureMasker::Config{}, "test");
  vehicle::PictureOrder order = About({200, 200, 260, 240});
  order.image.picture.bgr = cv::Mat(400, 640, CV_8UC3, cv::Scalar::all(120));
  order.image.sightings = {{"pothole", 0.8F, {200, 200, 260, 240}},
                           {"debris", 0.9F, {300, 260, 360, 300}}};
  const imaging::CroppedPicture picture = maker.Make(order).at(0);
  const cv::Mat drawn = cv::imdecode(picture.jpeg, cv::IMREAD_COLOR);
  const auto at = [&](int x, int y) {
    return drawn.at<cv::Vec3b>(y - static_cast<int>(picture.shown.y),
                               x - static_cast<int>(picture.shown.x));
  };
  EXPECT_GT(at(200, 220)[2], at(200, 220)[0] + 60) << "red";
  EXPECT_LT(std::abs(at(300, 280)[2] - at(300, 280)[0]), 15) << "no colour";
  EXPECT_GT(at(300, 280)[1], 130) << "but seen";
}

TEST(PictureMaker, PicturesToTrainOnShowNoBoxes) {
  PictureMaker maker(perception::PictureMasker::Config{}, "test", false);
  vehicle::PictureOrder order = About({200, 200, 260, 240});
  order.image.picture.bgr = cv::Mat(400, 640, CV_8UC3, cv::Scalar::all(120));
  order.image.sightings = {{"pothole", 0.8F, {200, 200, 260, 240}}};
  const cv::Mat plain = cv::imdecode(maker.Make(order).at(0).jpeg, cv::IMREAD_COLOR);
  EXPECT_LE(cv::norm(plain - cv::Scalar::all(120), cv::NORM_INF), 1);
}

TEST(PictureMaker, AnImageThatCannotBeMaskedMakesNoPicture) {
  ros::Time::init();  // Of the log.
  PictureMaker maker(perception::PictureMasker::Config{}, "test");
  vehicle::PictureOrder order = About({200, 200, 260, 240});
  order.image.picture.bgr = cv::Mat(400, 640, CV_8UC1, cv::Scalar(9));
  EXPECT_THAT(maker.Make(order), IsEmpty());
  order.image.picture.bgr = cv::Mat();
  EXPECT_THAT(maker.Make(order), IsEmpty());
  EXPECT_EQ(maker.counters().withheld, 2u);
}

TEST(PictureMaker, BoxesOfAnySizeMakePictures) {
  PictureMaker maker(perception::PictureMasker::Config{}, "test");
  for (const imaging::Box& box :
       {imaging::Box{-1e30F, -1e30F, 1e30F, 1e30F}, imaging::Box{639.5F, 399.5F, 1e9F, 1e9F},
        imaging::Box{}, imaging::Box{std::nanf(""), 0, std::nanf(""), 9}}) {
    vehicle::PictureOrder order = About(box);
    order.image.sightings = {{"pothole", 0.8F, box}};
    EXPECT_FALSE(maker.Make(order).at(0).jpeg.empty()) << box.x_min;
  }
}

TEST(PictureMaker, WithoutDetectorsThereIsNone) {
  perception::PictureMasker::Config config;
  config.mask.regions.cascades = "/nowhere";
  EXPECT_THROW(PictureMaker(config, "test"), Error);
}

}  // namespace
}  // namespace livemap::nodelets
