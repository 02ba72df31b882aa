#include "perception/privacy/network_answer.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "common/error.h"
#include "perception/privacy/face_network.h"
#include "perception/privacy/plate_network.h"
#include "perception/privacy/road_user_network.h"

namespace livemap::perception {
namespace {

constexpr float kAnswerNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kLarge = std::numeric_limits<float>::max();

struct FaceAnswer {
  // UltraFace's for an input of 320 x 240.
  cv::Mat boxes = cv::Mat(4420, 4, CV_32F, cv::Scalar(0));
  cv::Mat scores = cv::Mat(4420, 2, CV_32F, cv::Scalar(0));

  void Put(int row, const cv::Vec4f& corners, float score) {
    for (int i = 0; i < 4; ++i) boxes.at<float>(row, i) = corners[i];
    scores.at<float>(row, 1) = score;
  }
  std::vector<ScoredBox> Decode(double scale = 0.5) const {
    return DecodeFaces(boxes, scores, {320, 240}, scale, 0.6F);
  }
};

TEST(FaceAnswer, ABoxInSharesOfTheInputIsABoxInPixelsOfThePicture) {
  FaceAnswer answer;
  answer.Put(100, {0.5F, 0.25F, 0.75F, 0.5F}, 0.9F);
  answer.Put(101, {0.51F, 0.25F, 0.75F, 0.5F}, 0.7F);
  answer.Put(4419, {0.1F, 0.1F, 0.2F, 0.2F}, 0.61F);
  answer.Put(5, {0.1F, 0.7F, 0.2F, 0.8F}, 0.59F);
  const std::vector<ScoredBox> faces = answer.Decode();
  ASSERT_EQ(faces.size(), 2U) << "one is the same face, one too weak";
  EXPECT_EQ(faces[0].box, cv::Rect2f(320, 120, 160, 120));
  EXPECT_FLOAT_EQ(faces[0].score, 0.9F);
  EXPECT_FLOAT_EQ(faces[1].score, 0.61F);
}

TEST(FaceAnswer, NonsenseIsNotTakenForAPictureWithoutFaces) {
  FaceAnswer good;
  EXPECT_TRUE(good.Decode().empty());
  for (const float nonsense : {kAnswerNan, -0.5F, 1.5F}) {
    FaceAnswer answer;
    answer.scores.at<float>(17, 1) = nonsense;
    EXPECT_THROW(answer.Decode(), Error) << nonsense;
  }
  FaceAnswer answer;
  answer.boxes.at<float>(17, 2) = kAnswerNan;
  EXPECT_THROW(answer.Decode(), Error) << "though its score is 0";
  answer = FaceAnswer();
  answer.Put(3, {-kLarge, 0, kLarge, 1}, 0.9F);
  EXPECT_THROW(answer.Decode(), Error) << "too wide for a number";
  EXPECT_THROW(DecodeFaces(good.boxes, good.boxes, {320, 240}, 1, 0.6F), Error);
  EXPECT_THROW(DecodeFaces(good.boxes, good.scores, {640, 480}, 1, 0.6F), Error);
  cv::Mat doubles;
  good.scores.convertTo(doubles, CV_64F);
  EXPECT_THROW(DecodeFaces(good.boxes, doubles, {320, 240}, 1, 0.6F), Error);
}

struct PlateAnswer {
  // LPD-YuNet's for an input of 320 x 240.
  cv::Mat conf = cv::Mat(4385, 2, CV_32F, cv::Scalar(0));
  cv::Mat iou = cv::Mat(4385, 1, CV_32F, cv::Scalar(1));
  cv::Mat loc = cv::Mat(4385, 14, CV_32F, cv::Scalar(0));

  std::vector<ScoredBox> Decode() const {
    return DecodePlates(conf, iou, loc, {320, 240}, 0.5, 0.6F);
  }
};

TEST(PlateAnswer, TheAnchorsAreThoseOfTheFourLevels) {
  const std::vector<cv::Point3f> anchors = PlateAnchors({320, 240});
  ASSERT_EQ(anchors.size(), 4385U);
  EXPECT_EQ(anchors[0], cv::Point3f(4, 4, 10));
  EXPECT_EQ(anchors[1], cv::Point3f(4, 4, 16));
  EXPECT_EQ(anchors[3], cv::Point3f(12, 4, 10));
  EXPECT_EQ(anchors[3600], cv::Point3f(8, 8, 32));
  EXPECT_EQ(anchors[4384], cv::Point3f(4.5F * 64, 2.5F * 64, 256));
}

TEST(PlateAnswer, ThePlateIsTheBoxAroundItsFourCorners) {
  PlateAnswer answer;
  const int row = 3600;  // Centre (8, 8), side 32: an offset of 1 is 3.2 px of the input.
  answer.conf.at<float>(row, 1) = 0.9F;
  answer.iou.at<float>(row) = 0.9F;
  const float corners[] = {1, 1, 5, 2, 0, 0, 1, 3, 5, 4};  // The fifth pair is a centre.
  for (int i = 0; i < 10; ++i) answer.loc.at<float>(row, 4 + i) = corners[i];
  const std::vector<ScoredBox> plates = answer.Decode();
  ASSERT_EQ(plates.size(), 1U);
  EXPECT_NEAR(plates[0].score, 0.9, 1e-5);
  EXPECT_NEAR(plates[0].box.x, 2 * (8 + 3.2), 1e-3);
  EXPECT_NEAR(plates[0].box.y, 2 * (8 + 3.2), 1e-3);
  EXPECT_NEAR(plates[0].box.width, 2 * 4 * 3.2, 1e-3);
  EXPECT_NEAR(plates[0].box.height, 2 * 3 * 3.2, 1e-3);
}

TEST(PlateAnswer, NonsenseIsNotTakenForAPictureWithoutPlates) {
  EXPECT_TRUE(PlateAnswer().Decode().empty());
  PlateAnswer answer;
  answer.loc.at<float>(9, 0) = kAnswerNan;
  EXPECT_THROW(answer.Decode(), Error);
  answer = PlateAnswer();
  answer.iou.at<float>(9) = kAnswerNan;
  EXPECT_THROW(answer.Decode(), Error);
  answer = PlateAnswer();
  answer.conf.at<float>(9, 1) = 7;
  EXPECT_THROW(answer.Decode(), Error);
  answer = PlateAnswer();
  EXPECT_THROW(DecodePlates(answer.conf, answer.conf, answer.loc, {320, 240}, 1, 0.6F), Error);
  EXPECT_THROW(DecodePlates(answer.conf, answer.iou, answer.loc, {640, 480}, 1, 0.6F), Error);
}

class RoadUserAnswer : public ::testing::Test {
 protected:
  RoadUserAnswer() {
    PrivacyNetworks::Network network;
    network.input.width = 64;
    network.input.height = 64;
    network.normalisation.std = {1, 1, 1};
    network.found = 0.2F;
    manifest_ = RoadUserManifest(network);
    const int shape[] = {1, 84, 85};
    rows_ = cv::Mat(3, shape, CV_32F, cv::Scalar(0));
  }
  /// In the first cell of 32 px: 32 px wide and high.
  void Put(int object, float score) {
    float* row = rows_.ptr<float>() + 80 * 85;
    row[0] = row[1] = 0.5F;
    row[4] = 1;
    row[5 + object] = score;
  }
  RoadUsers Decode() const { return DecodeRoadUsers(rows_, manifest_, 0.5, {128, 128}); }

  ModelManifest manifest_;
  cv::Mat rows_;
};

TEST_F(RoadUserAnswer, PeopleAndVehiclesAreKeptAndAnimalsAreNot) {
  Put(0, 0.5F);   // A person,
  Put(16, 0.9F);  // a dog,
  Put(2, 0.5F);   // a car,
  Put(7, 0.6F);   // and a truck, which is the car.
  const RoadUsers users = Decode();
  ASSERT_EQ(users.people.size(), 1U);
  EXPECT_EQ(users.people[0], cv::Rect2f(0, 0, 64, 64));
  EXPECT_EQ(users.vehicles.size(), 1U);
}

TEST_F(RoadUserAnswer, NonsenseIsNotTakenForAnEmptyStreet) {
  EXPECT_TRUE(Decode().people.empty());
  rows_.ptr<float>()[3] = kAnswerNan;
  EXPECT_THROW(Decode(), Error) << "though its score is 0";
  EXPECT_THROW(DecodeRoadUsers(cv::Mat(84, 84, CV_32F, cv::Scalar(0)), manifest_, 1, {64, 64}),
               Error);
}

}  // namespace
}  // namespace livemap::perception
