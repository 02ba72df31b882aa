#include "tools/odometry/sequence_pictures.h"

#include "datasets/image_file.h"

namespace livemap::tools {

cv::Mat ReadColourPicture(const std::string& path, const geo::CameraIntrinsics& camera) {
  return datasets::ReadPictureFile(path, camera.width, camera.height,
                                   imaging::DecodeConfig::Pixels::kColour);
}

cv::Mat ReadDepthPicture(const std::string& path, const geo::CameraIntrinsics& camera) {
  return datasets::ReadDepthFile(path, camera.width, camera.height);
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
