#include <cv_bridge/cv_bridge.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <image_transport/image_transport.h>
#include <livemap/CandidateFrame.h>
#include <nav_msgs/Odometry.h>
#include <nodelet/nodelet.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/image_encodings.h>

#include <boost/function.hpp>
#include <boost/make_shared.hpp>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <thread>

#include "common/frame_queue.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/vehicle_tf.h"
#include "perception/detection/early_discard.h"
#include "perception/privacy/privacy_mask.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/offload_conversions.h"
#include "ros/parameters/offload_parameters.h"
#include "vehicle/reporting/offload_sender.h"

namespace livemap::nodelets {
namespace {

constexpr double kSendPeriodS = 0.05;

}  // namespace

/// The small vehicle's camera side (thesis, section 3.2.4): EarlyDiscard and OffloadSender with
/// topics, tf and clocks. One worker thread classifies; all else runs in the nodelet's own queue,
/// one callback at a time: what is worth sending is masked, encoded and published there once its
/// pose is known.
class EarlyDiscardNodelet : public nodelet::Nodelet {
 public:
  ~EarlyDiscardNodelet() override {
    for (ros::SteadyTimer& timer : timers_) timer.stop();
    image_subscriber_.shutdown();
    if (queue_) queue_->Close();
    if (worker_.joinable()) worker_.join();
  }

 private:
  using Clock = std::chrono::steady_clock;
  using Queue = FrameQueue<sensor_msgs::ImageConstPtr>;

  void onInit() override {
    InitializeOrExplain(getName(), [this] { Initialize(); });
  }

  void Initialize() {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadEarlyDiscardConfig(
        parameters, static_cast<std::int64_t>(ros::WallTime::now().toNSec()));
    discard_ = std::make_unique<perception::EarlyDiscard>(
        perception::ReadModelManifest(config_.model), config_.threads);
    threshold_ =
        config_.threshold < 0 ? discard_->threshold() : static_cast<float>(config_.threshold);
    if (config_.privacy) mask_ = std::make_unique<perception::PrivacyMask>(config_.mask);
    sender_ = std::make_unique<vehicle::OffloadSender>(config_.sender);
    queue_ = std::make_unique<Queue>(static_cast<std::size_t>(config_.queue_size));
    Connect();
    worker_ = std::thread([this] { Work(); });
  }

  void Connect() {
    using Self = EarlyDiscardNodelet;
    ros::NodeHandle& node = getNodeHandle();
    publisher_ = node.advertise<CandidateFrame>("candidate/frame", 100);
    vehicle_frames_ =
        std::make_unique<VehicleTf>(node, getName(), config_.map_frame, config_.base_frame);
    subscribers_ = {
        node.subscribe("fix", 100, &Self::OnFix, this),
        node.subscribe("camera_rect/camera_info", 1, &Self::OnCameraInfo, this),
    };
    if (config_.sender.pose.use_fused) {
      subscribers_.push_back(node.subscribe("localization/odometry", 100, &Self::OnPose, this));
    }
    updater_ =
        std::make_unique<diagnostic_updater::Updater>(node, getPrivateNodeHandle(), getName());
    updater_->setHardwareID("early_discard");
    updater_->add("early_discard", this, &Self::Diagnose);
    // Steady time: a replay that stands still must not silence the nodelet.
    timers_ = {
        node.createSteadyTimer(ros::WallDuration(kSendPeriodS), &Self::OnSendTimer, this),
        node.createSteadyTimer(ros::WallDuration(config_.diagnostics_period_s),
                               &Self::OnDiagnosticsTimer, this),
    };
    image_transport::ImageTransport transport(node);
    const image_transport::TransportHints hints("raw", ros::TransportHints().tcpNoDelay(),
                                                getPrivateNodeHandle());
    // No bound of ROS's, which would lose frames without a word: the queue has one, and counts.
    image_subscriber_ = transport.subscribe(
        "camera_rect/image", 0,
        boost::function<void(const sensor_msgs::ImageConstPtr&)>(
            [this](const sensor_msgs::ImageConstPtr& image) { OnImage(image); }),
        ros::VoidPtr(), hints);
  }

  void OnImage(const sensor_msgs::ImageConstPtr& image) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++frame_;
    LearnMounting(image->header.frame_id);
    if (sender_->Takes(ros_io::FromRosTime(image->header.stamp))) queue_->Push(image);
  }

  void OnFix(const sensor_msgs::NavSatFix& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    sender_->AddFix(ros_io::ToFix(message));
  }

  void OnPose(const nav_msgs::Odometry& message) {
    const std::optional<geo::TrackPose> pose = vehicle_frames_->FusedPose(message);
    if (!pose) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    sender_->AddPose(ros_io::FromRosTime(message.header.stamp), *pose);
  }

  void OnCameraInfo(const sensor_msgs::CameraInfo& message) {
    try {
      const geo::CameraIntrinsics intrinsics = ros_io::ToRectifiedIntrinsics(message);
      const std::lock_guard<std::mutex> lock(mutex_);
      sender_->SetIntrinsics(intrinsics);
    } catch (const Error& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped: %s", error.what());
    }
  }

  /// The mounting does not change: looked up until it is known, then kept. The mutex is held.
  void LearnMounting(const std::string& frame_id) {
    if (sender_->HasMounting(frame_id)) return;
    const auto mounting = vehicle_frames_->Mounting(frame_id);
    if (mounting) sender_->SetMounting(frame_id, *mounting);
  }

  void Work() {
    while (const std::optional<sensor_msgs::ImageConstPtr> image = queue_->Pop()) {
      try {
        Judge(*image);
        queue_->Done();
      } catch (const std::exception& error) {
        queue_->Unusable();
        NODELET_ERROR_THROTTLE(kSayAgainS, "dropped an image of %s: %s",
                               image_subscriber_.getTopic().c_str(), error.what());
      }
    }
  }

  void Judge(const sensor_msgs::ImageConstPtr& image) {
    const Clock::time_point start = Clock::now();
    const auto shared = cv_bridge::toCvShare(image, sensor_msgs::image_encodings::BGR8);
    const float score = discard_->Score(shared->image);
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    const auto owner = std::make_shared<const cv_bridge::CvImageConstPtr>(shared);
    const std::lock_guard<std::mutex> lock(mutex_);
    sender_->AddJudged(ros_io::FromRosTime(image->header.stamp), image->header.frame_id, score,
                       score >= threshold_, {shared->image, owner}, ros::Time::now().toSec());
    ++judged_in_window_;
    ms_in_window_ += ms;
  }

  void OnSendTimer(const ros::SteadyTimerEvent&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    // Without a listener a frame would be spent, not sent.
    if (publisher_.getNumSubscribers() == 0) return;
    const auto encode = [this](const imaging::Picture& picture, std::size_t max_bytes) {
      return MaskedJpeg(picture, max_bytes);
    };
    for (const protocol::OffloadedFrame& candidate :
         sender_->TakeReady(ros::Time::now().toSec(), encode)) {
      publisher_.publish(boost::make_shared<CandidateFrame>(ros_io::ToMessage(candidate)));
    }
  }

  /// What leaves the car; empty when it cannot be masked: it fails closed.
  std::vector<std::uint8_t> MaskedJpeg(const imaging::Picture& picture, std::size_t max_bytes) {
    imaging::Picture masked = picture;
    if (mask_) {
      masked.bgr = picture.bgr.clone();
      try {
        mask_->Apply(masked.bgr, frame_);
      } catch (const std::exception& error) {
        NODELET_ERROR_THROTTLE(kSayAgainS, "a frame is withheld: %s", error.what());
        return {};
      }
      masked_regions_ += mask_->Masked().size();
    }
    return imaging::EncodeJpeg(masked, config_.jpeg_quality, max_bytes);
  }

  void OnDiagnosticsTimer(const ros::SteadyTimerEvent&) { updater_->force_update(); }

  void Diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    const Queue::Counters queue = queue_->counters();
    const std::lock_guard<std::mutex> lock(mutex_);
    const vehicle::OffloadSender::Counters& counters = sender_->counters();
    if (counters.withheld > withheld_said_) {
      status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, "frames are withheld: no mask");
    } else if (queue.dropped > dropped_said_) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "behind: dropping frames");
    } else if (judged_in_window_ == 0) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "no frames");
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    }
    withheld_said_ = counters.withheld;
    dropped_said_ = queue.dropped;
    status.add("frames_in", counters.frames);
    status.add("frames_skipped", counters.rate_skipped);
    status.add("frames_judged", queue.processed);
    status.add("frames_dropped", queue.dropped);  // Unusable ones among them.
    status.add("frames_discarded", counters.discarded);
    status.add("candidates", counters.candidates);
    status.add("candidates_waiting", sender_->waiting());
    status.add("candidates_sent", counters.sent);
    status.add("candidates_sent_bytes", counters.sent_bytes);
    status.add("candidates_same_place", counters.same_place);
    status.add("candidates_over_budget", counters.over_budget);
    status.add("candidates_no_pose", counters.no_pose);
    status.add("candidates_no_camera", counters.no_camera);
    status.add("candidates_displaced", counters.displaced);
    status.add("candidates_withheld", counters.withheld);
    status.add("regions_masked", masked_regions_);
    status.add("judging_ms", judged_in_window_ > 0
                                 ? ms_in_window_ / static_cast<double>(judged_in_window_)
                                 : 0.0);
    status.add("threshold", threshold_);
    status.add("model", discard_->manifest().name);
    judged_in_window_ = 0;
    ms_in_window_ = 0;
  }

  ros_io::EarlyDiscardConfig config_;
  float threshold_ = 0;
  std::unique_ptr<perception::EarlyDiscard> discard_;  // The worker's.
  std::unique_ptr<perception::PrivacyMask> mask_;      // The send timer's; none: privacy is off.
  std::unique_ptr<Queue> queue_;
  std::unique_ptr<VehicleTf> vehicle_frames_;
  ros::Publisher publisher_;
  std::vector<ros::Subscriber> subscribers_;
  image_transport::Subscriber image_subscriber_;
  std::vector<ros::SteadyTimer> timers_;
  std::unique_ptr<diagnostic_updater::Updater> updater_;
  std::uint64_t withheld_said_ = 0;
  std::uint64_t dropped_said_ = 0;
  std::thread worker_;

  std::mutex mutex_;  ///< Guards the rest.
  std::unique_ptr<vehicle::OffloadSender> sender_;
  std::uint64_t frame_ = 0;  ///< The camera's, for the mask's memory.
  std::uint64_t masked_regions_ = 0;
  std::uint64_t judged_in_window_ = 0;
  double ms_in_window_ = 0;
};

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::EarlyDiscardNodelet, nodelet::Nodelet)
