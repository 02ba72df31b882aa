#include <cv_bridge/cv_bridge.h>
#include <livemap/PicturePart.h>
#include <livemap/PictureRequest.h>
#include <nav_msgs/Odometry.h>
#include <nodelet/nodelet.h>
#include <ros/package.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "nodelets/diagnostics.h"
#include "nodelets/hazard_reporting/vehicle_view.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/vehicle_tf.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/conversions/depth_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/localization_conversions.h"
#include "ros/conversions/poll_conversions.h"
#include "ros/parameters/hazard_reporting_parameters.h"
#include "ros/views/hazard_view.h"
#include "vehicle/polls/poll_responder.h"
#include "vehicle/reporting/hazard_reporter.h"

namespace livemap::nodelets {
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
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadHazardReportingConfig(parameters, now_ns);
    if (config_.catalogue.empty()) {
      config_.catalogue = ros::package::getPath("livemap") + "/config/hazards.yaml";
    }
    catalogue_ = protocol::HazardCatalogue::Load(config_.catalogue);
    MakeDirectoryOf(config_.reporter.map.path);
    reporter_ = std::make_unique<vehicle::HazardReporter>(
        config_.reporter, catalogue_, EntropySeededGenerator(), now_ns, SteadyS());
    responder_ = std::make_unique<vehicle::PollResponder>(config_.polls, catalogue_);
    if (!reporter_->map().set_aside().empty()) {
      NODELET_ERROR("%s",
                    ros_io::DescribeSetAside(config_.reporter.map.path, reporter_->map()).c_str());
    }
    if (reporter_->map().broken_rows().count() > 0) {
      NODELET_ERROR(
          "%s", ros_io::DescribeBrokenRows(config_.reporter.map.path, reporter_->map()).c_str());
    }
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
    answer_publisher_ = node.advertise<HazardPollAnswer>("hazard/poll_answer", 100);
    request_publisher_ = node.advertise<PictureRequest>("hazard/picture_request", 100);
    view_ = std::make_unique<VehicleView>(config_, *reporter_, catalogue_, node);
    vehicle_tf_ =
        std::make_unique<VehicleTf>(node, getName(), config_.map_frame, config_.base_frame);
    mountings_ = std::make_unique<MountingLearner>(
        *vehicle_tf_, [this](const std::string& frame, const Eigen::Isometry3d& mounting) {
          reporter_->SetMounting(frame, mounting);
        });
    subscribers_ = {
        node.subscribe("hazard/detections", 100, &Self::OnDetections, this),
        node.subscribe("link_state", 1, &Self::OnLink, this),
        node.subscribe("fix", 100, &Self::OnFix, this),
        node.subscribe("camera_rect/camera_info", 1, &Self::OnCameraInfo, this),
        node.subscribe("hazard/notice", 10000, &Self::OnNotice, this),
        node.subscribe("hazard/receipt", 1000, &Self::OnReceipt, this),
        node.subscribe("hazard/poll", 100, &Self::OnPoll, this),
        node.subscribe("change/report", 100, &Self::OnChanges, this),
    };
    if (config_.use_events) {
      subscribers_.push_back(node.subscribe("hazard/events", 100, &Self::OnEvents, this));
    }
    // Whoever listens to hazard/annotated has every frame drawn and masked: not where pictures come
    // on demand.
    const bool on_demand = config_.reporter.pictures_on_demand;
    picture_subscriber_ = node.subscribe(on_demand ? "hazard/picture" : "hazard/annotated", 10,
                                         &Self::OnPicture, this);
    if (on_demand) {
      part_subscriber_ = node.subscribe("hazard/picture_part", 10, &Self::OnPicturePart, this);
    }
    if (IsFused()) {
      subscribers_.push_back(node.subscribe("localization/odometry", 100, &Self::OnPose, this));
    }
    if (config_.reporter.use_depth) {
      subscribers_.push_back(node.subscribe("camera/depth/image_raw", 10, &Self::OnDepth, this));
    }
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "hazard_reporting", "hazard reporting",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
    timers_ = {
        node.createSteadyTimer(ros::WallDuration(kSendTickS), &Self::OnTick, this),
        node.createSteadyTimer(ros::WallDuration(kViewPeriodS), &Self::OnViewTimer, this),
    };
  }

  bool IsFused() const {
    return config_.reporter.position_source == vehicle::PositionSource::kFused;
  }

  void OnDetections(const DetectionArray& message) {
    mountings_->Want(message.header.frame_id);
    const placement::SightingFrame frame = ros_io::ToSightingFrame(message);
    responder_->AddFrame(frame, ros::Time::now().toSec());
    if (!config_.use_events) reporter_->AddFrame(frame, ros::Time::now().toSec());
    Work();
  }

  /// Objects that the tracker is sure of, at their best view.
  void OnEvents(const DetectionArray& message) {
    mountings_->Want(message.header.frame_id);
    reporter_->AddFrame(ros_io::ToSightingFrame(message), ros::Time::now().toSec());
    Work();
  }

  void OnPicture(const sensor_msgs::ImageConstPtr& message) {
    if (const auto picture = Shared(*message, message)) {
      responder_->AddPicture(ros_io::FromRosTime(message->header.stamp), *picture);
      reporter_->AddPicture(ros_io::FromRosTime(message->header.stamp), *picture);
    }
    Work();
  }

  void OnPicturePart(const PicturePartConstPtr& message) {
    const auto& part = message->part;
    if (const auto picture = Shared(message->image, message)) {
      reporter_->AddPicture(ros_io::FromRosTime(message->image.header.stamp), *picture,
                            {part.x_offset, part.y_offset, part.width, part.height});
    }
    Work();
  }

  /// Shares the pixels with the detector's message where it is bgr8 already.
  template <typename Message>
  std::optional<imaging::Picture> Shared(const sensor_msgs::Image& image,
                                         const boost::shared_ptr<const Message>& message) {
    try {
      const auto shared = cv_bridge::toCvShare(image, message, sensor_msgs::image_encodings::BGR8);
      return imaging::Picture{shared->image,
                              std::make_shared<const cv_bridge::CvImageConstPtr>(shared)};
    } catch (const cv::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "picture dropped: %s", error.what());
    } catch (const cv_bridge::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "picture dropped: %s", error.what());
    }
    return std::nullopt;
  }

  /// Only while a poll is open, and only for its brightness.
  void OnImage(const sensor_msgs::ImageConstPtr& message) {
    try {
      const auto grey = cv_bridge::toCvShare(message, sensor_msgs::image_encodings::MONO8);
      responder_->AddLuminance(ros_io::FromRosTime(message->header.stamp),
                               vehicle::PollResponder::MeanLuminance(grey->image));
    } catch (const cv::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "image not looked at: %s", error.what());
    } catch (const cv_bridge::Exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "image not looked at: %s", error.what());
    }
  }

  void OnLink(const LinkState& message) {
    try {
      reporter_->SetLink(ros_io::FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
    Work();
  }

  void OnFix(const sensor_msgs::NavSatFix& message) {
    const auto before_ns = reporter_->track().newest_ns();
    reporter_->AddFix(ros_io::ToFix(message));
    const auto newest_ns = reporter_->track().newest_ns();
    const bool by_fixes = !IsFused() || ros_io::IsFusionSilent(*reporter_);
    if (by_fixes && newest_ns && newest_ns != before_ns) view_->ShowFix(*newest_ns);
    Work();
  }

  /// A fused pose of base_link in the map frame.
  void OnPose(const nav_msgs::Odometry& message) {
    view_->LearnDatum(vehicle_tf_->buffer());
    if (!view_->map() || message.header.frame_id != config_.map_frame ||
        message.child_frame_id != config_.base_frame) {
      NODELET_WARN_THROTTLE(kSayAgainS,
                            "dropped a fused pose of '%s' in '%s': wanted is '%s' in '%s' and tf "
                            "from 'earth' to the latter",
                            message.child_frame_id.c_str(), message.header.frame_id.c_str(),
                            config_.base_frame.c_str(), config_.map_frame.c_str());
      return;
    }
    const std::int64_t stamp_ns = ros_io::FromRosTime(message.header.stamp);
    const geo::TrackPose pose = ros_io::ToTrackPose(message, *view_->map());
    reporter_->AddPose(stamp_ns, pose);
    if (reporter_->poses().newest_ns() == stamp_ns) view_->ShowPose(pose, message.header.stamp);
    Work();
  }

  void OnDepth(const sensor_msgs::ImageConstPtr& message) {
    try {
      const cv_bridge::CvImageConstPtr shared = ros_io::ToSharedDepth(message);
      const auto owner = std::make_shared<const cv_bridge::CvImageConstPtr>(shared);
      reporter_->AddDepth(ros_io::FromRosTime(message->header.stamp),
                          {shared->image, config_.depth_units_per_m, owner});
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped: %s", error.what());
    }
    Work();
  }

  void OnCameraInfo(const sensor_msgs::CameraInfo& message) {
    try {
      reporter_->SetIntrinsics(ros_io::ToRectifiedIntrinsics(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped: %s", error.what());
    }
  }

  void OnNotice(const HazardNotice& message) {
    try {
      reporter_->AddNotice(ros_io::FromMessage(message));
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  void OnReceipt(const ReportReceipt& message) {
    try {
      const protocol::Receipt receipt = ros_io::FromMessage(message);
      if (receipt.status == protocol::Receipt::Status::kRefused) {
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
      responder_->Add(ros_io::FromMessage(message), SteadyS());
      WatchImages();
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "%s", error.what());
    }
  }

  /// Has a say in what polls are answered.
  void OnChanges(const ChangedObjects& message) {
    if (message.outcome == ChangedObjects::REFUSED) responder_->AddUnregistered();
    for (const vehicle::ChangeEvidence& evidence : ros_io::ToEvidence(message))
      responder_->AddChange(evidence);
  }

  void OnTick(const ros::SteadyTimerEvent&) {
    mountings_->Retry();
    Work();
  }

  void Work() {
    reporter_->SetPictureSourceAvailable(picture_subscriber_.getNumPublishers() > 0 ||
                                         part_subscriber_.getNumPublishers() > 0);
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
    for (const imaging::PictureRequirements& wish : reporter_->TakePictureRequests())
      RequestPicture(wish);
    // Without a listener a report would be spent, not sent.
    if (report_publisher_.getNumSubscribers() == 0) return;
    for (const protocol::Report& report : reporter_->TakeDue(SteadyS(), kSendPerTick)) {
      report_publisher_.publish(ros_io::ToMessage(report));
    }
  }

  void AnswerPolls() {
    vehicle::PollResponder::Vehicle vehicle;
    vehicle.intrinsics = reporter_->intrinsics();
    vehicle.mounting = [this](const std::string& frame_id) {
      return reporter_->Mounting(frame_id);
    };
    vehicle.pose_at = [this](std::int64_t stamp_ns, double waited_s) {
      return reporter_->vehicle_poses().At(stamp_ns, waited_s, responder_->PosePatience());
    };
    responder_->Process(ros::Time::now().toSec(), SteadyS(), vehicle);
    for (const protocol::PollAnswer& reply : responder_->TakeReplies()) {
      answer_publisher_.publish(ros_io::ToMessage(reply));
    }
    for (const std::int64_t stamp_ns : responder_->TakePictureRequests()) {
      RequestPicture({stamp_ns, {}});
    }
    WatchImages();
  }

  void RequestPicture(const imaging::PictureRequirements& wish) {
    PictureRequest request;
    request.stamp = ros_io::ToRosTime(wish.stamp_ns);
    request.part.x_offset = wish.part.x;
    request.part.y_offset = wish.part.y;
    request.part.width = wish.part.width;
    request.part.height = wish.part.height;
    request_publisher_.publish(request);
  }

  /// Listens to the camera's images while a poll is open.
  void WatchImages() {
    const bool wanted = config_.use_events && responder_->open() > 0;
    if (wanted == static_cast<bool>(images_)) return;
    images_ = wanted ? getNodeHandle().subscribe("camera_rect/image", 2,
                                                 &HazardReportingNodelet::OnImage, this)
                     : ros::Subscriber();
  }

  void OnViewTimer(const ros::SteadyTimerEvent&) { view_->Publish(); }

  void Diagnose(Diagnostics::Status& status) {
    ros_io::DescribeHazardReporter(*reporter_, SteadyS(), status);
    ros_io::DescribePollResponder(*responder_, status);
  }

  ros_io::HazardReportingConfig config_;
  protocol::HazardCatalogue catalogue_;
  std::unique_ptr<vehicle::HazardReporter> reporter_;
  std::unique_ptr<vehicle::PollResponder> responder_;
  std::unique_ptr<VehicleView> view_;
  std::uint64_t placed_by_fixes_ = 0;  // When it was last looked at.
  std::unique_ptr<VehicleTf> vehicle_tf_;
  std::unique_ptr<MountingLearner> mountings_;
  ros::Publisher report_publisher_, answer_publisher_, request_publisher_;
  ros::Subscriber images_;  // While a poll is open.
  ros::Subscriber picture_subscriber_;
  ros::Subscriber part_subscriber_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::SteadyTimer> timers_;
  std::unique_ptr<Diagnostics> diagnostics_;  // Last: it uses the rest.
};

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::HazardReportingNodelet, nodelet::Nodelet)
