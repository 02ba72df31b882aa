#include "perception/inference/letterbox.h"

#include <gtest/gtest.h>

#include "common/error.h"
#include "test/perception/detection/synthetic_head.h"

namespace livemap::perception {
namespace {

float At(const cv::Mat& tensor, int plane, int row, int column) {
  return tensor.ptr<float>(0, plane)[row * tensor.size[3] + column];
}

TEST(Letterbox, AnImageOfTheInputsSizeIsOnlyNormalisedAndItsChannelsOrdered) {
  Letterbox letterbox(TwoLevelManifest());
  cv::Mat image(48, 64, CV_8UC3, cv::Scalar(0, 0, 0));
  image.at<cv::Vec3b>(7, 5) = {30, 40, 50};  // blue, green, red
  const cv::Mat& tensor = letterbox.Fill(image);
  EXPECT_EQ(tensor.size[2], 48);
  EXPECT_EQ(tensor.size[3], 64);
  EXPECT_FLOAT_EQ(At(tensor, 0, 7, 5), (50 - 10) / 1.0F);
  EXPECT_FLOAT_EQ(At(tensor, 1, 7, 5), (40 - 20) / 2.0F);
  EXPECT_FLOAT_EQ(At(tensor, 2, 7, 5), (30 - 30) / 4.0F);
  EXPECT_FLOAT_EQ(At(tensor, 0, 7, 6), -10);
}

TEST(Letterbox, BgrModelsGetBlueFirst) {
  ModelManifest manifest = TwoLevelManifest();
  manifest.input.channels = ChannelOrder::kBgr;
  Letterbox letterbox(manifest);
  const cv::Mat& tensor = letterbox.Fill(cv::Mat(48, 64, CV_8UC3, cv::Scalar(30, 40, 50)));
  EXPECT_FLOAT_EQ(At(tensor, 0, 0, 0), 20);
  EXPECT_FLOAT_EQ(At(tensor, 2, 0, 0), 5);
}

TEST(Letterbox, AWideImageIsPaddedBelowAndATallOneOnTheRight) {
  Letterbox letterbox(TwoLevelManifest());
  const cv::Mat wide(24, 64, CV_8UC3, cv::Scalar(0, 0, 200));
  const cv::Mat& tensor = letterbox.Fill(wide);
  EXPECT_FLOAT_EQ(At(tensor, 0, 23, 63), 190);
  EXPECT_FLOAT_EQ(At(tensor, 0, 24, 0), 104);
  const cv::Mat tall(96, 32, CV_8UC3, cv::Scalar(0, 0, 200));
  EXPECT_DOUBLE_EQ(letterbox.Scale(tall.size()), 0.5);
  letterbox.Fill(tall);
  EXPECT_FLOAT_EQ(At(tensor, 0, 47, 15), 190);
  EXPECT_FLOAT_EQ(At(tensor, 0, 47, 16), 104);
}

TEST(Letterbox, APartOfALargerImageIsReadByItsOwnRows) {
  Letterbox letterbox(TwoLevelManifest());
  cv::Mat whole(100, 100, CV_8UC3, cv::Scalar(0, 0, 0));
  const cv::Mat part = whole(cv::Rect(20, 30, 64, 48));
  cv::Mat(part).setTo(cv::Scalar(0, 0, 110));
  const cv::Mat& tensor = letterbox.Fill(part);
  EXPECT_FLOAT_EQ(At(tensor, 0, 0, 0), 100);
  EXPECT_FLOAT_EQ(At(tensor, 0, 47, 63), 100);
}

TEST(Letterbox, PixelsAreTheSamePictureBeforeItsNormalisation) {
  for (const ChannelOrder order : {ChannelOrder::kRgb, ChannelOrder::kBgr}) {
    ModelManifest manifest = TwoLevelManifest();
    manifest.input.channels = order;
    manifest.normalisation.mean = {0, 0, 0};
    manifest.normalisation.std = {1, 1, 1};
    Letterbox letterbox(manifest);
    const cv::Size fitting(manifest.input.width, manifest.input.height);
    for (const cv::Size size : {fitting, cv::Size(fitting.width * 2, fitting.height),
                                cv::Size(fitting.width, fitting.height * 3)}) {
      cv::Mat image(size, CV_8UC3);
      cv::randu(image, 0, 256);
      const cv::Mat expected = letterbox.Fill(image).clone();
      const cv::Mat pixels = letterbox.FillPixels(image);
      ASSERT_EQ(pixels.size(), fitting);
      ASSERT_EQ(pixels.type(), CV_8UC3);
      ASSERT_TRUE(pixels.isContinuous());
      for (int plane = 0; plane < 3; ++plane) {
        const cv::Mat floats(fitting, CV_32F, const_cast<float*>(expected.ptr<float>(0, plane)));
        cv::Mat channel;
        cv::extractChannel(pixels, channel, plane);
        channel.convertTo(channel, CV_32F);
        EXPECT_EQ(cv::norm(channel, floats, cv::NORM_INF), 0) << size << plane;
      }
    }
  }
}

TEST(Letterbox, ExtremeShapesGiveAtLeastOnePixel) {
  Letterbox letterbox(TwoLevelManifest());
  const cv::Mat& tensor = letterbox.Fill(cv::Mat(1, 30000, CV_8UC3, cv::Scalar(0, 0, 110)));
  EXPECT_FLOAT_EQ(At(tensor, 0, 0, 63), 100);
  EXPECT_FLOAT_EQ(At(tensor, 0, 1, 63), 104);
}

TEST(Letterbox, EmptyImagesAndOtherPixelTypesAreRefused) {
  Letterbox letterbox(TwoLevelManifest());
  EXPECT_THROW(letterbox.Fill(cv::Mat()), Error);
  EXPECT_THROW(letterbox.Fill(cv::Mat(0, 5, CV_8UC3)), Error);
  EXPECT_THROW(letterbox.Fill(cv::Mat(5, 5, CV_8UC1, cv::Scalar(0))), Error);
  EXPECT_THROW(letterbox.Fill(cv::Mat(5, 5, CV_8UC4, cv::Scalar(0))), Error);
  EXPECT_THROW(letterbox.Fill(cv::Mat(5, 5, CV_32FC3, cv::Scalar(0))), Error);
}

}  // namespace
}  // namespace livemap::perception
