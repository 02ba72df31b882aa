#include <cv_bridge/cv_bridge.h>
#include <image_transport/image_transport.h>
#include <message_filters/sync_policies/approximate_time.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/image_encodings.h>
#include <std_srvs/Trigger.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>

#include <algorithm>
#include <boost/function.hpp>
#include <chrono>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <vector>

#include "nodelets/bounded_tf_listener.h"
#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/stamp_checks.h"
#include "odometry/edge/edge_view.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/conversions/depth_conversions.h"
#include "ros/conversions/odometry_conversions.h"
#include "ros/parameters/edge_vo_parameters.h"

namespace livemap::nodelets {

/// Visual odometry on board: image, depth and calibration in; `odom`, tf, `vo/path`, and when
/// somebody listens `vo/edges` and `vo/points` out. All callbacks run one at a time, in the
/// nodelet's own queue.
class EdgeVoPart : public NodeletPart {
 private:
  using ImageConstPtr = sensor_msgs::ImageConstPtr;
  using InfoConstPtr = sensor_msgs::CameraInfoConstPtr;
  template <template <class...> class Policy>
  using Synchronizer = message_filters::Synchronizer<
      Policy<sensor_msgs::Image, sensor_msgs::Image, sensor_msgs::CameraInfo>>;
  template <class A, class B, class C>
  using Exact = message_filters::sync_policies::ExactTime<A, B, C>;
  template <class A, class B, class C>
  using Approximate = message_filters::sync_policies::ApproximateTime<A, B, C>;

  /// Messages that came on an input topic since the last warning.
  struct Arrivals {
    int images = 0, depths = 0, infos = 0, frames = 0;
  };
  struct Figures {
    std::uint64_t frames = 0, dropped = 0, lost = 0, keyframes = 0, resets = 0;
    std::vector<double> milliseconds;  // Since the last diagnostics.
  };

  void Initialize() override {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadEdgeVoConfig(parameters);
    // A mistake in the configuration is one now, not at the first image.
    const odometry::EdgeExtractor checked(config_.odometry.edges);
    frames_.odom = config_.odom_frame;
    frames_.base = config_.base_frame;
    path_.header.frame_id = config_.odom_frame;
    ros::NodeHandle& node = getNodeHandle();
    tf_listener_ = std::make_unique<BoundedTfListener>(tf_buffer_, node, config_.max_stamp_ahead_s);
    stamps_ = std::make_unique<StampChecks>(getName(), config_.max_stamp_ahead_s,
                                            [this] { OnTimeReset(); });
    odometry_publisher_ = node.advertise<nav_msgs::Odometry>("odom", 10);
    path_publisher_ = node.advertise<nav_msgs::Path>("vo/path", 1);
    cloud_publisher_ = node.advertise<sensor_msgs::PointCloud2>("vo/points", 1);
    image_transport::ImageTransport transport(node);
    edges_publisher_ = transport.advertise("vo/edges", 1);
    reset_service_ = getPrivateNodeHandle().advertiseService("reset", &EdgeVoPart::OnReset, this);
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "edge_vo", "edge vo", config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
    Subscribe(transport);
  }

  void Subscribe(image_transport::ImageTransport& transport) {
    ros::NodeHandle& node = getNodeHandle();
    const image_transport::TransportHints raw("raw", ros::TransportHints().tcpNoDelay(),
                                              getPrivateNodeHandle());
    MakeSynchronizer();
    // ROS's own queues have no bound: the synchroniser's have, and drop what finds no partner.
    image_subscriber_ = transport.subscribe(
        "camera_rect/image", 0,
        boost::function<void(const ImageConstPtr&)>([this](const ImageConstPtr& image) {
          ++arrivals_.images;
          if (IsUsable("an image", *image)) Synchronize<0>(image);
        }),
        ros::VoidPtr(), raw);
    depth_subscriber_ = transport.subscribe(
        "camera/depth/image_raw", 0,
        boost::function<void(const ImageConstPtr&)>([this](const ImageConstPtr& depth) {
          ++arrivals_.depths;
          if (IsUsable("a depth image", *depth)) Synchronize<1>(depth);
        }),
        ros::VoidPtr(), raw);
    info_subscriber_ = node.subscribe<sensor_msgs::CameraInfo>(
        "camera_rect/camera_info", 0, [this](const InfoConstPtr& info) {
          ++arrivals_.infos;
          if (IsUsable("a calibration", *info)) Synchronize<2>(info);
        });
    silence_timer_ = node.createSteadyTimer(ros::WallDuration(config_.silence_warning_s),
                                            &EdgeVoPart::OnSilenceTimer, this);
  }

  void MakeSynchronizer() {
    const auto queue = static_cast<std::uint32_t>(config_.queue_size);
    if (config_.sync == "exact") {
      exact_ = std::make_unique<Synchronizer<Exact>>(
          Exact<sensor_msgs::Image, sensor_msgs::Image, sensor_msgs::CameraInfo>(queue));
      exact_->registerCallback(&EdgeVoPart::OnFrame, this);
    } else {
      approximate_ = std::make_unique<Synchronizer<Approximate>>(
          Approximate<sensor_msgs::Image, sensor_msgs::Image, sensor_msgs::CameraInfo>(queue));
      approximate_->registerCallback(&EdgeVoPart::OnFrame, this);
    }
  }

  template <class Message>
  bool IsUsable(const char* input, const Message& message) {
    return stamps_->IsUsable(input, message.header.stamp);
  }

  template <int kInput, class Message>
  void Synchronize(const Message& message) {
    if (exact_) exact_->add<kInput>(message);
    if (approximate_) approximate_->add<kInput>(message);
  }

  /// A replay that begins again, or a clock that was set back. What still waits for its partners in
  /// the synchroniser would stay there, newer than all that comes.
  void OnTimeReset() {
    MakeSynchronizer();
    if (!odometry_) return;
    NODELET_WARN("the images' stamps went back: odometry starts anew");
    odometry_->Reset();
    StartAnew();
  }

  void OnFrame(const ImageConstPtr& image, const ImageConstPtr& depth, const InfoConstPtr& info) {
    ++arrivals_.frames;
    try {
      Prepare(*info, image->header);
      const auto begin = std::chrono::steady_clock::now();
      const odometry::RgbdFrame frame = ToFrame(image, depth);
      const odometry::VoResult result = odometry_->Track(frame);
      figures_.milliseconds.push_back(
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
              .count());
      last_ = result;
      last_stamp_ = image->header.stamp;
      ++figures_.frames;
      figures_.lost += result.state == odometry::VoState::kLost ? 1U : 0U;
      figures_.keyframes += result.new_keyframe ? 1U : 0U;
      if (result.state != odometry::VoState::kInitialising) Publish(result, frame, image->header);
    } catch (const std::exception& error) {
      ++figures_.dropped;
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped a frame: %s", error.what());
    }
  }

  /// Calibration and mounting; a new calibration starts anew.
  void Prepare(const sensor_msgs::CameraInfo& info, const std_msgs::Header& header) {
    const geo::CameraIntrinsics camera = ros_io::ToRectifiedIntrinsics(info);
    const bool same = odometry_ && camera.fx == camera_.fx && camera.fy == camera_.fy &&
                      camera.cx == camera_.cx && camera.cy == camera_.cy &&
                      camera.width == camera_.width && camera.height == camera_.height;
    if (same) return;
    if (odometry_) NODELET_WARN("the calibration changed: odometry starts anew");
    const geometry_msgs::TransformStamped mounting = tf_buffer_.lookupTransform(
        config_.base_frame, header.frame_id, ros::Time(0), ros::Duration(0));
    frames_.base_from_optical = tf2::transformToEigen(mounting);
    camera_ = camera;
    const bool first = odometry_ == nullptr;
    odometry_ = std::make_unique<odometry::EdgeOdometry>(config_.odometry, camera);
    if (!first) StartAnew();
  }

  odometry::RgbdFrame ToFrame(const ImageConstPtr& image, const ImageConstPtr& depth) const {
    odometry::RgbdFrame frame;
    frame.stamp_ns = static_cast<std::int64_t>(image->header.stamp.toNSec());
    frame.grey = cv_bridge::toCvShare(image, sensor_msgs::image_encodings::MONO8)->image;
    frame.depth = ros_io::ToSharedDepth(depth)->image;
    frame.depth_units_per_m = config_.depth_units_per_m;
    return frame;
  }

  void Publish(const odometry::VoResult& result, const odometry::RgbdFrame& frame,
               const std_msgs::Header& header) {
    const nav_msgs::Odometry odometry = ros_io::ToOdometry(result, frames_, header.stamp);
    odometry_publisher_.publish(odometry);
    if (config_.publish_tf) {
      geometry_msgs::TransformStamped transform;
      transform.header = odometry.header;
      transform.child_frame_id = odometry.child_frame_id;
      transform.transform = tf2::eigenToTransform(ros_io::OdomFromBase(result, frames_)).transform;
      tf_broadcaster_.sendTransform(transform);
    }
    ExtendPath(odometry);
    const odometry::Keyframe& keyframe = *odometry_->keyframe();
    if (edges_publisher_.getNumSubscribers() > 0) {
      const Eigen::Isometry3d camera_from_keyframe =
          result.world_from_camera.inverse() * keyframe.world_from_camera;
      edges_publisher_.publish(
          cv_bridge::CvImage(
              header, sensor_msgs::image_encodings::BGR8,
              odometry::DrawEdges(frame.grey, keyframe, camera_from_keyframe, camera_))
              .toImageMsg());
    }
    if (result.new_keyframe && cloud_publisher_.getNumSubscribers() > 0) {
      cloud_publisher_.publish(
          ros_io::ToEdgeCloud(keyframe, frames_, config_.cloud_voxel_m, header.stamp));
    }
  }

  void ExtendPath(const nav_msgs::Odometry& odometry) {
    const auto& here = odometry.pose.pose.position;
    if (!path_.poses.empty()) {
      const auto& last = path_.poses.back().pose.position;
      const double way_m =
          Eigen::Vector3d(here.x - last.x, here.y - last.y, here.z - last.z).norm();
      if (way_m < config_.path_spacing_m) return;
    }
    geometry_msgs::PoseStamped pose;
    pose.header = odometry.header;
    pose.pose = odometry.pose.pose;
    path_.header.stamp = odometry.header.stamp;
    path_.poses.push_back(pose);
    if (path_.poses.size() > static_cast<std::size_t>(config_.path_max_poses)) {
      path_.poses.erase(path_.poses.begin());
    }
    if (path_publisher_.getNumSubscribers() > 0) path_publisher_.publish(path_);
  }

  void StartAnew() {
    path_.poses.clear();
    last_ = {};
    ++figures_.resets;
  }

  bool OnReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    if (odometry_) odometry_->Reset();
    StartAnew();
    response.success = true;
    response.message = "the next frame is the origin";
    return true;
  }

  void OnSilenceTimer(const ros::SteadyTimerEvent&) {
    const Arrivals came = arrivals_;
    arrivals_ = {};
    if (came.frames > 0) return;
    NODELET_WARN_THROTTLE(
        kSayAgainS,
        "no frame for %.1f s, stamps synchronised '%s': %d images on %s, %d depth images on %s, "
        "%d calibrations on %s came",
        config_.silence_warning_s, config_.sync.c_str(), came.images,
        image_subscriber_.getTopic().c_str(), came.depths, depth_subscriber_.getTopic().c_str(),
        came.infos, info_subscriber_.getTopic().c_str());
  }

  void Diagnose(Diagnostics::Status& status) {
    using Level = diagnostic_msgs::DiagnosticStatus;
    const bool tracking = last_.state == odometry::VoState::kTracking;
    status.summary(tracking ? Level::OK : Level::WARN, odometry::VoStateName(last_.state));
    std::vector<double>& times = figures_.milliseconds;
    const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::nth_element(times.begin(), middle, times.end());
    status.add("state", odometry::VoStateName(last_.state));
    status.add("frames", figures_.frames);
    status.add("frames_dropped", figures_.dropped);
    status.add("frames_lost", figures_.lost);
    status.add("keyframes", figures_.keyframes);
    status.add("resets", figures_.resets);
    stamps_->Diagnose(status);
    status.add("milliseconds_median", times.empty() ? 0.0 : *middle);
    status.add("edges", last_.points);
    status.add("inliers", last_.inliers);
    status.add("residual_sigma", last_.sigma);
    status.add("overlap", last_.overlap);
    const double age_s = static_cast<double>(static_cast<std::int64_t>(last_stamp_.toNSec()) -
                                             last_.keyframe_stamp_ns) *
                         1e-9;
    status.add("keyframe_age_s", last_.keyframe_stamp_ns == 0 ? 0.0 : age_s);
    times.clear();
  }

  ros_io::EdgeVoConfig config_;
  ros_io::OdometryFrames frames_;
  geo::CameraIntrinsics camera_;
  std::unique_ptr<odometry::EdgeOdometry> odometry_;
  odometry::VoResult last_;
  ros::Time last_stamp_;
  Arrivals arrivals_;
  Figures figures_;
  nav_msgs::Path path_;

  tf2_ros::Buffer tf_buffer_;
  std::unique_ptr<BoundedTfListener> tf_listener_;
  std::unique_ptr<StampChecks> stamps_;
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  ros::Publisher odometry_publisher_, path_publisher_, cloud_publisher_;
  image_transport::Publisher edges_publisher_;
  ros::ServiceServer reset_service_;

  std::unique_ptr<Synchronizer<Exact>> exact_;
  std::unique_ptr<Synchronizer<Approximate>> approximate_;
  image_transport::Subscriber image_subscriber_, depth_subscriber_;
  ros::Subscriber info_subscriber_;
  ros::SteadyTimer silence_timer_;            // After the subscribers, which it names.
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using EdgeVoNodelet = PartNodelet<EdgeVoPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::EdgeVoNodelet, nodelet::Nodelet)
