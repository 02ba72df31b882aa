#include "tools/odometry/opencv_odometry.h"

#include <limits>

namespace livemap::tools {

cv::Ptr<cv::rgbd::Odometry> MakeOpenCvOdometry(const std::string& type,
                                               const geo::CameraIntrinsics& camera) {
  const cv::Ptr<cv::rgbd::Odometry> odometry = cv::rgbd::Odometry::create(type);
  const cv::Matx33f matrix(static_cast<float>(camera.fx), 0, static_cast<float>(camera.cx), 0,
                           static_cast<float>(camera.fy), static_cast<float>(camera.cy), 0, 0, 1);
  odometry->setCameraMatrix(cv::Mat(matrix));
  return odometry;
}

cv::Ptr<cv::rgbd::OdometryFrame> PrepareOpenCvFrame(const cv::rgbd::Odometry& odometry,
                                                    const odometry::RgbdFrame& frame) {
  cv::Mat metres;
  frame.depth.convertTo(metres, CV_32F,
                        frame.depth.type() == CV_16UC1 ? 1 / frame.depth_units_per_m : 1.0);
  metres.setTo(std::numeric_limits<float>::quiet_NaN(), metres <= 0);
  cv::Ptr<cv::rgbd::OdometryFrame> prepared =
      cv::rgbd::OdometryFrame::create(frame.grey.clone(), metres, cv::Mat(), cv::Mat());
  odometry.prepareFrameCache(prepared, cv::rgbd::OdometryFrame::CACHE_ALL);
  return prepared;
}

Eigen::Isometry3d PoseOf(const cv::Mat& motion) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      pose.matrix()(row, column) = motion.at<double>(row, column);
    }
  }
  return pose;
}

cv::Mat MatrixOf(const Eigen::Isometry3d& pose) {
  cv::Mat matrix = cv::Mat::eye(4, 4, CV_64FC1);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      matrix.at<double>(row, column) = pose.matrix()(row, column);
    }
  }
  return matrix;
}

}  // namespace livemap::tools
