#include "imaging/camera_device.h"

#include <gmock/gmock.h>

#include <deque>
#include <opencv2/imgcodecs.hpp>

#include "common/error.h"

namespace livemap::imaging {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A camera that plays recorded MJPEG and can be unplugged.
class RecordedCamera : public CameraDevice {
 public:
  explicit RecordedCamera(const bool& plugged) : plugged_(plugged) {}

  void Open() override {
    if (!plugged_) throw Error("the camera device 'recorded' is not there");
    ++opened_;
  }

  std::optional<DevicePicture> Read() override {
    if (!plugged_) return std::nullopt;
    DevicePicture picture;
    cv::imencode(".jpg", cv::Mat(40, 64, CV_8UC3, cv::Scalar(opened_, 0, 0)), picture.encoded);
    picture.age_s = 0.02;
    return picture;
  }

 private:
  const bool& plugged_;
  int opened_ = 0;
};

TEST(CameraDevice, PassesItsJpegFilesOnAsTheyAreWithTheirAge) {
  const bool plugged = true;
  const auto source = MakeDeviceSource(std::make_unique<RecordedCamera>(plugged));
  const auto frame = source->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(cv::imdecode(frame->encoded, cv::IMREAD_COLOR).size(), cv::Size(64, 40));
  EXPECT_TRUE(frame->image.empty());
  EXPECT_DOUBLE_EQ(frame->age_s, 0.02);
  EXPECT_EQ(source->Next()->name, "1");
}

TEST(CameraDevice, ThatIsUnpluggedGivesNothingAndGoesOnWhenItIsBack) {
  bool plugged = true;
  const auto source = MakeDeviceSource(std::make_unique<RecordedCamera>(plugged));
  EXPECT_TRUE(source->Next());
  plugged = false;
  EXPECT_FALSE(source->Next());
  EXPECT_THAT([&] { source->Rewind(); }, ThrowsMessage<Error>(HasSubstr("is not there")));
  EXPECT_THAT([&] { source->Next(); }, ThrowsMessage<Error>(HasSubstr("is not there")));
  plugged = true;
  const auto frame = source->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->name, "1") << "frames are counted on";
}

TEST(CameraDevice, NeedNotBeThereAtFirst) {
  const auto source = OpenDevice("/dev/video987", {});
  EXPECT_THAT([&] { source->Next(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("/dev/video987"), HasSubstr("is not there"))));
}

TEST(CameraDevice, OfAnotherNameIsRefused) {
  for (const char* name : {"", "/dev/sda", "video0", "/dev/video", "/dev/video0/..", "12345"}) {
    EXPECT_THAT([&] { OpenDevice(name, {}); },
                ThrowsMessage<Error>(HasSubstr("accepted is /dev/videoN or N")))
        << name;
  }
}

}  // namespace
}  // namespace livemap::imaging
