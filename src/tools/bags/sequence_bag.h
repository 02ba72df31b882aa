#pragma once

#include <ros/time.h>

#include <string>

#include "datasets/sequences.h"

namespace livemap::tools {

/// Writes a recorded sequence: camera/image_raw, camera/camera_info, with depth
/// camera/depth/image_raw (32FC1 metres) and camera/depth/camera_info, with a right camera
/// camera_right/image_raw and camera_right/camera_info (the left one's frame_id, P[3] = -fx
/// baseline, as image_geometry wants a pair), with poses ground_truth/pose (frame world) and the
/// transform world -> camera_optical_frame on tf. `start` is added to the sequence's stamps. Throws
/// Error naming a picture that is missing, corrupt or of another size.
void WriteSequenceBag(const datasets::Sequence& sequence, const std::string& path,
                      const ros::Duration& start);

}  // namespace livemap::tools
