#include "tools/simulation/simulation_bag.h"

#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/String.h>

#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "datasets/sensors/wheel_odometer_model.h"
#include "tools/bags/bag_messages.h"
#include "tools/bags/drive_bag.h"

namespace livemap::tools {
namespace {

/// 2026-01-01T12:00:00Z, as other drives begin.
constexpr std::uint32_t kStartS = 1767268800;
constexpr double kTwistRateHz = 50;
/// Keeps the odometer's numbers apart from the receiver's.
constexpr std::uint64_t kOdometerStream = 0x6f646f6d65746572ULL;

DriveSetup SimulatedDriveSetup(const SimulationBag::Setup& setup) {
  const geo::LocalFrame map(setup.datum);
  const auto place = [map, state = setup.state](double time_s) {
    return map.ToGeo(state(time_s).world_from_base.translation().head<2>());
  };
  DriveSetup drive{datasets::Route::Straight(place(0), 0),
                   0,
                   setup.camera,
                   setup.options.noise,
                   setup.options.fix_rate_hz,
                   setup.seed,
                   ros::Time(kStartS, 0)};
  drive.place = place;
  drive.multipath_m = setup.multipath_m;
  // Depth images are large and shrink well; pictures are compressed already.
  if (setup.options.depth) drive.compression = BagWriter::Compression::kLz4;
  return drive;
}

/// Of the hazards that a detector should find.
std::vector<Detection> SimulatedBoxes(const std::vector<simulation::HazardInView>& hazards) {
  std::vector<Detection> boxes;
  for (const simulation::HazardInView& hazard : hazards) {
    if (hazard.difficult) continue;
    Detection box;
    box.class_name = simulation::ClassName(hazard.object_class);
    box.confidence = 1;
    box.x_min = static_cast<float>(hazard.box.x);
    box.y_min = static_cast<float>(hazard.box.y);
    box.x_max = static_cast<float>(hazard.box.br().x);
    box.y_max = static_cast<float>(hazard.box.br().y);
    boxes.push_back(box);
  }
  return boxes;
}

geometry_msgs::Vector3 BagVector(const Eigen::Vector3d& vector) {
  geometry_msgs::Vector3 message;
  message.x = vector.x();
  message.y = vector.y();
  message.z = vector.z();
  return message;
}

nav_msgs::Odometry SimulatedOdometry(const simulation::VehicleKinematics& state,
                                     const std_msgs::Header& header) {
  nav_msgs::Odometry odometry;
  odometry.header = header;
  odometry.header.frame_id = "map";
  odometry.child_frame_id = "base_link";
  const Eigen::Vector3d position = state.world_from_base.translation();
  odometry.pose.pose.position.x = position.x();
  odometry.pose.pose.position.y = position.y();
  odometry.pose.pose.position.z = position.z();
  const Eigen::Quaterniond rotation(state.world_from_base.linear());
  odometry.pose.pose.orientation.x = rotation.x();
  odometry.pose.pose.orientation.y = rotation.y();
  odometry.pose.pose.orientation.z = rotation.z();
  odometry.pose.pose.orientation.w = rotation.w();
  odometry.twist.twist.linear = BagVector(state.velocity_mps);
  odometry.twist.twist.angular = BagVector(state.turn_rate_radps);
  return odometry;
}

sensor_msgs::Image SimulatedDepthImage(const cv::Mat& depth, const std_msgs::Header& header) {
  sensor_msgs::Image image;
  image.header = header;
  image.height = static_cast<std::uint32_t>(depth.rows);
  image.width = static_cast<std::uint32_t>(depth.cols);
  image.encoding = "32FC1";
  image.is_bigendian = 0;
  image.step = image.width * static_cast<std::uint32_t>(sizeof(float));
  cv::Mat metres = depth.clone();
  metres.setTo(std::numeric_limits<float>::quiet_NaN(), depth == 0);
  image.data.resize(std::size_t{image.step} * image.height);
  for (int row = 0; row < metres.rows; ++row) {
    std::memcpy(&image.data[static_cast<std::size_t>(row) * image.step], metres.ptr(row),
                image.step);
  }
  return image;
}

class RosSimulationBag : public SimulationBag {
 public:
  RosSimulationBag(const std::string& path, const Setup& setup)
      : setup_(setup),
        bag_(path, SimulatedDriveSetup(setup)),
        odometer_(setup.seed ^ kOdometerStream),
        next_twist_(-static_cast<std::int64_t>(DriveBag::kLeadS * kTwistRateHz)),
        info_(PinholeCameraInfo(setup.camera.intrinsics)),
        right_info_(info_) {
    right_info_.P[3] = -setup.camera.intrinsics.fx * setup.baseline_m;
  }

  void Add(double time_s, const simulation::SimulatedFrame& frame, const cv::Mat& depth,
           const cv::Mat& right, const std::vector<simulation::HazardInView>& hazards) override {
    WriteTwistsUntil(time_s);
    const std_msgs::Header header =
        bag_.AddFrame(time_s, ToJpeg(frame.bgr), SimulatedBoxes(hazards));
    bag_.Writer().Write("/ground_truth/odom", header.stamp,
                        SimulatedOdometry(setup_.state(time_s), header));
    if (!depth.empty()) {
      info_.header = header;
      bag_.Writer().Write("/camera/depth/camera_info", header.stamp, info_);
      bag_.Writer().Write("/camera/depth/image_raw", header.stamp,
                          SimulatedDepthImage(depth, header));
    }
    if (right.empty()) return;
    // image_geometry wants both cameras in the left one's frame.
    right_info_.header = header;
    bag_.Writer().Write("/camera_right/camera_info", header.stamp, right_info_);
    sensor_msgs::CompressedImage picture;
    picture.header = header;
    picture.format = "bgr8; jpeg compressed bgr8";
    picture.data = ToJpeg(right);
    bag_.Writer().Write("/camera_right/image_raw/compressed", header.stamp, picture);
  }

  void Finish(double end_s, const std::string& hazards) override {
    WriteTwistsUntil(end_s + DriveBag::kLeadS);
    bag_.AdvanceTo(end_s + DriveBag::kLeadS);
    // Known only now, but for the listener it stands from the beginning.
    std_msgs::String truth;
    truth.data = hazards;
    bag_.Writer().WriteLatched("/ground_truth/hazards", bag_.Stamp(-DriveBag::kLeadS), truth);
    bag_.Finish(end_s);
  }

 private:
  std::vector<std::uint8_t> ToJpeg(const cv::Mat& bgr) const {
    std::vector<std::uint8_t> jpeg;
    cv::imencode(
        ".jpg", bgr, jpeg,
        {cv::IMWRITE_JPEG_QUALITY, setup_.options.jpeg_quality, cv::IMWRITE_JPEG_OPTIMIZE, 1});
    return jpeg;
  }

  void WriteTwistsUntil(double time_s) {
    for (;; ++next_twist_) {
      const double twist_s = static_cast<double>(next_twist_) / kTwistRateHz;
      if (twist_s > time_s) return;
      bag_.AdvanceTo(twist_s);
      const simulation::VehicleKinematics state = setup_.state(twist_s);
      const datasets::WheelTwist measured =
          odometer_.Measure(state.velocity_mps.x(), state.turn_rate_radps.z());
      geometry_msgs::TwistWithCovarianceStamped message;
      message.header.stamp = bag_.Stamp(twist_s);
      message.header.frame_id = "base_link";
      message.twist.twist.linear.x = measured.speed_mps;
      message.twist.twist.angular.z = measured.yaw_rate_radps;
      // Row and column 0 are x forward, 5 the turn about z; the others are not measured and stay 0.
      message.twist.covariance[0] = measured.speed_variance;
      message.twist.covariance[35] = measured.yaw_rate_variance;
      bag_.Writer().Write("/wheel/twist", message.header.stamp, message);
    }
  }

  const Setup setup_;
  DriveBag bag_;
  datasets::WheelOdometerModel odometer_;
  std::int64_t next_twist_;
  sensor_msgs::CameraInfo info_;
  sensor_msgs::CameraInfo right_info_;
};

}  // namespace

std::unique_ptr<SimulationBag> OpenSimulationBag(const std::string& path,
                                                 const SimulationBag::Setup& setup) {
  return std::make_unique<RosSimulationBag>(path, setup);
}

}  // namespace livemap::tools
