#include "nodelets/camera_ingest/ingest_reader.h"

#include <cv_bridge/cv_bridge.h>
#include <ros/init.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>

#include "common/clock.h"

namespace livemap::nodelets {
namespace {

constexpr double kReopenAfterS = 1.0;
constexpr double kMaxAheadS = 1.0;  // Of the clock.
constexpr double kClockPollS = 0.05;

double RateHz(const ros_io::IngestConfig& config, const imaging::FrameSource& source) {
  return source.rate_hz() > 0 ? source.rate_hz() : config.rate_hz;
}

}  // namespace

IngestFrame ToIngestFrame(imaging::SourceFrame frame, const std_msgs::Header& header) {
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

std::unique_ptr<imaging::FrameSource> OpenSource(const ros_io::IngestConfig& config) {
  switch (config.source) {
    case ros_io::IngestSource::kDevice:
      return imaging::OpenDevice(config.uri, config.device);
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
      period_(1 / RateHz(config_, *source_)),
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

ros::Time IngestReader::StampOf(std::int64_t number, double age_s) {
  const ros::Time now = ros::Time::now();
  if (config_.source == ros_io::IngestSource::kDevice) {
    return now.toSec() > age_s ? now - ros::Duration(age_s) : now;
  }
  if (config_.stamps == "wall") return now;
  const ros::Duration since_first = period_ * static_cast<double>(number);
  // The clock was set back, or a simulated one goes slower than the file: a stamp of the future is
  // of use to nobody.
  if (first_stamp_ + since_first > now + ros::Duration(kMaxAheadS)) {
    first_stamp_ = std::max(now, ros::Time(0) + since_first) - since_first;
  }
  return first_stamp_ + since_first;
}

bool IngestReader::PassMissing(int steps, std::int64_t& number, ros::WallTime& next) {
  if (steps <= 1) return true;
  number += steps - 1;
  next += ros::WallDuration((steps - 1) * period_.toSec());
  return SleepUntil(next);
}

void IngestReader::Run() {
  const bool live = config_.source == ros_io::IngestSource::kDevice;
  // Simulated time begins with its first message: no frame is stamped with a time before it.
  while (ros::Time::now().isZero()) {
    if (!SleepUntil(ros::WallTime::now() + ros::WallDuration(kClockPollS))) return;
  }
  first_stamp_ = ros::Time::now();
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
      if (!PassMissing(frame->steps, number, next)) return;
      std_msgs::Header header;
      header.stamp = StampOf(number, frame->age_s);
      header.frame_id = config_.frame_id;
      take_(ToIngestFrame(std::move(*frame), header));
    } catch (const imaging::UnreadableFrame& unreadable) {
      miss_(unreadable.what());
      if (!PassMissing(unreadable.steps(), number, next)) return;
    } catch (const std::exception& exception) {
      miss_(exception.what());
      // A camera that is not there: tried again, not all the time.
      if (live && !SleepUntil(ros::WallTime::now() + ros::WallDuration(kReopenAfterS))) return;
    }
    ++number;
    next += ros::WallDuration(period_.toSec());
  }
}

}  // namespace livemap::nodelets
