#include "pair_alignment.h"

#include <array>
#include <utility>

#include "tools/odometry/opencv_odometry.h"

namespace livemap::bench {
namespace {

class EdgePairAlignment : public PairAlignment {
 public:
  explicit EdgePairAlignment(const geo::CameraIntrinsics& camera)
      : extractor_(config_.edges),
        aligner_(config_.alignment),
        cameras_(odometry::LevelCamerasOf(camera)) {}

  std::string name() const override { return "edge"; }

  void Take(const odometry::RgbdFrame& reference, const odometry::RgbdFrame& image) override {
    reference_.Build(reference.grey);
    image_.Build(image.grey);
    depths_.Build(reference.depth, reference.depth_units_per_m, config_.depth_range,
                  cameras_.levels);
    for (int level = 0; level < cameras_.levels; ++level) {
      const auto index = static_cast<std::size_t>(level);
      odometry::PointSelection selection = config_.points;
      selection.max_points = static_cast<std::size_t>(config_.max_points[index]);
      const cv::Mat& grey = reference_[level];
      selector_.Select({grey, depths_[level], exact_}, extractor_.Extract(grey),
                       cameras_.camera[index], selection, points_[index]);
    }
  }

  std::optional<Eigen::Isometry3d> Align(const Eigen::Isometry3d& guess) override {
    odometry::AlignmentState state;
    state.new_from_reference = guess;
    for (int level = cameras_.levels - 1; level >= 0; --level) {
      const auto index = static_cast<std::size_t>(level);
      state = aligner_.Align(points_[index], image_[level], cameras_.camera[index], state).state;
    }
    return state.new_from_reference;
  }

 private:
  odometry::EdgeOdometry::Config config_;
  const cv::Mat exact_;  // No uncertainty of the depths.
  odometry::EdgeExtractor extractor_;
  odometry::PointSelector selector_;
  odometry::Aligner aligner_;
  odometry::LevelCameras cameras_;
  odometry::ImagePyramid reference_, image_;
  odometry::DepthPyramid depths_;
  std::array<odometry::EdgePoints, odometry::kMaxLevels> points_;
};

class OpenCvPairAlignment : public PairAlignment {
 public:
  OpenCvPairAlignment(std::string name, const cv::Ptr<cv::rgbd::Odometry>& odometry)
      : name_(std::move(name)), odometry_(odometry) {}

  std::string name() const override { return name_; }

  void Take(const odometry::RgbdFrame& reference, const odometry::RgbdFrame& image) override {
    reference_ = tools::PrepareOpenCvFrame(*odometry_, reference);
    image_ = tools::PrepareOpenCvFrame(*odometry_, image);
  }

  std::optional<Eigen::Isometry3d> Align(const Eigen::Isometry3d& guess) override {
    cv::Mat motion;
    if (!odometry_->compute(reference_, image_, motion, tools::MatrixOf(guess)))
      return std::nullopt;
    return tools::PoseOf(motion);
  }

 private:
  std::string name_;
  cv::Ptr<cv::rgbd::Odometry> odometry_;
  cv::Ptr<cv::rgbd::OdometryFrame> reference_, image_;
};

template <typename Kind>
std::unique_ptr<PairAlignment> WithoutLimits(const std::string& name, const std::string& type,
                                             const geo::CameraIntrinsics& camera) {
  const cv::Ptr<Kind> odometry = tools::MakeOpenCvOdometry(type, camera).dynamicCast<Kind>();
  odometry->setMaxTranslation(1000);  // m
  odometry->setMaxRotation(360);      // degrees
  return std::make_unique<OpenCvPairAlignment>(name, odometry);
}

}  // namespace

std::vector<std::unique_ptr<PairAlignment>> MakePairAlignments(
    const geo::CameraIntrinsics& camera) {
  std::vector<std::unique_ptr<PairAlignment>> methods;
  methods.push_back(std::make_unique<EdgePairAlignment>(camera));
  methods.push_back(WithoutLimits<cv::rgbd::RgbdOdometry>("rgbd", "RgbdOdometry", camera));
  methods.push_back(
      WithoutLimits<cv::rgbd::RgbdICPOdometry>("rgbd-icp", "RgbdICPOdometry", camera));
  return methods;
}

}  // namespace livemap::bench
