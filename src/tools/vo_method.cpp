#include "tools/vo_method.h"

#include <limits>
#include <opencv2/rgbd.hpp>

#include "base/error.h"

namespace livemap {
namespace {

class EdgeMethod : public VoMethod {
 public:
  EdgeMethod(const EdgeOdometry::Config& config, const CameraIntrinsics& intrinsics)
      : odometry_(config, intrinsics) {}
  Step Track(const RgbdFrame& frame) override {
    const VoResult result = odometry_.Track(frame);
    return {result.world_from_camera, result.state == VoState::kLost, result.new_keyframe};
  }

 private:
  EdgeOdometry odometry_;
};

class OpenCvMethod : public VoMethod {
 public:
  OpenCvMethod(const std::string& type, const CameraIntrinsics& k)
      : odometry_(cv::rgbd::Odometry::create(type)) {
    const cv::Matx33f matrix(static_cast<float>(k.fx), 0, static_cast<float>(k.cx), 0,
                             static_cast<float>(k.fy), static_cast<float>(k.cy), 0, 0, 1);
    odometry_->setCameraMatrix(cv::Mat(matrix));
  }
  Step Track(const RgbdFrame& frame) override {
    cv::Mat metres;
    frame.depth.convertTo(metres, CV_32F,
                          frame.depth.type() == CV_16UC1 ? 1 / frame.depth_units_per_m : 1.0);
    metres.setTo(std::numeric_limits<float>::quiet_NaN(), metres <= 0);
    cv::Ptr<cv::rgbd::OdometryFrame> current =
        cv::rgbd::OdometryFrame::create(frame.grey.clone(), metres, cv::Mat(), cv::Mat());
    odometry_->prepareFrameCache(current, cv::rgbd::OdometryFrame::CACHE_ALL);
    Step step;
    cv::Mat motion;
    if (previous_ && !odometry_->compute(current, previous_, motion)) step.lost = true;
    if (previous_ && !step.lost) {
      Eigen::Isometry3d previous_from_current = Eigen::Isometry3d::Identity();
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 4; ++column) {
          previous_from_current.matrix()(row, column) = motion.at<double>(row, column);
        }
      }
      pose_ = pose_ * previous_from_current;
    }
    previous_ = current;
    step.keyframe = true;
    step.world_from_camera = pose_;
    return step;
  }

 private:
  cv::Ptr<cv::rgbd::Odometry> odometry_;
  cv::Ptr<cv::rgbd::OdometryFrame> previous_;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
};

}  // namespace

std::unique_ptr<VoMethod> MakeVoMethod(const std::string& name, const EdgeOdometry::Config& config,
                                       const CameraIntrinsics& intrinsics) {
  if (name == "edge") return std::make_unique<EdgeMethod>(config, intrinsics);
  if (name == "rgbd") return std::make_unique<OpenCvMethod>("RgbdOdometry", intrinsics);
  if (name == "rgbd-icp") return std::make_unique<OpenCvMethod>("RgbdICPOdometry", intrinsics);
  throw Error("--method is '" + name + "'; accepted are edge, rgbd, rgbd-icp");
}

}  // namespace livemap
