#pragma once

#include <Eigen/Geometry>
#include <opencv2/rgbd.hpp>
#include <string>

#include "odometry/edge/edge_odometry.h"

namespace livemap::tools {

/// OpenCV's `type` ("RgbdOdometry", "RgbdICPOdometry") with its default settings.
cv::Ptr<cv::rgbd::Odometry> MakeOpenCvOdometry(const std::string& type,
                                               const geo::CameraIntrinsics& camera);

/// A frame with everything that `odometry` computes of it once.
cv::Ptr<cv::rgbd::OdometryFrame> PrepareOpenCvFrame(const cv::rgbd::Odometry& odometry,
                                                    const odometry::RgbdFrame& frame);

/// OpenCV's 4x4 CV_64FC1 as a pose, and back.
Eigen::Isometry3d PoseOf(const cv::Mat& motion);
cv::Mat MatrixOf(const Eigen::Isometry3d& pose);

}  // namespace livemap::tools
