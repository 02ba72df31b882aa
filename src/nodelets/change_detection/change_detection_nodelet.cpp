#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <array>
#include <boost/make_shared.hpp>
#include <chrono>
#include <map>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <thread>

#include "change/objects/change_detector.h"
#include "change/objects/change_overlay.h"
#include "common/mutex.h"
#include "common/queues/frame_queue.h"
#include "nodelets/change_detection/map_change_sender.h"
#include "nodelets/change_detection/posed_frame_queue.h"
#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/vehicle_feed.h"
#include "ros/conversions/change_conversions.h"
#include "ros/conversions/depth_conversions.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/parameters/change_detection_parameters.h"
#include "vehicle/reporting/offload_sender.h"

namespace livemap::nodelets {
namespace {

constexpr double kPickPeriodS = 0.02;

}  // namespace

/// Change detection on board: ChangeDetector with topics, tf and clocks. One worker thread compares
/// and remembers; all else runs in the nodelet's own queue. An image whose turn comes while the
/// worker is busy is skipped and counted: what the CPU allows sets the rate, `spacing_m` bounds it.
class ChangeDetectionPart : public NodeletPart {
 public:
  ~ChangeDetectionPart() override {
    diagnostics_.reset();
    pick_timer_.stop();
    depth_subscriber_.shutdown();
    if (feed_) feed_->StopImages();
    if (queue_) queue_->Close();
    if (worker_.joinable()) worker_.join();
    if (watch_ && sender_) sender_->Tell(watch_->EndDrive());
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Job {
    PosedFrameQueue::Posed posed;
    geo::CameraIntrinsics camera;
    Eigen::Isometry3d base_from_optical;
  };
  using Queue = FrameQueue<Job>;

  /// Of the worker; `outcomes` by ChangeDetector::Outcome.
  struct Figures {
    std::array<std::uint64_t, 4> outcomes{};
    std::array<std::uint64_t, 3> registered{};  ///< By ChangeDetector::RegisteredBy.
    std::uint64_t depths_unusable = 0;
    std::uint64_t remembered = 0;
    std::uint64_t store_errors = 0;
    std::uint64_t objects = 0;
    std::size_t places = 0;
    double megabytes = 0;
    std::size_t damaged = 0;
    std::uint64_t looked_in_window = 0;
    double ms_in_window = 0;
  };

  void Initialize() override {
    const auto now_ns = static_cast<std::int64_t>(ros::WallTime::now().toNSec());
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadChangeDetectionConfig(parameters, now_ns);
    ros_io::ConfiguredChangeMethod method = ros_io::MakeConfiguredMethod(config_);
    method_name_ = method.name;
    config_.watch.regions.min_confidence = method.threshold;
    watch_ =
        std::make_unique<change::ChangeDetector>(config_.watch, std::move(method.method), now_ns);
    SayRecovery(watch_->memory().recovery());
    {
      const MutexLock lock(mutex_);
      figures_.places = watch_->memory().size();
    }
    frames_ = std::make_unique<PosedFrameQueue>(PosedFrameQueue::Config{
        config_.spacing_m, static_cast<std::size_t>(config_.max_waiting_frames),
        config_.use_depth ? config_.depth_wait_s : 0, config_.pose});
    queue_ = std::make_unique<Queue>(1);
    if (config_.tell_zone) {
      MapChangeSender::Config sender;
      sender.drive_id = config_.watch.drive_id;
      sender.min_confidence = config_.tell_confidence;
      // Without a directory there is one zone, whatever it is called.
      if (!config_.zones.directory.empty()) sender.outbox.zone = config_.zones.zone;
      sender.zones = ros_io::MakeZoneFinder(config_.zones);
      sender.outbox.path = config_.watch.memory.directory + "/map_changes.sqlite3";
      sender_ = std::make_unique<MapChangeSender>(sender, getNodeHandle(), now_ns);
    }
    Connect();
    worker_ = std::thread([this] { Work(); });
  }

  void SayRecovery(const change::PlaceMemory::Recovery& recovery) {
    if (!recovery.set_aside.empty()) {
      NODELET_ERROR("the index of places was corrupt: it is now '%s', %zu places were read again",
                    recovery.set_aside.c_str(), recovery.rebuilt);
    }
    if (recovery.unreadable + recovery.lost_files > 0) {
      NODELET_ERROR("of the places %zu files were damaged and %zu missing", recovery.unreadable,
                    recovery.lost_files);
    }
  }

  void Connect() {
    using Self = ChangeDetectionPart;
    ros::NodeHandle& node = getNodeHandle();
    report_publisher_ = node.advertise<ChangedObjects>("change/report", 100);
    mask_publisher_ = node.advertise<sensor_msgs::Image>("change/mask", 2);
    overlay_publisher_ = node.advertise<sensor_msgs::Image>("change/overlay", 2);
    // First: the callbacks of the others use it.
    MakeFeed();
    if (config_.use_depth) {
      depth_subscriber_ = node.subscribe("camera/depth/image_raw", 10, &Self::OnDepth, this);
    }
    // Steady time: a replay that stands still must not keep back what has come.
    pick_timer_ = node.createSteadyTimer(ros::WallDuration(kPickPeriodS), &Self::OnPickTimer, this);
    diagnostics_ = std::make_unique<Diagnostics>(
        node, getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "change_detection", "change_detection",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  void MakeFeed() {
    VehicleFeed::Handlers handlers;
    handlers.on_fix = [this](const geo::Fix& fix) {
      mutex_.AssertHeld();
      frames_->AddFix(fix, RosNowNs());
    };
    handlers.on_pose = [this](std::int64_t stamp_ns, const geo::TrackPose& pose) {
      mutex_.AssertHeld();
      frames_->AddPose(stamp_ns, pose, RosNowNs());
    };
    handlers.on_intrinsics = [this](const geo::CameraIntrinsics& intrinsics) {
      mutex_.AssertHeld();
      intrinsics_ = intrinsics;
    };
    handlers.on_mounting = [this](const std::string& frame, const Eigen::Isometry3d& mounting) {
      mutex_.AssertHeld();
      mountings_[frame] = mounting;
    };
    handlers.on_image = [this](const sensor_msgs::ImageConstPtr& image) {
      mutex_.AssertHeld();
      frames_->AddImage(image, ros::Time::now().toSec());
    };
    handlers.on_time_reset = [this] {
      mutex_.AssertHeld();
      frames_->StartAnew();
    };
    feed_ = std::make_unique<VehicleFeed>(
        getNodeHandle(), getPrivateNodeHandle(),
        VehicleFeed::Config{getName(), config_.map_frame, config_.base_frame,
                            config_.pose.use_fused, config_.pose.fixes.stamps.max_ahead_s},
        mutex_, std::move(handlers));
  }

  void OnDepth(const sensor_msgs::ImageConstPtr& depth) {
    const MutexLock lock(mutex_);
    if (feed_->IsUsable("a depth image", depth->header.stamp)) frames_->AddDepth(depth);
  }

  void OnPickTimer(const ros::SteadyTimerEvent&) {
    const MutexLock lock(mutex_);
    while (const auto posed = frames_->Next(ros::Time::now().toSec())) {
      const auto mounting = mountings_.find(posed->image->header.frame_id);
      if (!intrinsics_ || mounting == mountings_.end()) {
        ++no_camera_;
      } else if (queue_->counters().waiting > 0) {
        ++busy_;
      } else {
        frames_->Taken(*posed);
        queue_->Push({*posed, *intrinsics_, mounting->second});
      }
    }
  }

  void Work() {
    while (const std::optional<Job> job = queue_->Pop()) {
      try {
        LookAt(*job);
        queue_->Done();
      } catch (const std::exception& error) {
        queue_->Unusable();
        NODELET_ERROR_THROTTLE(kSayAgainS, "dropped an image of %s: %s",
                               feed_->image_topic().c_str(), error.what());
      }
    }
  }

  void LookAt(const Job& job) {
    const Clock::time_point start = Clock::now();
    const change::ChangeDetector::Answer answer = watch_->Look(ToPicture(job));
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    if (!answer.store_error.empty()) {
      NODELET_ERROR_THROTTLE(kSayAgainS, "a place is not remembered: %s",
                             answer.store_error.c_str());
    }
    Publish(answer, job.posed.image->header);
    if (sender_) sender_->Tell(answer.passed);
    const MutexLock lock(mutex_);
    ++figures_.outcomes[static_cast<std::size_t>(answer.outcome)];
    if (answer.outcome == change::ChangeDetector::Outcome::kCompared) {
      ++figures_.registered[static_cast<std::size_t>(answer.registered_by)];
    }
    figures_.remembered += answer.remembered ? 1 : 0;
    figures_.store_errors += answer.store_error.empty() ? 0 : 1;
    figures_.objects += answer.newly_confirmed;
    figures_.places = watch_->memory().size();
    figures_.megabytes = watch_->memory().bytes() / 1e6;
    figures_.damaged = watch_->memory().damaged();
    ++figures_.looked_in_window;
    figures_.ms_in_window += ms;
  }

  change::ChangeDetectorFrame ToPicture(const Job& job) {
    const auto shared = cv_bridge::toCvShare(job.posed.image, sensor_msgs::image_encodings::BGR8);
    const cv::Mat& bgr = shared->image;
    if (bgr.cols != job.camera.width || bgr.rows != job.camera.height) {
      throw Error("it is " + std::to_string(bgr.cols) + "x" + std::to_string(bgr.rows) +
                  ", its camera_info accepts " + std::to_string(job.camera.width) + "x" +
                  std::to_string(job.camera.height));
    }
    change::ChangeDetectorFrame picture;
    picture.stamp_ns = ros_io::FromRosTime(job.posed.image->header.stamp);
    picture.bgr = bgr;
    if (bgr.cols > config_.width_px) {
      const double scale = static_cast<double>(config_.width_px) / bgr.cols;
      const cv::Size size(config_.width_px, std::max(1, cvRound(bgr.rows * scale)));
      picture.bgr = cv::Mat();
      cv::resize(bgr, picture.bgr, size, 0, 0, cv::INTER_AREA);
    } else {
      picture.bgr = bgr.clone();  // The message's pixels end with it.
    }
    picture.camera = vehicle::Resized(job.camera, picture.bgr.cols, picture.bgr.rows);
    picture.depth = DepthOf(job, picture.bgr.size());
    picture.base_from_optical = job.base_from_optical;
    picture.position = job.posed.base.position;
    picture.covariance_m2 = job.posed.base.covariance_m2;
    picture.heading_rad = job.posed.base.course_rad;
    return picture;
  }

  /// Empty where there is none, or none that is usable: then the picture goes without.
  cv::Mat DepthOf(const Job& job, cv::Size size) {
    if (!job.posed.depth) return {};
    try {
      return ros_io::ToDepthMetres(job.posed.depth, size, config_.depth_units_per_m);
    } catch (const std::exception& error) {
      NODELET_WARN_THROTTLE(kSayAgainS, "depth image not used: %s", error.what());
      const MutexLock lock(mutex_);
      ++figures_.depths_unusable;
      return {};
    }
  }

  void Publish(const change::ChangeDetector::Answer& answer, const std_msgs::Header& header) {
    const bool compared = answer.outcome == change::ChangeDetector::Outcome::kCompared;
    if (compared && mask_publisher_.getNumSubscribers() > 0) {
      mask_publisher_.publish(ros_io::ToImageMessage(answer.classes, header));
    }
    if (compared && overlay_publisher_.getNumSubscribers() > 0) {
      const cv::Mat drawn = change::DrawChanges(answer.pair.after, answer.classes, answer.regions);
      overlay_publisher_.publish(ros_io::ToImageMessage(drawn, header));
    }
    report_publisher_.publish(boost::make_shared<ChangedObjects>(
        ros_io::ToMessage(answer, header, config_.watch.drive_id, method_name_)));
  }

  void Diagnose(Diagnostics::Status& status) {
    using Outcome = change::ChangeDetector::Outcome;
    const Queue::Counters queue = queue_->counters();
    const MutexLock lock(mutex_);
    const PosedFrameQueue::Counters& frames = frames_->counters();
    const auto outcome = [outcomes = figures_.outcomes](Outcome which) {
      return outcomes[static_cast<std::size_t>(which)];
    };
    const bool not_stored = store_errors_.HasRisen(figures_.store_errors);
    const bool dropped = dropped_.HasRisen(queue.dropped);
    const bool came = came_.HasRisen(frames.frames);
    if (not_stored) {
      status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, "places are not remembered");
    } else if (dropped) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "dropping unusable images");
    } else if (!came) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "no frames");
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    }
    status.add("frames_in", frames.frames);
    status.add("frames_waiting", frames_->waiting());
    status.add("frames_displaced", frames.displaced);
    status.add("frames_no_pose", frames.no_pose);
    status.add("frames_no_camera", no_camera_);
    status.add("frames_near", frames.near);
    status.add("frames_skipped_busy", busy_);
    status.add("frames_in_work", queue.waiting);
    status.add("frames_unusable", queue.dropped);
    status.add("frames_looked_at", queue.processed);
    status.add("pictures_uncertain", outcome(Outcome::kUncertain));
    status.add("pictures_without_earlier", outcome(Outcome::kNothingEarlier));
    status.add("pictures_refused", outcome(Outcome::kRefused));
    status.add("pictures_compared", outcome(Outcome::kCompared));
    status.add("registered_by_depth", figures_.registered[0]);
    status.add("registered_by_edges", figures_.registered[1]);
    status.add("registered_by_features", figures_.registered[2]);
    status.add("depths_unusable", figures_.depths_unusable);
    status.add("pictures_remembered", figures_.remembered);
    status.add("pictures_not_stored", figures_.store_errors);
    status.add("objects_confirmed", figures_.objects);
    status.add("places", figures_.places);
    status.add("places_mb", figures_.megabytes);
    status.add("places_damaged", figures_.damaged);
    const auto looked = static_cast<double>(figures_.looked_in_window);
    feed_->Diagnose(status);
    status.add("looking_ms", looked > 0 ? figures_.ms_in_window / looked : 0.0);
    status.add("method", method_name_);
    status.add("threshold", config_.watch.regions.min_confidence);
    if (sender_) sender_->Diagnose(status);
    figures_.looked_in_window = 0;
    figures_.ms_in_window = 0;
  }

  ros_io::ChangeDetectionConfig config_;
  std::string method_name_;
  std::unique_ptr<change::ChangeDetector> watch_;  // The worker's, once it runs.
  std::unique_ptr<MapChangeSender> sender_;        // None: nothing is told to the zone.
  std::unique_ptr<Queue> queue_;
  ros::Publisher report_publisher_, mask_publisher_, overlay_publisher_;
  ros::Subscriber depth_subscriber_;
  ros::SteadyTimer pick_timer_;
  CounterWatch store_errors_, dropped_, came_;  // Of the diagnostics.
  std::thread worker_;

  Mutex mutex_;
  std::unique_ptr<PosedFrameQueue> frames_ PT_GUARDED_BY(mutex_);
  std::optional<geo::CameraIntrinsics> intrinsics_ GUARDED_BY(mutex_);
  std::map<std::string, Eigen::Isometry3d> mountings_ GUARDED_BY(mutex_);  ///< By frame id.
  std::uint64_t no_camera_ GUARDED_BY(mutex_) = 0;
  std::uint64_t busy_ GUARDED_BY(mutex_) = 0;
  Figures figures_ GUARDED_BY(mutex_);

  // Last: their callbacks use the rest.
  std::unique_ptr<VehicleFeed> feed_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

using ChangeDetectionNodelet = PartNodelet<ChangeDetectionPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::ChangeDetectionNodelet, nodelet::Nodelet)
