#include <cv_bridge/cv_bridge.h>
#include <livemap/CandidateFrame.h>
#include <sensor_msgs/image_encodings.h>

#include <boost/make_shared.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <thread>

#include "common/mutex.h"
#include "common/queues/frame_queue.h"
#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/picture_masks.h"
#include "nodelets/vehicle_feed.h"
#include "perception/detection/early_discard.h"
#include "perception/privacy/picture_masker.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/offload_conversions.h"
#include "ros/parameters/early_discard_parameters.h"
#include "vehicle/reporting/offload_sender.h"

namespace livemap::nodelets {
namespace {

constexpr double kSendPeriodS = 0.05;

}  // namespace

/// The small vehicle's camera side (thesis, section 3.2.4): EarlyDiscard and OffloadSender with
/// topics, tf and clocks. One worker thread classifies; all else runs in the nodelet's own queue,
/// one callback at a time: what is worth sending is masked, encoded and published there once its
/// pose is known.
class EarlyDiscardPart : public NodeletPart {
 public:
  ~EarlyDiscardPart() override {
    diagnostics_.reset();
    send_timer_.stop();
    if (feed_) feed_->StopImages();
    if (queue_) queue_->Close();
    if (worker_.joinable()) worker_.join();
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Taken {
    sensor_msgs::ImageConstPtr image;
    std::uint64_t number = 0;  ///< Of CountFrame.
  };
  using Queue = FrameQueue<Taken>;

  void Initialize() override {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadEarlyDiscardConfig(
        parameters, static_cast<std::int64_t>(ros::WallTime::now().toNSec()));
    discard_ = std::make_unique<perception::EarlyDiscard>(
        perception::ReadModelManifest(config_.model), config_.threads);
    threshold_ =
        config_.threshold < 0 ? discard_->threshold() : static_cast<float>(config_.threshold);
    masker_ = std::make_unique<perception::PictureMasker>(
        MakeMaskerConfig(config_.privacy, config_.mask));
    SayWhatFindsFaces(getName(), *masker_);
    sender_ = std::make_unique<vehicle::OffloadSender>(config_.sender);
    queue_ = std::make_unique<Queue>(static_cast<std::size_t>(config_.queue_size));
    Connect();
    worker_ = std::thread([this] { Work(); });
  }

  void Connect() {
    using Self = EarlyDiscardPart;
    ros::NodeHandle& node = getNodeHandle();
    publisher_ = node.advertise<CandidateFrame>("candidate/frame", 100);
    // First: the callbacks of the others use it.
    MakeFeed();
    // Steady time: a replay that stands still must not keep back what has come.
    send_timer_ = node.createSteadyTimer(ros::WallDuration(kSendPeriodS), &Self::OnSendTimer, this);
    diagnostics_ = std::make_unique<Diagnostics>(
        node, getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "early_discard", "early_discard",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  void MakeFeed() {
    VehicleFeed::Handlers handlers;
    handlers.on_fix = [this](const geo::Fix& fix) {
      mutex_.AssertHeld();
      sender_->AddFix(fix, RosNowNs());
    };
    handlers.on_pose = [this](std::int64_t stamp_ns, const geo::TrackPose& pose) {
      mutex_.AssertHeld();
      sender_->AddPose(stamp_ns, pose, RosNowNs());
    };
    handlers.on_intrinsics = [this](const geo::CameraIntrinsics& intrinsics) {
      mutex_.AssertHeld();
      sender_->SetIntrinsics(intrinsics);
    };
    handlers.on_mounting = [this](const std::string& frame, const Eigen::Isometry3d& mounting) {
      mutex_.AssertHeld();
      sender_->SetMounting(frame, mounting);
    };
    handlers.on_image = [this](const sensor_msgs::ImageConstPtr& image) {
      mutex_.AssertHeld();
      const std::uint64_t number = masker_->CountFrame();
      if (sender_->Takes(ros_io::FromRosTime(image->header.stamp))) queue_->Push({image, number});
    };
    handlers.on_time_reset = [this] {
      mutex_.AssertHeld();
      sender_->StartAnew();
    };
    feed_ = std::make_unique<VehicleFeed>(
        getNodeHandle(), getPrivateNodeHandle(),
        VehicleFeed::Config{getName(), config_.map_frame, config_.base_frame,
                            config_.sender.pose.use_fused,
                            config_.sender.pose.fixes.stamps.max_ahead_s},
        mutex_, std::move(handlers));
  }

  void Work() {
    while (const std::optional<Taken> taken = queue_->Pop()) {
      try {
        Judge(*taken);
        queue_->Done();
      } catch (const std::exception& error) {
        queue_->Unusable();
        NODELET_ERROR_THROTTLE(kSayAgainS, "dropped an image of %s: %s",
                               feed_->image_topic().c_str(), error.what());
      }
    }
  }

  void Judge(const Taken& taken) {
    const Clock::time_point start = Clock::now();
    const auto shared = cv_bridge::toCvShare(taken.image, sensor_msgs::image_encodings::BGR8);
    const float score = discard_->Score(shared->image);
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    const auto owner = std::make_shared<const cv_bridge::CvImageConstPtr>(shared);
    const MutexLock lock(mutex_);
    const std_msgs::Header& header = taken.image->header;
    sender_->AddJudged(ros_io::FromRosTime(header.stamp), header.frame_id, score,
                       score >= threshold_, {{shared->image, owner}, {}, taken.number},
                       ros::Time::now().toSec());
    ++judged_in_window_;
    ms_in_window_ += ms;
  }

  void OnSendTimer(const ros::SteadyTimerEvent&) {
    const MutexLock lock(mutex_);
    // Without a listener a frame would be spent, not sent.
    if (publisher_.getNumSubscribers() == 0) return;
    const auto encode = [this](const vehicle::CameraImage& image, std::size_t max_bytes) {
      return MaskedJpeg(image, max_bytes);
    };
    for (const protocol::OffloadedFrame& candidate :
         sender_->TakeReady(ros::Time::now().toSec(), encode)) {
      publisher_.publish(boost::make_shared<CandidateFrame>(ros_io::ToMessage(candidate)));
    }
  }

  /// What leaves the car; empty when it cannot be masked: it fails closed.
  std::vector<std::uint8_t> MaskedJpeg(const vehicle::CameraImage& image, std::size_t max_bytes) {
    const cv::Mat& bgr = image.picture.bgr;
    const perception::PictureMasker::Masked masked =
        masker_->Mask(bgr, image.number, cv::Rect({}, bgr.size()));
    if (masked.bgr.empty()) {
      NODELET_ERROR_THROTTLE(kSayAgainS, "a frame is withheld: %s", masked.why_withheld.c_str());
      return {};
    }
    return imaging::EncodeJpeg({masked.bgr, image.picture.owner}, config_.jpeg_quality, max_bytes);
  }

  void Diagnose(Diagnostics::Status& status) {
    const Queue::Counters queue = queue_->counters();
    const MutexLock lock(mutex_);
    const vehicle::OffloadSender::Counters& counters = sender_->counters();
    const bool withheld = withheld_.HasRisen(counters.withheld);
    const bool dropped = dropped_.HasRisen(queue.dropped);
    if (withheld) {
      status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, "frames are withheld: no mask");
    } else if (dropped) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "behind: dropping frames");
    } else if (judged_in_window_ == 0) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "no frames");
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    }
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
    status.add("regions_masked", masker_->counters().masked_regions);
    status.add("masks_found_by", masker_->finder());
    feed_->Diagnose(status);
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
  std::unique_ptr<perception::PictureMasker> masker_;
  std::unique_ptr<Queue> queue_;
  ros::Publisher publisher_;
  ros::SteadyTimer send_timer_;
  CounterWatch withheld_, dropped_;  // Of the diagnostics.
  std::thread worker_;

  Mutex mutex_;
  std::unique_ptr<vehicle::OffloadSender> sender_ PT_GUARDED_BY(mutex_);
  std::uint64_t judged_in_window_ GUARDED_BY(mutex_) = 0;
  double ms_in_window_ GUARDED_BY(mutex_) = 0;

  // Last: their callbacks use the rest.
  std::unique_ptr<VehicleFeed> feed_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

using EarlyDiscardNodelet = PartNodelet<EarlyDiscardPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::EarlyDiscardNodelet, nodelet::Nodelet)
