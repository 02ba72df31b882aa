#include "nodelets/camera_ingest/frame_processor.h"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <boost/make_shared.hpp>
#include <functional>

#include "common/error.h"
#include "imaging/decode.h"
#include "imaging/orientation.h"
#include "ros/conversions/camera_info_conversions.h"

namespace livemap::nodelets {
namespace {

namespace encodings = sensor_msgs::image_encodings;

std::string Size(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

void CheckRaw(const sensor_msgs::Image& image, std::int64_t max_pixels) {
  if (image.width == 0 || image.height == 0) throw Error("the image is empty");
  const std::string size = Size(image.width, image.height);
  if (image.width > imaging::Rectifier::kMaxSide || image.height > imaging::Rectifier::kMaxSide ||
      static_cast<std::int64_t>(image.width) * image.height > max_pixels) {
    throw Error("the image is " + size + ", accepted are " + std::to_string(max_pixels) +
                " pixels and " + std::to_string(imaging::Rectifier::kMaxSide) + " per side");
  }
  int bits = 0;
  int channels = 0;
  try {
    bits = encodings::bitDepth(image.encoding);
    channels = encodings::numChannels(image.encoding);
  } catch (const std::runtime_error&) {
    throw Error("the image's encoding '" + image.encoding + "' is unknown");
  }
  const std::uint64_t row_bytes =
      static_cast<std::uint64_t>(image.width) * static_cast<std::uint64_t>(bits * channels / 8);
  const std::uint64_t needed = static_cast<std::uint64_t>(image.step) * image.height;
  if (image.step < row_bytes || image.data.size() < needed) {
    throw Error("the image of " + size + " " + image.encoding + " has rows of " +
                std::to_string(image.step) + " bytes and " + std::to_string(image.data.size()) +
                " bytes in all, too few");
  }
}

/// `orientation_of` reads the file again: it is asked only where the size does not fit.
void CheckSize(std::int64_t width, std::int64_t height,
               const imaging::CameraCalibration& calibration,
               const std::function<int()>& orientation_of) {
  if (width == calibration.width && height == calibration.height) return;
  const int orientation = orientation_of();
  throw SizeMismatch(
      "the image is " + Size(width, height) +
      (orientation == imaging::kUpright
           ? ""
           : " after turning it as its EXIF orientation " + std::to_string(orientation) + " says") +
      " but its calibration is for " + Size(calibration.width, calibration.height));
}

bool NeedsConversion(const std::string& encoding) {
  return encodings::isBayer(encoding) || encoding == encodings::YUV422;
}

}  // namespace

const imaging::Rectifier& FrameProcessor::RectifierFor(const sensor_msgs::CameraInfo& info) {
  const imaging::CameraCalibration calibration = ros_io::FromMessage(info);
  if (!rectifier_ || rectifier_->input() != calibration) {
    rectifier_ = std::make_unique<imaging::Rectifier>(calibration, output_size_);
  }
  return *rectifier_;
}

ProcessedFrame FrameProcessor::Process(const IngestFrame& frame,
                                       const sensor_msgs::CameraInfoConstPtr& info) {
  const imaging::Rectifier& rectifier = RectifierFor(*info);
  ProcessedFrame result;
  cv_bridge::CvImage rectified;
  rectified.header = frame.header();
  if (frame.raw) {
    CheckRaw(*frame.raw, max_pixels_);
    CheckSize(frame.raw->width, frame.raw->height, rectifier.input(),
              [] { return imaging::kUpright; });
    if (rectifier.is_identity()) {
      result.image = frame.raw;
    } else {
      const cv_bridge::CvImageConstPtr shared = cv_bridge::toCvShare(
          frame.raw, NeedsConversion(frame.raw->encoding) ? encodings::BGR8 : "");
      rectified.encoding = shared->encoding;
      rectified.image = rectifier.Apply(shared->image);
    }
  } else {
    const cv::Mat decoded = imaging::DecodeImage(frame.compressed->data.data(),
                                                 frame.compressed->data.size(), max_pixels_);
    CheckSize(decoded.cols, decoded.rows, rectifier.input(), [&frame] {
      return imaging::ReadOrientation(frame.compressed->data.data(), frame.compressed->data.size());
    });
    rectified.encoding = decoded.channels() == 1 ? encodings::MONO8 : encodings::BGR8;
    rectified.image = rectifier.Apply(decoded);
  }
  if (!result.image) result.image = rectified.toImageMsg();
  result.info = boost::make_shared<sensor_msgs::CameraInfo>(
      ros_io::ToMessage(rectifier.output(), frame.header()));
  return result;
}

}  // namespace livemap::nodelets
