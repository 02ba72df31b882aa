#include <cv_bridge/cv_bridge.h>
#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <image_transport/image_transport.h>
#include <message_filters/sync_policies/approximate_time.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <nav_msgs/Path.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/image_encodings.h>
#include <std_srvs/Trigger.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>

#include <algorithm>
#include <boost/function.hpp>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <vector>

#include "nodelets/bounded_tf_listener.h"
#include "nodelets/diagnostics.h"
#include "nodelets/edge_vo/eye_choice.h"
#include "nodelets/edge_vo/frame_backlog.h"
#include "nodelets/edge_vo/mono_eye.h"
#include "nodelets/edge_vo/mounting_watch.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/stamp_checks.h"
#include "odometry/edge/edge_view.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/conversions/depth_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/positioning/odometry_conversions.h"
#include "ros/parameters/positioning/edge_vo_parameters.h"

namespace livemap::nodelets {
namespace {

EyeChoice::Config EyeChoiceOf(const ros_io::EdgeVoConfig& config) {
  EyeChoice::Config choice;
  choice.wait_s = config.eye_wait_s;
  if (config.eye == "depth") choice.wanted = EyeChoice::Wanted::kDepth;
  if (config.eye == "mono") choice.wanted = EyeChoice::Wanted::kMono;
  return choice;
}

/// What the odometry of one eye has of its own stays.
odometry::MonocularOdometry::Config MonocularOf(const ros_io::EdgeVoConfig& config) {
  odometry::MonocularOdometry::Config monocular;
  const odometry::DepthPyramid::Range range = monocular.odometry.depth_range;
  const odometry::PointSelection points = monocular.odometry.points;
  monocular.odometry = config.odometry;
  monocular.odometry.depth_range = range;
  monocular.odometry.points = points;
  monocular.background = config.background_keyframes;
  return monocular;
}

}  // namespace

/// Visual odometry on board: image and calibration in, with depth or without; `odom`, tf,
/// `vo/path`, and when somebody listens `vo/edges` and `vo/points` out. All callbacks run one at a
/// time, in the nodelet's own queue.
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
  using ImagePolicy =
      message_filters::sync_policies::ExactTime<sensor_msgs::Image, sensor_msgs::CameraInfo>;
  using TwistConstPtr = geometry_msgs::TwistWithCovarianceStampedConstPtr;

  /// An image with its calibration, and with depth where that is followed.
  struct Taken {
    ImageConstPtr image;
    ImageConstPtr depth;  // None: one eye follows the image.
    InfoConstPtr info;
  };
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
    choice_ = std::make_unique<EyeChoice>(EyeChoiceOf(config_));
    frames_.odom = config_.odom_frame;
    frames_.base = config_.base_frame;
    path_.header.frame_id = config_.odom_frame;
    ros::NodeHandle& node = getNodeHandle();
    tf_listener_ = std::make_unique<BoundedTfListener>(tf_buffer_, node, config_.max_stamp_ahead_s);
    stamps_ = std::make_unique<StampChecks>(getName(), config_.max_stamp_ahead_s,
                                            [this] { OnTimeReset(); });
    mounting_ = std::make_unique<MountingWatch>(node, getName(), config_, tf_buffer_);
    backlog_ = std::make_unique<FrameBacklog<Taken>>(
        static_cast<std::size_t>(config_.waiting_frames), *node.getCallbackQueue(),
        [this](const Taken& taken) { Work(taken); });
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
    // ROS's own queues have no bound, so that no message is lost whose partner is kept: the
    // synchroniser's have one, and so has the backlog.
    image_subscriber_ = transport.subscribe(
        "camera_rect/image", 0,
        boost::function<void(const ImageConstPtr&)>([this](const ImageConstPtr& image) {
          ++arrivals_.images;
          if (!IsUsable("an image", *image)) return;
          if (images_) images_->add<0>(image);
          Synchronize<0>(image);
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
          if (!IsUsable("a calibration", *info)) return;
          if (images_) images_->add<1>(info);
          Synchronize<2>(info);
        });
    if (choice_->eye() != Eye::kDepth) SubscribeToMetres();
    silence_timer_ = node.createSteadyTimer(ros::WallDuration(config_.silence_warning_s),
                                            &EdgeVoPart::OnSilenceTimer, this);
  }

  /// What tells one eye metres.
  void SubscribeToMetres() {
    ros::NodeHandle& node = getNodeHandle();
    fix_subscriber_ = node.subscribe<sensor_msgs::NavSatFix>(
        "fix", 100, [this](const sensor_msgs::NavSatFixConstPtr& fix) {
          if (!IsUsable("a fix", *fix)) return;
          speed_.AddFix(ros_io::ToFix(*fix));
          if (mono_) mono_->AddFix(ros_io::ToFix(*fix));
        });
    receiver_subscriber_ = node.subscribe<geometry_msgs::TwistWithCovarianceStamped>(
        "gps/velocity", 100, [this](const TwistConstPtr& velocity) {
          if (!IsUsable("a receiver's speed", *velocity)) return;
          const auto& linear = velocity->twist.twist.linear;
          speed_.AddSpeed(
              odometry::MetresSource::kReceiver, ros_io::FromRosTime(velocity->header.stamp),
              std::hypot(linear.x, linear.y), SigmaOf(*velocity, config_.receiver_sigma_mps));
        });
    if (config_.wheel_velocity_topic.empty()) return;
    wheel_subscriber_ = node.subscribe<geometry_msgs::TwistWithCovarianceStamped>(
        config_.wheel_velocity_topic, 100, [this](const TwistConstPtr& velocity) {
          if (!IsUsable("a wheels' speed", *velocity)) return;
          speed_.AddSpeed(
              odometry::MetresSource::kWheels, ros_io::FromRosTime(velocity->header.stamp),
              velocity->twist.twist.linear.x, SigmaOf(*velocity, config_.wheel_sigma_mps));
        });
  }

  /// Of the speed over ground, the less certain axis; `otherwise` where the message states none.
  static double SigmaOf(const geometry_msgs::TwistWithCovarianceStamped& velocity,
                        double otherwise) {
    constexpr std::size_t kYY = 7;
    const auto& covariance = velocity.twist.covariance;
    const double variance = std::max(covariance[0], covariance[kYY]);
    return variance > 0 ? std::sqrt(variance) : otherwise;
  }

  void MakeSynchronizer() {
    if (config_.eye != "depth") {
      images_ = std::make_unique<message_filters::Synchronizer<ImagePolicy>>(
          ImagePolicy(static_cast<std::uint32_t>(config_.queue_size)));
      images_->registerCallback(&EdgeVoPart::OnImage, this);
    }
    if (config_.eye == "mono") return;
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
    backlog_->Clear();
    choice_->OnTimeReset();
    if (!odometry_ && !mono_) return;
    NODELET_WARN("the images' stamps went back: odometry starts anew");
    ResetOdometry();
  }

  void ResetOdometry() {
    if (odometry_) odometry_->Reset();
    if (mono_) mono_->Reset();
    speed_.Reset();
    StartAnew();
  }

  /// An image with its calibration, with or without depth.
  void OnImage(const ImageConstPtr& image, const InfoConstPtr& info) {
    const Eye before = choice_->eye();
    if (!choice_->OnImage(ros_io::FromRosTime(image->header.stamp))) return;
    if (before == Eye::kUndecided) {
      NODELET_INFO("for %.1f s no depth came with the images: one eye follows them",
                   config_.eye_wait_s);
    }
    ++arrivals_.frames;
    backlog_->Push({image, nullptr, info});
  }

  /// An image with its calibration and its depth.
  void OnFrame(const ImageConstPtr& image, const ImageConstPtr& depth, const InfoConstPtr& info) {
    if (!choice_->OnDepth(ros_io::FromRosTime(image->header.stamp))) return;
    ++arrivals_.frames;
    backlog_->Push({image, depth, info});
  }

  void Work(const Taken& taken) {
    try {
      if (taken.depth) {
        FollowByDepth(taken);
      } else {
        FollowByOneEye(taken);
      }
    } catch (const std::exception& error) {
      Drop(error);
    }
  }

  void FollowByOneEye(const Taken& taken) {
    PrepareMono(*taken.info, taken.image->header);
    Follow(taken.image->header, [&](odometry::RgbdFrame& frame) {
      const auto grey = cv_bridge::toCvShare(taken.image, sensor_msgs::image_encodings::MONO8);
      frame.grey = grey->image;
      const std::int64_t stamp_ns = ros_io::FromRosTime(taken.image->header.stamp);
      return mono_->Track(stamp_ns, frame.grey, speed_.At(stamp_ns));
    });
  }

  void FollowByDepth(const Taken& taken) {
    if (mono_) LeaveMono(taken.image->header.stamp);
    Prepare(*taken.info, taken.image->header);
    Follow(taken.image->header, [&](odometry::RgbdFrame& frame) {
      frame = ToFrame(taken.image, taken.depth);
      return odometry_->Track(frame);
    });
  }

  void Drop(const std::exception& error) {
    ++figures_.dropped;
    NODELET_WARN_THROTTLE(kSayAgainS, "dropped a frame: %s", error.what());
  }

  /// One image, as `track` does it, which fills in the frame.
  template <class Track>
  void Follow(const std_msgs::Header& header, const Track& track) {
    const auto begin = std::chrono::steady_clock::now();
    odometry::RgbdFrame frame;
    odometry::VoResult result = track(frame);
    figures_.milliseconds.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
            .count());
    JoinOn(result);
    // Of the image with which depth took over one eye has told already.
    const bool is_new = header.stamp > last_stamp_;
    last_ = result;
    last_stamp_ = header.stamp;
    ++figures_.frames;
    figures_.lost += result.state == odometry::VoState::kLost ? 1U : 0U;
    figures_.keyframes += result.new_keyframe ? 1U : 0U;
    if (result.state != odometry::VoState::kInitialising && is_new) Publish(result, frame, header);
    if (is_new) WatchMounting(result, frame);
  }

  /// What the frame says about the camera's mounting counts from the next frame on.
  void WatchMounting(const odometry::VoResult& result, const odometry::RgbdFrame& frame) {
    odometry::CalibrationFrame seen;
    seen.stamp_ns = ros_io::FromRosTime(last_stamp_);
    seen.grey = frame.grey;
    seen.world_from_camera = result.world_from_camera;
    seen.tracking = result.state == odometry::VoState::kTracking;
    if (mono_) seen.metres_sigma = MetresSigmaForMounting();
    if (!frame.depth.empty()) {
      const bool coded = frame.depth.type() == CV_16UC1;
      frame.depth.convertTo(seen.depth_m, CV_32F, coded ? 1 / frame.depth_units_per_m : 1);
    }
    if (const auto mounting = mounting_->Add(seen)) {
      ros_io::ChangeMounting(result.world_from_camera, *mounting, frames_);
    }
  }

  /// Metres that come from the camera's height say nothing about it.
  double MetresSigmaForMounting() const {
    const odometry::MetresSource source = mono_->odometry().metres_source();
    const bool told =
        source != odometry::MetresSource::kHeight && source != odometry::MetresSource::kNone;
    const std::optional<double> sigma = mono_->odometry().metres_sigma();
    return told && sigma ? *sigma : std::numeric_limits<double>::infinity();
  }

  /// Depth goes on where one eye was, as far as its last motion tells.
  void LeaveMono(const ros::Time& stamp) {
    NODELET_INFO("depth came with the images: it is followed instead of one eye");
    joint_ = last_.world_from_camera;
    joint_covariance_ = last_.covariance;
    if (last_.twist) {
      *joint_ = *joint_ * odometry::Se3Exp(*last_.twist * (stamp - last_stamp_).toSec());
    }
    mono_.reset();
  }

  /// To the path of the odometry before.
  void JoinOn(odometry::VoResult& result) const {
    if (!joint_) return;
    const odometry::Matrix6d to_now = odometry::Se3Adjoint(result.world_from_camera.inverse());
    result.covariance += to_now * joint_covariance_ * to_now.transpose();
    result.world_from_camera = *joint_ * result.world_from_camera;
  }

  bool IsSameCamera(const geo::CameraIntrinsics& camera) const {
    return camera.fx == camera_.fx && camera.fy == camera_.fy && camera.cx == camera_.cx &&
           camera.cy == camera_.cy && camera.width == camera_.width &&
           camera.height == camera_.height;
  }

  void TakeMounting(const std_msgs::Header& header, const geo::CameraIntrinsics& camera) {
    const Eigen::Isometry3d mounting = mounting_->Begin(header.frame_id, camera);
    if (last_stamp_.isZero()) {
      frames_.base_from_optical = mounting;
    } else {
      ros_io::ChangeMounting(last_.world_from_camera, mounting, frames_);
    }
  }

  /// Calibration and mounting; a new calibration starts anew.
  void Prepare(const sensor_msgs::CameraInfo& info, const std_msgs::Header& header) {
    const geo::CameraIntrinsics camera = ros_io::ToRectifiedIntrinsics(info);
    if (odometry_ && IsSameCamera(camera)) return;
    if (odometry_) NODELET_WARN("the calibration changed: odometry starts anew");
    TakeMounting(header, camera);
    camera_ = camera;
    const bool first = odometry_ == nullptr;
    odometry_ = std::make_unique<odometry::EdgeOdometry>(config_.odometry, camera);
    if (!first) StartAnew();
  }

  void PrepareMono(const sensor_msgs::CameraInfo& info, const std_msgs::Header& header) {
    const geo::CameraIntrinsics camera = ros_io::ToRectifiedIntrinsics(info);
    if (mono_ && IsSameCamera(camera)) return;
    if (mono_) NODELET_WARN("the calibration changed: odometry starts anew");
    TakeMounting(header, camera);
    camera_ = camera;
    const bool first = mono_ == nullptr;
    mono_ = std::make_unique<MonoEye>(MonocularOf(config_), camera, frames_.base_from_optical);
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
    ShowEdges(result, frame, header);
  }

  /// For those who listen.
  void ShowEdges(const odometry::VoResult& result, const odometry::RgbdFrame& frame,
                 const std_msgs::Header& header) {
    const odometry::Keyframe* keyframe =
        mono_ ? mono_->odometry().keyframe() : odometry_->keyframe();
    if (keyframe == nullptr) return;
    const double metres_per_unit = mono_ ? mono_->odometry().metres_per_unit() : 1.0;
    Eigen::Isometry3d camera_from_keyframe;
    if (mono_) {
      camera_from_keyframe = mono_->odometry().CameraFromKeyframe();
    } else {
      const Eigen::Isometry3d joint = joint_.value_or(Eigen::Isometry3d::Identity());
      camera_from_keyframe =
          result.world_from_camera.inverse() * joint * keyframe->world_from_camera;
    }
    if (edges_publisher_.getNumSubscribers() > 0) {
      edges_publisher_.publish(
          cv_bridge::CvImage(
              header, sensor_msgs::image_encodings::BGR8,
              odometry::DrawEdges(frame.grey, *keyframe, camera_from_keyframe, camera_))
              .toImageMsg());
    }
    if (result.new_keyframe && cloud_publisher_.getNumSubscribers() > 0) {
      camera_from_keyframe.translation() *= metres_per_unit;
      cloud_publisher_.publish(
          ros_io::ToEdgeCloud(*keyframe, result.world_from_camera * camera_from_keyframe,
                              metres_per_unit, frames_, config_.cloud_voxel_m, header.stamp));
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
    last_stamp_ = {};
    joint_.reset();
    frames_.odom_from_first_base.setIdentity();
    ++figures_.resets;
  }

  bool OnReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    backlog_->Clear();
    ResetOdometry();
    response.success = true;
    response.message = "the next frame is the origin";
    return true;
  }

  void OnSilenceTimer(const ros::SteadyTimerEvent&) {
    const Arrivals came = arrivals_;
    arrivals_ = {};
    if (came.frames > 0) return;
    if (choice_->eye() == Eye::kMono) {
      NODELET_WARN_THROTTLE(kSayAgainS,
                            "no frame for %.1f s, one eye follows images and calibrations of the "
                            "same stamps: %d images on %s, %d calibrations on %s came",
                            config_.silence_warning_s, came.images,
                            image_subscriber_.getTopic().c_str(), came.infos,
                            info_subscriber_.getTopic().c_str());
      return;
    }
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
    const std::string complaint = mounting_->Complaint();
    status.summary(
        tracking && complaint.empty() ? Level::OK : Level::WARN,
        odometry::VoStateName(last_.state) + (complaint.empty() ? complaint : ", " + complaint));
    std::vector<double>& times = figures_.milliseconds;
    std::sort(times.begin(), times.end());
    status.add("eye", EyeName(choice_->eye()));
    status.add("state", odometry::VoStateName(last_.state));
    status.add("frames_in", backlog_->in());
    status.add("frames", figures_.frames);
    status.add("frames_dropped", figures_.dropped);
    status.add("frames_displaced", backlog_->displaced());
    status.add("frames_waiting", backlog_->waiting());
    status.add("frames_lost", figures_.lost);
    status.add("keyframes", figures_.keyframes);
    status.add("resets", figures_.resets);
    stamps_->Diagnose(status);
    status.add("milliseconds_median", times.empty() ? 0.0 : times[times.size() / 2]);
    status.add("milliseconds_p95", times.empty() ? 0.0 : times[times.size() * 95 / 100]);
    DiagnoseMetres(status);
    mounting_->Diagnose(status);
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

  /// Depth knows its metres.
  void DiagnoseMetres(Diagnostics::Status& status) const {
    if (!mono_) {
      status.add("metres", choice_->eye() == Eye::kDepth ? "depth" : "none");
      status.add("metres_sigma", "");
      return;
    }
    const std::optional<double> sigma = mono_->odometry().metres_sigma();
    status.add("metres", MetresSourceName(mono_->odometry().metres_source()));
    status.add("metres_sigma", sigma ? std::to_string(*sigma) : std::string());
  }

  ros_io::EdgeVoConfig config_;
  ros_io::OdometryFrames frames_;
  geo::CameraIntrinsics camera_;
  std::unique_ptr<EyeChoice> choice_;
  std::unique_ptr<odometry::EdgeOdometry> odometry_;  // By depth.
  std::unique_ptr<MonoEye> mono_;                     // By one eye.
  odometry::VehicleSpeed speed_{{}};                  // For one eye.
  /// Where depth took over from one eye, in the world of both.
  std::optional<Eigen::Isometry3d> joint_;
  odometry::Matrix6d joint_covariance_ = odometry::Matrix6d::Zero();
  odometry::VoResult last_;
  ros::Time last_stamp_;
  Arrivals arrivals_;
  Figures figures_;
  nav_msgs::Path path_;

  tf2_ros::Buffer tf_buffer_;
  std::unique_ptr<BoundedTfListener> tf_listener_;
  std::unique_ptr<MountingWatch> mounting_;  // After the buffer, which it reads.
  std::unique_ptr<StampChecks> stamps_;
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  ros::Publisher odometry_publisher_, path_publisher_, cloud_publisher_;
  image_transport::Publisher edges_publisher_;
  // After all that its work uses, and before all that fills or clears it: the work may go on in
  // another thread until the backlog is destroyed.
  std::unique_ptr<FrameBacklog<Taken>> backlog_;
  ros::ServiceServer reset_service_;

  std::unique_ptr<message_filters::Synchronizer<ImagePolicy>> images_;
  std::unique_ptr<Synchronizer<Exact>> exact_;
  std::unique_ptr<Synchronizer<Approximate>> approximate_;
  image_transport::Subscriber image_subscriber_, depth_subscriber_;
  ros::Subscriber info_subscriber_, fix_subscriber_, receiver_subscriber_, wheel_subscriber_;
  ros::SteadyTimer silence_timer_;            // After the subscribers, which it names.
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

using EdgeVoNodelet = PartNodelet<EdgeVoPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::EdgeVoNodelet, nodelet::Nodelet)
