#include "tools/odometry/vo_method.h"

#include "common/error.h"
#include "tools/odometry/opencv_odometry.h"

namespace livemap::tools {
namespace {

class EdgeVoMethod : public VoMethod {
 public:
  EdgeVoMethod(const odometry::EdgeOdometry::Config& config,
               const geo::CameraIntrinsics& intrinsics)
      : odometry_(config, intrinsics) {}
  Step Track(const odometry::RgbdFrame& frame) override {
    const odometry::VoResult result = odometry_.Track(frame);
    return {result.world_from_camera, result.state == odometry::VoState::kLost, result.new_keyframe,
            result.state == odometry::VoState::kInitialising};
  }

 private:
  odometry::EdgeOdometry odometry_;
};

class OpenCvVoMethod : public VoMethod {
 public:
  OpenCvVoMethod(const std::string& type, const geo::CameraIntrinsics& intrinsics)
      : odometry_(MakeOpenCvOdometry(type, intrinsics)) {}
  Step Track(const odometry::RgbdFrame& frame) override {
    cv::Ptr<cv::rgbd::OdometryFrame> current = PrepareOpenCvFrame(*odometry_, frame);
    Step step;
    cv::Mat motion;
    if (previous_ && !odometry_->compute(current, previous_, motion)) step.lost = true;
    if (previous_ && !step.lost) pose_ = pose_ * PoseOf(motion);
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

std::unique_ptr<VoMethod> MakeVoMethod(const std::string& name,
                                       const odometry::EdgeOdometry::Config& config,
                                       const geo::CameraIntrinsics& intrinsics) {
  if (name == "edge") return std::make_unique<EdgeVoMethod>(config, intrinsics);
  if (name == "rgbd") return std::make_unique<OpenCvVoMethod>("RgbdOdometry", intrinsics);
  if (name == "rgbd-icp") return std::make_unique<OpenCvVoMethod>("RgbdICPOdometry", intrinsics);
  throw Error("--method is '" + name + "'; accepted are edge, rgbd, rgbd-icp");
}

}  // namespace livemap::tools
