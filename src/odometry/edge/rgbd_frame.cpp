#include "odometry/edge/rgbd_frame.h"

#include <cmath>
#include <string>

#include "common/error.h"
#include "common/text.h"

namespace livemap::odometry {
namespace {

std::string FrameSizeText(const cv::Mat& image) {
  return std::to_string(image.cols) + "x" + std::to_string(image.rows);
}

}  // namespace

const geo::CameraIntrinsics& CheckedCamera(const geo::CameraIntrinsics& camera) {
  const bool finite = std::isfinite(camera.fx) && std::isfinite(camera.fy) &&
                      std::isfinite(camera.cx) && std::isfinite(camera.cy);
  if (!finite || camera.fx <= 0 || camera.fy <= 0) {
    throw Error("the camera has no usable calibration: focal lengths and principal point are fx " +
                std::to_string(camera.fx) + ", fy " + std::to_string(camera.fy) + ", cx " +
                std::to_string(camera.cx) + ", cy " + std::to_string(camera.cy));
  }
  if (camera.width < 32 || camera.height < 32 || camera.width > 8192 || camera.height > 8192) {
    throw Error("the camera's image size is " + std::to_string(camera.width) + "x" +
                std::to_string(camera.height) + "; accepted are 32x32 to 8192x8192");
  }
  return camera;
}

void CheckPictures(const RgbdFrame& frame, const geo::CameraIntrinsics& camera) {
  const cv::Size wanted(camera.width, camera.height);
  if (frame.grey.type() != CV_8UC1 || frame.grey.size() != wanted) {
    throw Error("an image of " + FrameSizeText(frame.grey) + " came for a camera of " +
                std::to_string(wanted.width) + "x" + std::to_string(wanted.height) +
                "; 8-bit grey images of that size are accepted");
  }
  if (!frame.depth.empty()) {
    if (frame.depth.size() != wanted) {
      throw Error("a depth image of " + FrameSizeText(frame.depth) + " came with an image of " +
                  FrameSizeText(frame.grey) + "; both must have one size");
    }
    if (frame.depth.type() != CV_16UC1 && frame.depth.type() != CV_32FC1) {
      throw Error("a depth image has " +
                  PixelText(static_cast<int>(8 * frame.depth.elemSize1()), frame.depth.channels()) +
                  "; accepted are 16 bits (16UC1) and 32 bits (32FC1), one channel");
    }
    if (!(frame.depth_units_per_m > 0) || !std::isfinite(frame.depth_units_per_m)) {
      throw Error("the depth's units per metre are " + std::to_string(frame.depth_units_per_m) +
                  "; a positive number is accepted");
    }
  }
}

}  // namespace livemap::odometry
