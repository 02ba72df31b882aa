#include <cv_bridge/cv_bridge.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <nav_msgs/Path.h>
#include <nodelet/nodelet.h>
#include <ros/package.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "geo/datum.h"
#include "hazard/hazard_reporter.h"
#include "hazard/poll_responder.h"
#include "nodelets/nodelet_support.h"
#include "ros/camera_info_conversions.h"
#include "ros/hazard_conversions.h"
#include "ros/hazard_reporting_parameters.h"
#include "ros/hazard_view.h"
#include "ros/localization_conversions.h"
#include "ros/poll_conversions.h"

namespace livemap {
namespace {

constexpr double kSendTickS = 0.05;
constexpr double kViewPeriodS = 1.0;
constexpr std::size_t kSendPerTick = 10;

}  // namespace

/// Reports what hazard_detection sees to the zone: HazardReporter with topics, tf and clocks. All
/// callbacks run one at a time, in the nodelet's own queue. Timers are steady, so that a paused bag
/// does not stop the delivery.
class HazardReportingNodelet : public nodelet::Nodelet {
 private:
  void onInit() override {
    InitializeOrExplain(getName(), [this] { Initialize(); });
  }

  void Initialize() {
    const std::int64_t now_ns = static_cast<std::int64_t>(ros::WallTime::now().toNSec());
    ParameterReader parameters(getPrivateNodeHandle());
    config_ = ReadHazardReportingConfig(parameters, now_ns);
    if (config_.catalogue.empty()) {
      config_.catalogue = ros::package::getPath("livemap") + "/config/hazards.yaml";
    }
    catalogue_ = HazardCatalogue::Load(config_.catalogue);
    MakeDirectoryOf(config_.reporter.map.path);
    reporter_ = std::make_unique<HazardReporter>(config_.reporter, catalogue_,
                                                 EntropySeededGenerator(), now_ns, SteadyS());
    responder_ = std::make_unique<PollResponder>(config_.polls, catalogue_);
    if (!reporter_->map().set_aside().empty()) {
      NODELET_ERROR("%s", DescribeSetAside(config_.reporter.map.path, reporter_->map()).c_str());
    }
    if (reporter_->map().broken_rows().count() > 0) {
      NODELET_ERROR("%s", DescribeBrokenRows(config_.reporter.map.path, reporter_->map()).c_str());
    }
    if (config_.map_datum) map_.emplace(*config_.map_datum);
    path_.header.frame_id = config_.map_frame;
    Connect();
  }

  static void MakeDirectoryOf(const std::string& path) {
    const auto directory = std::filesystem::path(path).parent_path();
    std::error_code error;
    if (!directory.empty()) std::filesystem::create_directories(directory, error);
    if (error) {
      throw Error("parameter 'database' is '" + path +
                  "', its directory cannot be made: " + error.message());
    }
  }

  void Connect() {
    using Self = HazardReportingNodelet;
    ros::NodeHandle& node = getNodeHandle();
    report_publisher_ = node.advertise<HazardReport>("hazard/report", 100);
    position_publisher_ = node.advertise<VehiclePosition>("vehicle/position", 10);
    answer_publisher_ = node.advertise<HazardPollAnswer>("hazard/poll_answer", 100);
    marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>("hazard/local_map", 1);
    path_publisher_ = node.advertise<nav_msgs::Path>("path", 1);
    subscribers_ = {
        node.subscribe("hazard/detections", 100, &Self::OnDetections, this),
        node.subscribe("hazard/annotated", 10, &Self::OnAnnotated, this),
        node.subscribe("fix", 100, &Self::OnFix, this),
        node.subscribe("camera_rect/camera_info", 1, &Self::OnCameraInfo, this),
        node.subscribe("hazard/notice", 10000, &Self::OnNotice, this),
        node.subscribe("hazard/receipt", 1000, &Self::OnReceipt, this),
        node.subscribe("hazard/poll", 100, &Self::OnPoll, this),
    };
    if (IsFused()) {
      subscribers_.push_back(node.subscribe("localization/odometry", 100, &Self::OnPose, this));
    }
    if (config_.reporter.use_depth) {
      subscribers_.push_back(node.subscribe("camera/depth/image_raw", 10, &Self::OnDepth, this));
    }
    tf_listener_ = std::make_unique<tf2_ros::TransformListener>(tf_buffer_, node);
    updater_ =
        std::make_unique<diagnostic_updater::Updater>(node, getPrivateNodeHandle(), getName());
    updater_->setHardwareID("hazard_reporting");
    updater_->add("hazard reporting", this, &Self::Diagnose);
    timers_ = {
        node.createSteadyTimer(ros::WallDuration(kSendTickS), &Self::OnTick, this),
        node.createSteadyTimer(ros::WallDuration(kViewPeriodS), &Self::OnViewTimer, this),
        node.createSteadyTimer(ros::WallDuration(config_.diagnostics_period_s),
                               &Self::OnDiagnosticsTimer, this),
    };
  }

  bool IsFused() const { return config_.reporter.position_source == PositionSource::kFused; }

  void OnDetections(const DetectionArray& message) {
    if (!reporter_->HasMounting(message.header.frame_id)) wanted_frame_ = message.header.frame_id;
    LearnMounting();
    const SightingFrame frame = ToSightingFrame(message);
    responder_->AddFrame(frame, ros::Time::now().toSec());
    reporter_->AddFrame(frame, ros::Time::now().toSec());
    Work();
  }

  void OnAnnotated(const sensor_msgs::ImageConstPtr& message) {
    try {
      // Shares the pixels with the detector's message where it is bgr8 already.
      const auto shared = cv_bridge::toCvShare(message, sensor_msgs::image_encodings::BGR8);
      const auto owner = std::make_shared<const cv_bridge::CvImageConstPtr>(shared);
      const Picture picture{shared->image, owner};
      responder_->AddPicture(FromRosTime(message->header.stamp), picture);
      reporter_->AddPicture(FromRosTime(message->header.stamp), picture);
    } catch (const cv::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "annotated image dropped: %s", error.what());
    } catch (const cv_bridge::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "annotated image dropped: %s", error.what());
    }
    Work();
  }

  void OnFix(const sensor_msgs::NavSatFix& message) {
    const auto before_ns = reporter_->track().newest_ns();
    reporter_->AddFix(ToFix(message));
    const auto newest_ns = reporter_->track().newest_ns();
    const bool by_fixes = !IsFused() || IsFusionSilent(*reporter_);
    if (by_fixes && newest_ns && newest_ns != before_ns) ShowFix(*newest_ns);
    Work();
  }

  /// A fused pose of base_link in the map frame.
  void OnPose(const nav_msgs::Odometry& message) {
    LearnDatum();
    if (!map_ || message.header.frame_id != config_.map_frame ||
        message.child_frame_id != config_.base_frame) {
      NODELET_WARN_THROTTLE(kSayAgainS,
                            "dropped a fused pose of '%s' in '%s': wanted is '%s' in '%s' and tf "
                            "from 'earth' to the latter",
                            message.child_frame_id.c_str(), message.header.frame_id.c_str(),
                            config_.base_frame.c_str(), config_.map_frame.c_str());
      return;
    }
    const std::int64_t stamp_ns = FromRosTime(message.header.stamp);
    const TrackPose pose = ToTrackPose(message, *map_);
    reporter_->AddPose(stamp_ns, pose);
    if (reporter_->poses().newest_ns() == stamp_ns) {
      TellPosition(pose, stamp_ns);
      ShowVehicle(pose, message.header.stamp);
    }
    Work();
  }

  void OnDepth(const sensor_msgs::ImageConstPtr& message) {
    namespace encodings = sensor_msgs::image_encodings;
    const std::string& encoding = message->encoding;
    if (encoding != encodings::TYPE_16UC1 && encoding != encodings::MONO16 &&
        encoding != encodings::TYPE_32FC1) {
      NODELET_WARN_THROTTLE(kSayAgainS,
                            "depth has encoding '%s', accepted are 16UC1 and 32FC1: dropped",
                            encoding.c_str());
      return;
    }
    try {
      const auto shared = cv_bridge::toCvShare(message);
      const auto owner = std::make_shared<const cv_bridge::CvImageConstPtr>(shared);
      reporter_->AddDepth(FromRosTime(message->header.stamp),
                          {shared->image, config_.depth_units_per_m, owner});
    } catch (const cv::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "depth image dropped: %s", error.what());
    } catch (const cv_bridge::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "depth image dropped: %s", error.what());
    }
    Work();
  }

  void OnCameraInfo(const sensor_msgs::CameraInfo& message) {
    try {
      reporter_->SetIntrinsics(ToRectifiedIntrinsics(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped: %s", error.what());
    }
  }

  void OnNotice(const HazardNotice& message) {
    try {
      reporter_->AddNotice(FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  void OnReceipt(const ReportReceipt& message) {
    try {
      const Receipt receipt = FromMessage(message);
      if (receipt.status == Receipt::Status::kRefused) {
        NODELET_WARN_THROTTLE(kSayAgainS, "the zone refused report %s: %s",
                              receipt.report_uuid.ToString().c_str(), receipt.reason.c_str());
      }
      reporter_->AddReceipt(receipt);
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  void OnPoll(const HazardPoll& message) {
    try {
      responder_->Add(FromMessage(message), SteadyS());
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  void OnTick(const ros::SteadyTimerEvent&) {
    LearnMounting();
    Work();
  }

  void Work() {
    reporter_->Process(ros::Time::now().toSec(), SteadyS());
    if (!reporter_->store_error().empty()) {
      NODELET_ERROR_THROTTLE(kSayAgainS, "%s", reporter_->store_error().c_str());
    }
    const std::uint64_t by_fixes = reporter_->counters().placed_by_fixes;
    if (IsFused() && by_fixes > placed_by_fixes_) {
      NODELET_WARN_THROTTLE(kSayAgainS, "no fused pose of an image: hazards placed by the fixes");
    }
    placed_by_fixes_ = by_fixes;
    AnswerPolls();
    // Without a listener a report would be spent, not sent.
    if (report_publisher_.getNumSubscribers() == 0) return;
    for (const Report& report : reporter_->TakeDue(SteadyS(), kSendPerTick)) {
      report_publisher_.publish(ToMessage(report));
    }
  }

  void AnswerPolls() {
    PollResponder::Vehicle vehicle;
    vehicle.intrinsics = reporter_->intrinsics();
    vehicle.mounting = [this](const std::string& frame_id) {
      return reporter_->Mounting(frame_id);
    };
    vehicle.pose_at = [this](std::int64_t stamp_ns) { return reporter_->BasePoseAt(stamp_ns); };
    responder_->Process(ros::Time::now().toSec(), SteadyS(), vehicle);
    for (const PollReply& reply : responder_->TakeReplies()) {
      answer_publisher_.publish(ToMessage(reply));
    }
  }

  /// The mounting does not change: looked up until it is known, then kept.
  void LearnMounting() {
    if (wanted_frame_.empty()) return;
    try {
      const auto transform =
          tf_buffer_.lookupTransform(config_.base_frame, wanted_frame_, ros::Time(0));
      reporter_->SetMounting(wanted_frame_, tf2::transformToEigen(transform));
      wanted_frame_.clear();
    } catch (const tf2::TransformException& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "no mounting of the camera yet: %s", error.what());
    }
  }

  /// The datum of the map frame is that of its owner, the localisation: tf earth -> map.
  void LearnDatum() {
    try {
      const auto transform =
          tf_buffer_.lookupTransform("earth", config_.map_frame, ros::Time(0)).transform;
      if (map_ && earth_from_map_ == transform) return;
      map_.emplace(DatumOf(Eigen::Isometry3d(tf2::transformToEigen(transform))));
      earth_from_map_ = transform;
      path_.poses.clear();
    } catch (const tf2::TransformException&) {
      // Whoever needs the map says that it is missing.
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  /// Where the newest fix is, on vehicle/position and on the map.
  void ShowFix(std::int64_t stamp_ns) {
    const auto antenna = reporter_->track().Newest();
    TellPosition(*antenna, stamp_ns);
    if (!map_ && !IsFused()) map_.emplace(antenna->position);
    const auto at_stamp = reporter_->track().At(stamp_ns);
    if (!map_ || at_stamp.answer != FixTrack::Answer::kReady) return;
    const Eigen::Vector2d antenna_m(config_.reporter.antenna_x_m, config_.reporter.antenna_y_m);
    const GroundPoint origin{Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero()};
    TrackPose base = at_stamp.pose;
    base.position = PlaceHazard(base, antenna_m, origin).position;
    ShowVehicle(base, ToRosTime(stamp_ns));
  }

  void TellPosition(const TrackPose& pose, std::int64_t stamp_ns) {
    const ros::Time stamp = ToRosTime(stamp_ns);
    const bool due = !position_stamp_ || stamp < *position_stamp_ ||
                     stamp - *position_stamp_ >= ros::Duration(config_.position_period_s);
    if (!due) return;
    position_stamp_ = stamp;
    const VehicleState vehicle{
        "", config_.reporter.drive_id, pose.position, pose.course_rad, pose.speed_mps, stamp_ns};
    const double sigma_m = std::sqrt(pose.covariance_m2.trace() / 2);
    position_publisher_.publish(ToMessage(vehicle, sigma_m, reporter_->map().map_sequence()));
  }

  /// base_link on the path, and on tf where no odometry does it.
  void ShowVehicle(const TrackPose& base, const ros::Time& stamp) {
    const Eigen::Vector2d base_m = map_->ToEnu(base.position);
    const auto pose = VehiclePose(base_m, base.course_rad, config_.map_frame, stamp);
    if (config_.publish_tf) {
      geometry_msgs::TransformStamped transform;
      transform.header = pose.header;
      transform.child_frame_id = config_.base_frame;
      transform.transform.translation.x = base_m.x();
      transform.transform.translation.y = base_m.y();
      transform.transform.rotation = pose.pose.orientation;
      tf_broadcaster_.sendTransform(transform);
    }
    if (!path_.poses.empty()) {
      const auto& last = path_.poses.back().pose.position;
      if (std::hypot(base_m.x() - last.x, base_m.y() - last.y) < config_.path_spacing_m) return;
    }
    path_.header.stamp = stamp;
    path_.poses.push_back(pose);
    if (path_.poses.size() > static_cast<std::size_t>(config_.path_max_poses)) {
      path_.poses.erase(path_.poses.begin());
    }
  }

  void OnViewTimer(const ros::SteadyTimerEvent&) {
    if (path_publisher_.getNumSubscribers() > 0) path_publisher_.publish(path_);
    if (marker_publisher_.getNumSubscribers() == 0 || !map_) return;
    const auto known = reporter_->map().Known(static_cast<std::size_t>(config_.max_markers));
    marker_publisher_.publish(
        HazardMarkers(known, catalogue_, *map_, config_.map_frame, ros::Time::now()));
  }

  // Not the updater's own timer: that one follows the simulated clock.
  void OnDiagnosticsTimer(const ros::SteadyTimerEvent&) { updater_->force_update(); }

  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    DescribeHazardReporter(*reporter_, status);
    DescribePollResponder(*responder_, status);
  }

  HazardReportingConfig config_;
  HazardCatalogue catalogue_;
  std::unique_ptr<HazardReporter> reporter_;
  std::unique_ptr<PollResponder> responder_;
  std::optional<LocalFrame> map_;
  geometry_msgs::Transform earth_from_map_;  // By which map_ was made, if it was.
  std::uint64_t placed_by_fixes_ = 0;        // When it was last looked at.
  std::optional<ros::Time> position_stamp_;
  std::string wanted_frame_;  // Optical frame whose mounting is not known yet.
  nav_msgs::Path path_;
  tf2_ros::Buffer tf_buffer_;
  std::unique_ptr<tf2_ros::TransformListener> tf_listener_;
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  std::unique_ptr<diagnostic_updater::Updater> updater_;
  ros::Publisher report_publisher_, position_publisher_, answer_publisher_;
  ros::Publisher marker_publisher_, path_publisher_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::SteadyTimer> timers_;
};

}  // namespace livemap

PLUGINLIB_EXPORT_CLASS(livemap::HazardReportingNodelet, nodelet::Nodelet)
