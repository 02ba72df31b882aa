#include "tools/odometry/stereo_source.h"

#include <algorithm>
#include <chrono>

#include "common/error.h"
#include "tools/odometry/sequence_pictures.h"

namespace livemap::tools {
namespace {

/// A rectified camera, `right_m` beside the left one.
imaging::CameraCalibration StereoCamera(const geo::CameraIntrinsics& k, double right_m) {
  imaging::CameraCalibration camera;
  camera.width = k.width;
  camera.height = k.height;
  camera.k = {k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1};
  camera.p = {k.fx, 0, k.cx, -k.fx * right_m, 0, k.fy, k.cy, 0, 0, 0, 1, 0};
  return camera;
}

imaging::StereoDepth MakeStereoOfSequence(const datasets::Sequence& sequence,
                                          const geo::CameraIntrinsics& intrinsics,
                                          const imaging::StereoConfig& config) {
  const auto alone =
      std::find_if(sequence.frames.begin(), sequence.frames.end(),
                   [](const datasets::SequenceFrame& frame) { return frame.right_path.empty(); });
  if (alone == sequence.frames.begin()) {
    throw Error(
        "the sequence has no right camera: --stereo wants rgb_right.txt beside rgb.txt, or image_1 "
        "beside image_0");
  }
  if (alone != sequence.frames.end()) {
    throw Error("the picture '" + alone->image_path + "' has no right camera's beside it");
  }
  if (!(sequence.baseline_m > 0)) {
    throw Error(
        "the sequence has no baseline: --stereo wants baseline_m in camera.yaml, or P1 in "
        "calib.txt");
  }
  return {config, StereoCamera(intrinsics, 0), StereoCamera(intrinsics, sequence.baseline_m)};
}

}  // namespace

StereoSource::StereoSource(const datasets::Sequence& sequence,
                           const geo::CameraIntrinsics& intrinsics,
                           const imaging::StereoConfig& config)
    : stereo_(MakeStereoOfSequence(sequence, intrinsics, config)), intrinsics_(intrinsics) {}

cv::Mat StereoSource::Depth(const datasets::SequenceFrame& frame, const cv::Mat& left) {
  const cv::Mat right = ReadColourPicture(frame.right_path, intrinsics_);
  const auto start = std::chrono::steady_clock::now();
  cv::Mat depth = stereo_.Compute(left, right);
  milliseconds_ =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return depth;
}

}  // namespace livemap::tools
