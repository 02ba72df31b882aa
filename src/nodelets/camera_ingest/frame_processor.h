#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <cstdint>
#include <memory>

#include "common/error.h"
#include "imaging/rectifier.h"

namespace livemap::nodelets {

/// A frame as it came in; exactly one pointer is set.
struct IngestFrame {
  sensor_msgs::ImageConstPtr raw;
  sensor_msgs::CompressedImageConstPtr compressed;

  const std_msgs::Header& header() const { return raw ? raw->header : compressed->header; }
};

/// An image is not of the size that its calibration is for.
class SizeMismatch : public Error {
 public:
  using Error::Error;
};

struct ProcessedFrame {
  sensor_msgs::ImageConstPtr image;  ///< The incoming pointer itself when nothing had to change.
  sensor_msgs::CameraInfoConstPtr info;
};

/// Checks, decodes, rectifies and resizes one frame after the other. Not thread-safe.
class FrameProcessor {
 public:
  FrameProcessor(imaging::OutputSize output_size, std::int64_t max_pixels)
      : output_size_(output_size), max_pixels_(max_pixels) {}

  /// Throws Error saying what is wrong with the frame or its calibration: SizeMismatch where both
  /// are valid and do not belong together.
  ProcessedFrame Process(const IngestFrame& frame, const sensor_msgs::CameraInfoConstPtr& info);

 private:
  const imaging::Rectifier& RectifierFor(const sensor_msgs::CameraInfo& info);

  const imaging::OutputSize output_size_;
  const std::int64_t max_pixels_;
  std::unique_ptr<imaging::Rectifier> rectifier_;
};

}  // namespace livemap::nodelets
