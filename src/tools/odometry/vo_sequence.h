#pragma once

#include <string>

#include "datasets/sequences.h"

namespace livemap::tools {

/// A sequence in TUM's layout, or in KITTI's, which has a calib.txt. `camera_file` is as
/// ReadTumSequence takes it. Throws Error naming what is wrong, and when the folder is neither.
datasets::Sequence ReadVoSequence(const std::string& directory, const std::string& camera_file,
                                  datasets::DepthImages depth_images);

}  // namespace livemap::tools
