#pragma once

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2_msgs/TFMessage.h>

#include "datasets/camera_file.h"
#include "geo/camera_intrinsics.h"
#include "geo/wgs84.h"

namespace livemap::tools {

/// The messages that all drives have, whatever they are made of.

/// base_link -> camera_link -> kOpticalFrame.
tf2_msgs::TFMessage MountingTransforms(const datasets::CameraMounting& mounting,
                                       const ros::Time& stamp);

/// A fix of base_link with a standard deviation per horizontal axis. Heights are not stated: 0 with
/// a variance that says so.
sensor_msgs::NavSatFix DriveFix(const geo::GeoPoint& position, double sigma_m,
                                const ros::Time& stamp);
/// What a receiver without a fix says.
sensor_msgs::NavSatFix DriveWithoutFix(const ros::Time& stamp);

/// A camera_info without distortion, its stamp still zero.
sensor_msgs::CameraInfo PinholeCameraInfo(const geo::CameraIntrinsics& intrinsics);

}  // namespace livemap::tools
