#include "tools/odometry/sequence_pictures.h"

#include <opencv2/imgcodecs.hpp>

#include "datasets/image_file.h"

namespace livemap::tools {

cv::Mat ReadPicture(const std::string& path, const geo::CameraIntrinsics& camera, int flags) {
  const datasets::ImageFile file = datasets::ReadImageFile(path, camera.width, camera.height);
  return cv::imdecode(file.bytes, flags);
}

geo::CameraIntrinsics IntrinsicsOf(const datasets::Sequence& sequence) {
  geo::CameraIntrinsics camera = sequence.intrinsics;
  const datasets::ImageFile first =
      datasets::ReadImageFile(sequence.frames.front().image_path, 0, 0);
  if (camera.width == 0) camera.width = static_cast<int>(first.header.width);
  if (camera.height == 0) camera.height = static_cast<int>(first.header.height);
  return camera;
}

}  // namespace livemap::tools
