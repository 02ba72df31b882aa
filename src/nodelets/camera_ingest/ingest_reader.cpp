#include "nodelets/camera_ingest/ingest_reader.h"

#include <cv_bridge/cv_bridge.h>
#include <ros/init.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>

#include "common/clock.h"

namespace livemap::nodelets {
namespace {

constexpr double kReopenAfterS = 1.0;

}  // namespace

std::unique_ptr<imaging::FrameSource> OpenSource(const ros_io::IngestConfig& config) {
  switch (config.source) {
    case ros_io::IngestSource::kDevice:
      return imaging::OpenDevice(config.uri);
    case ros_io::IngestSource::kVideo:
      return imaging::OpenVideo(config.uri);
    case ros_io::IngestSource::kFolder:
      return imaging::OpenFolder(config.uri, static_cast<std::size_t>(config.max_megapixels * 8e6));
    case ros_io::IngestSource::kTopic:
      break;
  }
  return nullptr;
}

IngestReader::IngestReader(const ros_io::IngestConfig& config,
                           std::unique_ptr<imaging::FrameSource> source,
                           std::function<void(IngestFrame)> take,
                           std::function<void(const std::string&)> miss)
    : config_(config),
      source_(std::move(source)),
      take_(std::move(take)),
      miss_(std::move(miss)),
      thread_([this] { Run(); }) {}

IngestReader::~IngestReader() {
  {
    const MutexLock lock(mutex_);
    stopped_ = true;
  }
  stop_requested_.NotifyAll();
  thread_.join();
}

bool IngestReader::SleepUntil(ros::WallTime wanted) {
  const double wait_s = std::max(0.0, (wanted - ros::WallTime::now()).toSec());
  const MutexLock lock(mutex_);
  const auto deadline = SteadyDeadline(wait_s);
  while (!stopped_ && stop_requested_.WaitUntil(mutex_, deadline)) {
  }
  return !stopped_;
}

bool IngestReader::GoOn() {
  if (config_.source == ros_io::IngestSource::kDevice) {
    miss_("the camera device '" + config_.uri + "' gives no image");
    return SleepUntil(ros::WallTime::now() + ros::WallDuration(kReopenAfterS));
  }
  if (config_.at_end == ros_io::IngestAtEnd::kLoop) return true;
  ended_ = true;
  // The whole manager: what it still holds is published first, as ROS shuts down in order.
  if (config_.at_end == ros_io::IngestAtEnd::kShutdown) ros::requestShutdown();
  return false;
}

IngestFrame IngestReader::Wrap(imaging::SourceFrame frame, ros::Time stamp) const {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = config_.frame_id;
  if (frame.image.empty()) {
    auto compressed = boost::make_shared<sensor_msgs::CompressedImage>();
    compressed->header = header;
    compressed->data = std::move(frame.encoded);
    return {nullptr, compressed};
  }
  const std::string encoding = frame.image.channels() == 1 ? sensor_msgs::image_encodings::MONO8
                                                           : sensor_msgs::image_encodings::BGR8;
  return {cv_bridge::CvImage(header, encoding, frame.image).toImageMsg(), nullptr};
}

void IngestReader::Run() {
  const bool live = config_.source == ros_io::IngestSource::kDevice;
  const double rate_hz = source_->rate_hz() > 0 ? source_->rate_hz() : config_.rate_hz;
  const ros::Duration period(1 / rate_hz);
  const ros::Time first_stamp = ros::Time::now();
  ros::WallTime next = ros::WallTime::now();
  for (std::int64_t number = 0;;) {
    if (!SleepUntil(live ? ros::WallTime::now() : next)) return;
    try {
      std::optional<imaging::SourceFrame> frame = source_->Next();
      if (!frame) {
        if (!GoOn()) return;
        source_->Rewind();
        continue;
      }
      const ros::Time stamp = config_.stamps == "wall" || live
                                  ? ros::Time::now()
                                  : first_stamp + period * static_cast<double>(number);
      take_(Wrap(std::move(*frame), stamp));
    } catch (const std::exception& exception) {
      miss_(exception.what());
    }
    ++number;
    next += ros::WallDuration(1 / rate_hz);
  }
}

}  // namespace livemap::nodelets
