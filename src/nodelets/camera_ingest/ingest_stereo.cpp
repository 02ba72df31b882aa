#include "nodelets/camera_ingest/ingest_stereo.h"

#include <cv_bridge/cv_bridge.h>
#include <ros/console.h>
#include <sensor_msgs/image_encodings.h>

#include <chrono>
#include <utility>

#include "common/error.h"
#include "common/median.h"
#include "nodelets/nodelet_support.h"
#include "ros/conversions/camera_info_conversions.h"

namespace livemap::nodelets {
namespace {

/// All left images that wait may still ask for theirs.
std::size_t RightsKept(const ros_io::IngestConfig& config) {
  return 2 * static_cast<std::size_t>(config.queue_size) + 8;
}

}  // namespace

IngestStereo::IngestStereo(const ros_io::IngestConfig& config, ros::NodeHandle& node,
                           std::string name)
    : config_(config),
      name_(std::move(name)),
      stamps_(name_, config.max_stamp_ahead_s, [this] { rights_.Clear(); }),
      rights_(config.stereo_sync_s, config.stereo_wait_s, RightsKept(config)),
      queue_(static_cast<std::size_t>(config.queue_size)),
      processor_(imaging::OutputSize{config.output_width, config.output_height},
                 static_cast<std::int64_t>(config.max_megapixels * 1e6)) {
  image_transport::ImageTransport transport(node);
  publisher_ = transport.advertiseCamera("camera_rect/depth/image_raw", 10);
  Subscribe(node);
  worker_ = std::thread([this] { Work(); });
}

IngestStereo::~IngestStereo() {
  image_subscriber_.shutdown();
  info_subscriber_.shutdown();
  rights_.Close();
  calibrations_.Close();
  queue_.Close();
  worker_.join();
}

void IngestStereo::Subscribe(ros::NodeHandle& node) {
  const auto queue_size = static_cast<std::uint32_t>(config_.subscriber_queue_size);
  info_subscriber_ = node.subscribe<sensor_msgs::CameraInfo>(
      "camera_right/camera_info", queue_size,
      [this](const sensor_msgs::CameraInfoConstPtr& info) { calibrations_.Put(info); });
  const std::string topic = node.resolveName("camera_right/image_raw");
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  if (config_.transport == "raw") {
    image_subscriber_ = node.subscribe<sensor_msgs::Image>(
        topic, queue_size,
        [this](const sensor_msgs::ImageConstPtr& image) {
          PutRight({image, nullptr});
        },
        ros::VoidConstPtr(), hints);
    return;
  }
  image_subscriber_ = node.subscribe<sensor_msgs::CompressedImage>(
      topic + "/compressed", queue_size,
      [this](const sensor_msgs::CompressedImageConstPtr& image) {
        PutRight({nullptr, image});
      },
      ros::VoidConstPtr(), hints);
}

void IngestStereo::PutRight(IngestFrame right) {
  if (stamps_.IsUsable("a right image", right.header().stamp)) rights_.Put(std::move(right));
}

void IngestStereo::Take(const ProcessedFrame& left) {
  if (publisher_.getNumSubscribers() > 0) queue_.Push(left);
}

void IngestStereo::Work() {
  while (const std::optional<ProcessedFrame> left = queue_.Pop()) {
    bool paired = true;
    std::string fault;
    try {
      paired = PublishDepth(*left);
    } catch (const std::exception& exception) {
      fault = exception.what();
    }
    {
      const MutexLock lock(accounts_mutex_);
      paired&& fault.empty() ? queue_.Done() : queue_.Unusable();
      bad_ += fault.empty() ? 0U : 1U;
      missing_ += paired ? 0U : 1U;
    }
    if (!paired) SayMissing(left->image->header);
    if (fault.empty()) continue;
    ROS_WARN_STREAM_THROTTLE(kSayAgainS, name_ << ": no depth for an image: " << fault);
  }
}

bool IngestStereo::PublishDepth(const ProcessedFrame& left) {
  const std::optional<IngestFrame> partner = rights_.Take(left.image->header.stamp);
  if (!partner) return false;
  namespace encodings = sensor_msgs::image_encodings;
  const ProcessedFrame right = RectifyRight(*partner);
  imaging::StereoDepth& matcher = MatcherFor(*left.info, *right.info);
  const auto begin = std::chrono::steady_clock::now();
  const cv::Mat depth = matcher.Compute(cv_bridge::toCvShare(left.image, encodings::MONO8)->image,
                                        cv_bridge::toCvShare(right.image, encodings::MONO8)->image);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
  publisher_.publish(
      cv_bridge::CvImage(left.image->header, encodings::TYPE_32FC1, depth).toImageMsg(), left.info);
  const MutexLock lock(accounts_mutex_);
  milliseconds_.push_back(took.count());
  return true;
}

ProcessedFrame IngestStereo::RectifyRight(const IngestFrame& right) {
  try {
    return processor_.Process(
        right, calibrations_.Find(right.header().frame_id, config_.calibration_wait_s));
  } catch (const Error& error) {
    throw Error("the right camera: " + std::string(error.what()));
  }
}

imaging::StereoDepth& IngestStereo::MatcherFor(const sensor_msgs::CameraInfo& left,
                                               const sensor_msgs::CameraInfo& right) {
  const imaging::CameraCalibration left_now = ros_io::FromMessage(left);
  const imaging::CameraCalibration right_now = ros_io::FromMessage(right);
  if (!matcher_ || left_ != left_now || right_ != right_now) {
    matcher_ = std::make_unique<imaging::StereoDepth>(config_.matching, left_now, right_now);
    left_ = left_now;
    right_ = right_now;
  }
  return *matcher_;
}

void IngestStereo::SayMissing(const std_msgs::Header& left) const {
  ROS_WARN_STREAM_THROTTLE(kSayAgainS, name_ << ": no right image for the left one of "
                                             << left.stamp << " within " << config_.stereo_sync_s
                                             << " s of its stamp: " << rights_.counters().in
                                             << " images came on " << image_subscriber_.getTopic()
                                             << "; left images go on without depth");
}

void IngestStereo::Diagnose(Diagnostics::Status& status) {
  const MutexLock lock(accounts_mutex_);
  const FrameQueue<ProcessedFrame>::Counters counters = queue_.counters();
  using Level = diagnostic_msgs::DiagnosticStatus;
  if (bad_watch_.HasRisen(bad_)) status.mergeSummary(Level::WARN, "bad stereo pairs");
  if (missing_watch_.HasRisen(missing_)) {
    status.mergeSummary(Level::WARN, "right images are missing");
  }
  const StereoPairBuffer::Counters rights = rights_.counters();
  status.add("right_in", rights.in);
  status.add("right_unpaired", rights.unpaired);
  status.add("right_stamps_refused", stamps_.refused());
  status.add("depth_wanted", counters.in);
  status.add("depth_published", counters.processed);
  // The queue counts unusable ones among its dropped ones.
  status.add("depth_dropped", counters.dropped - bad_ - missing_);
  status.add("depth_bad", bad_);
  status.add("depth_right_missing", missing_);
  status.add("stereo_milliseconds_median", milliseconds_.empty() ? 0.0 : TakeMedian(milliseconds_));
  milliseconds_.clear();
}

}  // namespace livemap::nodelets
