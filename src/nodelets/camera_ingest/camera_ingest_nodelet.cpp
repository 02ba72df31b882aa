#include <camera_info_manager/camera_info_manager.h>
#include <image_transport/image_transport.h>
#include <sensor_msgs/CompressedImage.h>

#include <atomic>
#include <memory>
#include <optional>
#include <pluginlib/class_list_macros.hpp>
#include <thread>

#include "common/error.h"
#include "common/mutex.h"
#include "common/queues/frame_queue.h"
#include "imaging/rectifier.h"
#include "nodelets/camera_ingest/calibration_cache.h"
#include "nodelets/camera_ingest/frame_processor.h"
#include "nodelets/camera_ingest/ingest_reader.h"
#include "nodelets/camera_ingest/ingest_stereo.h"
#include "nodelets/diagnostics.h"
#include "nodelets/nodelet_part.h"
#include "nodelets/nodelet_support.h"
#include "nodelets/stamp_checks.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/parameters/camera_ingest_parameters.h"

namespace livemap::nodelets {
namespace {

constexpr double kMaxBetweenCamerasS = 60;

}  // namespace

/// The vehicle's cameras: takes images from a topic, device, video file or folder, takes the lens
/// distortion out, resizes, and publishes `camera_rect/image` with `camera_rect/camera_info`; with
/// a right camera depth too (IngestStereo).
///
/// Callbacks only enqueue; one worker decodes, rectifies and publishes. When it is behind, the
/// oldest waiting frame goes: frames_in = published + dropped + bad + waiting, at any moment.
class CameraIngestPart : public NodeletPart {
 public:
  ~CameraIngestPart() override {
    diagnostics_.reset();
    image_subscriber_.shutdown();
    info_subscriber_.shutdown();
    reader_.reset();
    calibrations_.Close();
    if (queue_) queue_->Close();
    if (worker_.joinable()) worker_.join();
  }

 private:
  void Initialize() override {
    ros_io::ParameterReader parameters(getPrivateNodeHandle());
    config_ = ros_io::ReadIngestConfig(parameters);
    stamps_ = std::make_unique<StampChecks>(getName(), config_.max_stamp_ahead_s, [this] {
      if (stereo_) stereo_->StartAnew();
    });
    // Several cameras may share the topic, each in its own order.
    stamps_->AllowLate("an image", kMaxBetweenCamerasS);
    queue_ =
        std::make_unique<FrameQueue<IngestFrame>>(static_cast<std::size_t>(config_.queue_size));
    processor_ = std::make_unique<FrameProcessor>(
        imaging::OutputSize{config_.output_width, config_.output_height},
        static_cast<std::int64_t>(config_.max_megapixels * 1e6));
    image_transport::ImageTransport transport(getNodeHandle());
    publisher_ = transport.advertiseCamera("camera_rect/image", 10);
    if (config_.stereo) {
      stereo_ = std::make_unique<IngestStereo>(config_, getNodeHandle(), getName());
    }
    if (config_.source == ros_io::IngestSource::kTopic) {
      Subscribe();
    } else {
      StartReader();
    }
    worker_ = std::thread([this] { Work(); });
    {
      const MutexLock lock(accounts_mutex_);
      window_start_ = ros::WallTime::now();
    }
    diagnostics_ = std::make_unique<Diagnostics>(
        getNodeHandle(), getPrivateNodeHandle(),
        Diagnostics::Config{getName(), "camera_ingest", "camera ingest",
                            config_.diagnostics_period_s},
        [this](Diagnostics::Status& status) { Diagnose(status); });
  }

  void Subscribe() {
    ros::NodeHandle& node = getNodeHandle();
    const auto queue_size = static_cast<std::uint32_t>(config_.subscriber_queue_size);
    info_subscriber_ = node.subscribe<sensor_msgs::CameraInfo>(
        "camera/camera_info", queue_size,
        [this](const sensor_msgs::CameraInfoConstPtr& info) { calibrations_.Put(info); });
    const std::string topic = node.resolveName("camera/image_raw");
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    if (config_.transport == "raw") {
      image_subscriber_ = node.subscribe<sensor_msgs::Image>(
          topic, queue_size,
          [this](const sensor_msgs::ImageConstPtr& image) {
            TakeStamped({image, nullptr});
          },
          ros::VoidConstPtr(), hints);
      return;
    }
    // Not through image_transport, whose plugin would decode inside the callback: there a slow
    // decoder fills ROS's own queue, which drops frames without counting them.
    image_subscriber_ = node.subscribe<sensor_msgs::CompressedImage>(
        topic + "/compressed", queue_size,
        [this](const sensor_msgs::CompressedImageConstPtr& image) {
          TakeStamped({nullptr, image});
        },
        ros::VoidConstPtr(), hints);
  }

  void StartReader() {
    // Its set_camera_info service lets a calibrator replace the calibration while this runs.
    info_manager_ = std::make_unique<camera_info_manager::CameraInfoManager>(
        ros::NodeHandle(getNodeHandle(), "camera"), config_.frame_id);
    if (!info_manager_->loadCameraInfo(config_.camera_info_url)) {
      throw Error("parameter 'camera_info_url' is '" + config_.camera_info_url +
                  "', which is no readable camera calibration file");
    }
    const sensor_msgs::CameraInfo info = info_manager_->getCameraInfo();
    if (config_.device.width == 0) config_.device.width = static_cast<int>(info.width);
    if (config_.device.height == 0) config_.device.height = static_cast<int>(info.height);
    std::unique_ptr<imaging::FrameSource> source = OpenSource(config_);
    CheckCalibration(*source);
    reader_ = std::make_unique<IngestReader>(
        config_, std::move(source), [this](IngestFrame frame) { Take(std::move(frame)); },
        [this](const std::string& reason) { MissFrame(reason); });
  }

  /// Throws Error when the calibration cannot rectify, or is for images of another size.
  void CheckCalibration(imaging::FrameSource& source) {
    const auto info = boost::make_shared<sensor_msgs::CameraInfo>(info_manager_->getCameraInfo());
    try {
      const imaging::Rectifier checked(
          ros_io::FromMessage(*info),
          imaging::OutputSize{config_.output_width, config_.output_height});
      // A live camera has no first image to look at and go back to.
      if (config_.source != ros_io::IngestSource::kDevice) CheckFirstFrame(source, info);
    } catch (const Error& error) {
      throw Error("parameter 'camera_info_url' is '" + config_.camera_info_url +
                  "', whose calibration cannot be used: " + error.what());
    }
  }

  /// Throws SizeMismatch. What else is wrong with the first image is told when it is read again.
  void CheckFirstFrame(imaging::FrameSource& source, const sensor_msgs::CameraInfoConstPtr& info) {
    try {
      std::optional<imaging::SourceFrame> frame = source.Next();
      if (frame) processor_->Process(ToIngestFrame(std::move(*frame), {}), info);
    } catch (const SizeMismatch&) {
      throw;
    } catch (const std::exception&) {
    }
    source.Rewind();
  }

  /// A frame of a topic; it keeps its stamp, which must be one.
  void TakeStamped(IngestFrame frame) {
    if (stamps_->IsUsable("an image", frame.header().stamp)) queue_->Push(std::move(frame));
  }

  /// A frame of the own reader, with the calibration as it is now.
  void Take(IngestFrame frame) {
    auto info = boost::make_shared<sensor_msgs::CameraInfo>(info_manager_->getCameraInfo());
    info->header.frame_id = config_.frame_id;
    calibrations_.Put(info);
    queue_->Push(std::move(frame));
  }

  /// A frame that the source had but could not give.
  void MissFrame(const std::string& reason) {
    {
      const MutexLock lock(accounts_mutex_);
      ++unread_;
      last_unread_ = reason;
    }
    NODELET_WARN_THROTTLE(kSayAgainS, "%s", reason.c_str());
  }

  void Work() {
    while (std::optional<IngestFrame> frame = queue_->Pop()) {
      std::string fault;
      try {
        const sensor_msgs::CameraInfoConstPtr info =
            calibrations_.Find(frame->header().frame_id, config_.calibration_wait_s);
        const ProcessedFrame result = processor_->Process(*frame, info);
        publisher_.publish(result.image, result.info);
        if (stereo_) stereo_->Take(result);
      } catch (const std::exception& exception) {
        fault = exception.what();
      }
      Account(fault.empty());
      if (fault.empty()) continue;
      NODELET_WARN_THROTTLE(kSayAgainS, "dropped a frame of '%s': %s",
                            frame->header().frame_id.c_str(), fault.c_str());
    }
  }

  void Account(bool published) {
    const MutexLock lock(accounts_mutex_);
    if (published) {
      queue_->Done();
      ++published_in_window_;
    } else {
      queue_->Unusable();
      ++bad_;
    }
  }

  void Diagnose(Diagnostics::Status& status) {
    const MutexLock lock(accounts_mutex_);
    const FrameQueue<IngestFrame>::Counters counters = queue_->counters();
    // The queue counts unusable frames among its dropped ones.
    const std::uint64_t dropped = counters.dropped - bad_;
    const ros::WallTime now = ros::WallTime::now();
    const double window_s = (now - window_start_).toSec();
    if (window_s > 0.5) {
      rate_hz_ = static_cast<double>(published_in_window_) / window_s;
      published_in_window_ = 0;
      window_start_ = now;
    }
    const bool ended = reader_ && reader_->ended();
    // A frame whose stamp cannot be came, too, and is bad.
    const std::uint64_t not_queued = unread_ + stamps_->refused();
    const bool more_bad = bad_watch_.HasRisen(bad_ + not_queued);
    const bool more_dropped = dropped_watch_.HasRisen(dropped);
    if (ended) {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "the source has ended");
    } else if (more_bad) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "bad frames");
    } else if (more_dropped) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "behind: dropping frames");
    } else if (rate_hz_ == 0) {
      status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                     last_unread_.empty() ? "no frames" : "no frames: " + last_unread_);
    } else {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    }
    status.add("frames_in", counters.in + not_queued);
    status.add("frames_published", counters.processed);
    status.add("frames_dropped", dropped);
    status.add("frames_bad", bad_ + not_queued);
    status.add("rate_hz", rate_hz_);
    stamps_->Diagnose(status);
    if (stereo_) stereo_->Diagnose(status);
  }

  ros_io::IngestConfig config_;
  CalibrationCache calibrations_;
  std::unique_ptr<StampChecks> stamps_;
  std::unique_ptr<FrameQueue<IngestFrame>> queue_;
  std::unique_ptr<FrameProcessor> processor_;  ///< The worker's.
  image_transport::CameraPublisher publisher_;
  std::unique_ptr<IngestStereo> stereo_;  ///< Null: monocular.
  ros::Subscriber image_subscriber_;
  ros::Subscriber info_subscriber_;
  std::unique_ptr<camera_info_manager::CameraInfoManager> info_manager_;
  std::unique_ptr<IngestReader> reader_;
  std::thread worker_;

  Mutex accounts_mutex_;  ///< Makes the queue's counters and the ones below one snapshot.
  std::uint64_t bad_ GUARDED_BY(accounts_mutex_) = 0;
  /// Bad ones that never reached the queue.
  std::uint64_t unread_ GUARDED_BY(accounts_mutex_) = 0;
  std::string last_unread_ GUARDED_BY(accounts_mutex_);  ///< Why.
  std::uint64_t published_in_window_ GUARDED_BY(accounts_mutex_) = 0;
  CounterWatch bad_watch_ GUARDED_BY(accounts_mutex_);
  CounterWatch dropped_watch_ GUARDED_BY(accounts_mutex_);
  ros::WallTime window_start_ GUARDED_BY(accounts_mutex_);
  double rate_hz_ GUARDED_BY(accounts_mutex_) = 0;

  std::unique_ptr<Diagnostics> diagnostics_;  ///< Last: it uses the rest.
};

using CameraIngestNodelet = PartNodelet<CameraIngestPart>;

}  // namespace livemap::nodelets

PLUGINLIB_EXPORT_CLASS(livemap::nodelets::CameraIngestNodelet, nodelet::Nodelet)
