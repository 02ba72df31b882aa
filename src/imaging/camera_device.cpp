#include "imaging/camera_device.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <opencv2/videoio.hpp>

#include "common/error.h"

namespace livemap::imaging {
namespace {

/// An older picture is of another clock than the monotonic one.
constexpr double kMostAgeS = 1.0;
/// Of V4L2_CID_EXPOSURE_AUTO.
constexpr int kManualExposure = 1, kAutomaticExposure = 3;
/// V4L2_CID_EXPOSURE_ABSOLUTE counts in 100 us.
constexpr double kExposureStepsPerMs = 10;

double MonotonicMs() {
  // What video drivers stamp buffers with.
  return std::chrono::duration<double, std::milli>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::string SizeText(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

class V4l2Device : public CameraDevice {
 public:
  V4l2Device(std::string path, const DeviceConfig& config)
      : path_(std::move(path)), config_(config) {}

  void Open() override {
    if (access(path_.c_str(), F_OK) != 0) Fail("is not there");
    if (access(path_.c_str(), R_OK | W_OK) != 0) {
      Fail("may not be read by this user, who must be in the group 'video'");
    }
    if (!capture_.open(path_, cv::CAP_V4L2)) Fail("cannot be opened: in use, or no camera");
    Set();
    CheckSize();
  }

  std::optional<DevicePicture> Read() override {
    cv::Mat taken;
    if (!capture_.isOpened() || !capture_.read(taken) || taken.empty()) return std::nullopt;
    DevicePicture picture;
    const double age_s = (MonotonicMs() - capture_.get(cv::CAP_PROP_POS_MSEC)) / 1000;
    if (age_s >= 0 && age_s <= kMostAgeS) picture.age_s = age_s;
    if (encoded_) {
      if (!taken.isContinuous() || taken.type() != CV_8UC1) return std::nullopt;
      picture.encoded.assign(taken.data, taken.data + taken.total());
    } else {
      picture.image = taken.clone();  // The capture reuses its buffer.
    }
    return picture;
  }

 private:
  [[noreturn]] void Fail(const std::string& reason) {
    capture_.release();
    throw Error("the camera device '" + path_ + "' " + reason);
  }

  /// What the driver does not take it leaves as it is; the size alone is checked after it.
  void Set() {
    if (config_.format != DeviceFormat::kAny) {
      capture_.set(cv::CAP_PROP_FOURCC, config_.format == DeviceFormat::kMjpeg
                                            ? cv::VideoWriter::fourcc('M', 'J', 'P', 'G')
                                            : cv::VideoWriter::fourcc('Y', 'U', 'Y', 'V'));
    }
    if (config_.width > 0) capture_.set(cv::CAP_PROP_FRAME_WIDTH, config_.width);
    if (config_.height > 0) capture_.set(cv::CAP_PROP_FRAME_HEIGHT, config_.height);
    if (config_.rate_hz > 0) capture_.set(cv::CAP_PROP_FPS, config_.rate_hz);
    capture_.set(cv::CAP_PROP_AUTO_EXPOSURE,
                 config_.exposure_ms > 0 ? kManualExposure : kAutomaticExposure);
    if (config_.exposure_ms > 0) {
      capture_.set(cv::CAP_PROP_EXPOSURE, std::round(config_.exposure_ms * kExposureStepsPerMs));
    }
    const int format = static_cast<int>(capture_.get(cv::CAP_PROP_FOURCC));
    encoded_ = format == cv::VideoWriter::fourcc('M', 'J', 'P', 'G') ||
               format == cv::VideoWriter::fourcc('J', 'P', 'E', 'G');
    // JPEG files are passed on as they are: whoever takes them decodes beside the reading thread.
    capture_.set(cv::CAP_PROP_CONVERT_RGB, encoded_ ? 0 : 1);
  }

  void CheckSize() {
    const int width = static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_WIDTH));
    const int height = static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_HEIGHT));
    if ((config_.width == 0 || width == config_.width) &&
        (config_.height == 0 || height == config_.height)) {
      return;
    }
    Fail("gives pictures of " + SizeText(width, height) + ", asked for were " +
         SizeText(config_.width, config_.height));
  }

  const std::string path_;
  const DeviceConfig config_;
  cv::VideoCapture capture_;
  bool encoded_ = false;
};

class DeviceFrameSource : public FrameSource {
 public:
  explicit DeviceFrameSource(std::unique_ptr<CameraDevice> device) : device_(std::move(device)) {}

  std::optional<SourceFrame> Next() override {
    if (!open_) Rewind();
    std::optional<DevicePicture> picture = device_->Read();
    open_ = picture.has_value();
    if (!picture) return std::nullopt;
    SourceFrame frame;
    frame.encoded = std::move(picture->encoded);
    frame.image = picture->image;
    frame.age_s = picture->age_s;
    frame.name = std::to_string(number_++);
    return frame;
  }

  void Rewind() override {
    open_ = false;
    device_->Open();
    open_ = true;
  }

 private:
  const std::unique_ptr<CameraDevice> device_;
  bool open_ = false;
  std::uint64_t number_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> MakeDeviceSource(std::unique_ptr<CameraDevice> device) {
  return std::make_unique<DeviceFrameSource>(std::move(device));
}

std::unique_ptr<FrameSource> OpenDevice(const std::string& device, const DeviceConfig& config) {
  const std::string prefix = "/dev/video";
  const std::string number =
      device.compare(0, prefix.size(), prefix) == 0 ? device.substr(prefix.size()) : device;
  const bool all_digits = !number.empty() && number.size() <= 3 &&
                          std::all_of(number.begin(), number.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
  if (!all_digits) {
    throw Error("the camera device is '" + device + "', accepted is /dev/videoN or N");
  }
  return MakeDeviceSource(std::make_unique<V4l2Device>(prefix + number, config));
}

}  // namespace livemap::imaging
