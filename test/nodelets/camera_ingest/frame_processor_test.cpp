#include "nodelets/camera_ingest/frame_processor.h"

#include <gmock/gmock.h>
#include <sensor_msgs/distortion_models.h>

#include <boost/make_shared.hpp>

#include "common/error.h"
#include "test/support/oriented_jpeg.h"

namespace livemap::nodelets {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

sensor_msgs::CameraInfoConstPtr Calibration(std::uint32_t width, std::uint32_t height) {
  auto info = boost::make_shared<sensor_msgs::CameraInfo>();
  info->width = width;
  info->height = height;
  info->distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  info->D = {0, 0, 0, 0, 0};
  info->K = {60, 0, width / 2.0, 0, 60, height / 2.0, 0, 0, 1};
  info->R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info->P = {60, 0, width / 2.0, 0, 0, 60, height / 2.0, 0, 0, 0, 1, 0};
  return info;
}

/// 64x48, the left half red and the right one blue, as a camera sends it.
IngestFrame Frame(int orientation) {
  cv::Mat image(48, 64, CV_8UC3, cv::Scalar(0, 0, 255));
  image.colRange(32, 64) = cv::Scalar(255, 0, 0);
  auto compressed = boost::make_shared<sensor_msgs::CompressedImage>();
  compressed->data = test::OrientedJpeg(image, orientation);
  return {nullptr, compressed};
}

TEST(FrameProcessor, TurnsAnImageAsItsExifSaysAndWantsTheUprightSizesCalibration) {
  FrameProcessor processor({0, 0}, 1000000);
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const bool turned = orientation >= 5;
    const std::uint32_t width = turned ? 48 : 64;
    const std::uint32_t height = turned ? 64 : 48;
    const ProcessedFrame upright =
        processor.Process(Frame(orientation), Calibration(width, height));
    EXPECT_EQ(upright.image->width, width) << orientation;
    EXPECT_EQ(upright.image->height, height) << orientation;
    if (!turned) continue;
    EXPECT_THAT([&] { processor.Process(Frame(orientation), Calibration(height, width)); },
                ThrowsMessage<Error>(AllOf(HasSubstr("the image is 48x64 after turning it"),
                                           HasSubstr("EXIF orientation"),
                                           HasSubstr("its calibration is for 64x48"))));
  }
  // Turned clockwise, what was left is above.
  const ProcessedFrame clockwise = processor.Process(Frame(6), Calibration(48, 64));
  EXPECT_GT(clockwise.image->data[(8 * 48 + 24) * 3 + 2], 200);
  EXPECT_GT(clockwise.image->data[(56 * 48 + 24) * 3], 200);
}

}  // namespace
}  // namespace livemap::nodelets
