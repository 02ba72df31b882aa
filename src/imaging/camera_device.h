#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "imaging/frame_source.h"

namespace livemap::imaging {

/// How a camera sends its pictures.
enum class DeviceFormat {
  kMjpeg,  ///< As JPEG files: the only one that gives 30 large pictures a second over USB 2.
  kYuyv,   ///< Uncompressed, 2 bytes per pixel.
  kAny,    ///< As the device is set.
};

/// How a V4L2 camera is asked to work.
struct DeviceConfig {
  int width = 0;   ///< Pixels; 0: as the device is set.
  int height = 0;  ///< Pixels; 0: as the device is set.
  double rate_hz = 0;
  DeviceFormat format = DeviceFormat::kMjpeg;
  double exposure_ms = 0;  ///< 0: the camera chooses. Long ones blur what a moving car sees.
};

/// One picture of a camera.
struct DevicePicture {
  std::vector<std::uint8_t> encoded;  ///< A whole JPEG; empty when `image` is set.
  cv::Mat image;                      ///< CV_8UC3 (BGR).
  double age_s = 0;                   ///< Since it was taken, by the driver's clock; 0: unknown.
};

/// A camera as the kernel shows it. Not thread-safe.
class CameraDevice {
 public:
  virtual ~CameraDevice() = default;
  /// Opens it, anew where it is open already. Throws Error that says why it cannot be opened, or
  /// what it gives instead of what was asked for.
  virtual void Open() = 0;
  /// Waits for the next picture. None when it gives nothing any more, as after unplugging.
  virtual std::optional<DevicePicture> Read() = 0;
};

/// The frames of a camera that may be unplugged and come back. It need not be there at first: a
/// Next() that cannot open it throws Error, and a later one tries again.
///
/// Typical usage:
///   const auto source = OpenDevice("/dev/video0", {1280, 720, 30});
///   while (const auto frame = source->Next()) Use(*frame);
std::unique_ptr<FrameSource> MakeDeviceSource(std::unique_ptr<CameraDevice> device);

/// The V4L2 device "/dev/videoN" or "N" through cv::VideoCapture. Throws Error when it has another
/// name.
std::unique_ptr<FrameSource> OpenDevice(const std::string& device, const DeviceConfig& config);

}  // namespace livemap::imaging
