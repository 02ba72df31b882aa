#include "tools/odometry/sequence_pictures.h"

#include <opencv2/imgcodecs.hpp>

#include "datasets/image_file.h"

namespace livemap {

cv::Mat ReadPicture(const std::string& path, const CameraIntrinsics& camera, int flags) {
  const ImageFile file = ReadImageFile(path, camera.width, camera.height);
  return cv::imdecode(file.bytes, flags);
}

CameraIntrinsics IntrinsicsOf(const Sequence& sequence) {
  CameraIntrinsics camera = sequence.intrinsics;
  const ImageFile first = ReadImageFile(sequence.frames.front().image_path, 0, 0);
  if (camera.width == 0) camera.width = static_cast<int>(first.header.width);
  if (camera.height == 0) camera.height = static_cast<int>(first.header.height);
  return camera;
}

}  // namespace livemap
