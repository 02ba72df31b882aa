#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <std_msgs/Header.h>

#include "geo/camera_intrinsics.h"
#include "imaging/rectifier.h"

namespace livemap::ros_io {

imaging::CameraCalibration FromMessage(const sensor_msgs::CameraInfo& message);

/// Binning and region of interest stay at their defaults: the whole image at full resolution.
sensor_msgs::CameraInfo ToMessage(const imaging::CameraCalibration& calibration,
                                  const std_msgs::Header& header);

/// Of the rectified image: P, not K. Throws Error when it is no calibration of a camera.
geo::CameraIntrinsics ToRectifiedIntrinsics(const sensor_msgs::CameraInfo& info);

}  // namespace livemap::ros_io
