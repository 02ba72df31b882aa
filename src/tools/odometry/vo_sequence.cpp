#include "tools/odometry/vo_sequence.h"

#include <filesystem>

#include "common/error.h"

namespace livemap::tools {

datasets::Sequence ReadVoSequence(const std::string& directory, const std::string& camera_file,
                                  datasets::DepthImages depth_images) {
  constexpr double kKittiRateHz = 10;
  const std::filesystem::path root(directory);
  const auto has = [&root](const char* name) { return std::filesystem::exists(root / name); };
  if (has("calib.txt")) {
    if (!camera_file.empty()) {
      throw Error("--camera needs TUM's layout, and '" + directory + "' has a calib.txt");
    }
    return datasets::ReadKittiSequence(directory, kKittiRateHz);
  }
  if (std::filesystem::is_directory(root) && !has("rgb.txt") && !has("associations.txt")) {
    throw Error("'" + directory +
                "' is no sequence: TUM's have rgb.txt or associations.txt, KITTI's calib.txt");
  }
  return datasets::ReadTumSequence(directory, camera_file, depth_images);
}

}  // namespace livemap::tools
