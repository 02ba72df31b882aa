#include "nodes/notice_sender.h"

#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "ros/hazard_conversions.h"
#include "zone/picture_recoder.h"

namespace livemap {
namespace {

/// While more wait, notices go without pictures: drivers must know soon.
constexpr std::size_t kMaxWaitingForPictures = 8;

std::vector<std::uint8_t> ReadWholeFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

NoticeSender::NoticeSender(const ZoneService& zone, const ros::Publisher& publisher,
                           std::size_t picture_bytes)
    : zone_(zone), publisher_(publisher), picture_bytes_(picture_bytes) {
  thread_ = std::thread([this] { Work(); });
}

NoticeSender::~NoticeSender() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    closing_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void NoticeSender::Push(const HazardEvent& event) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    events_.push_back(event);
  }
  changed_.notify_one();
}

void NoticeSender::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return closing_ || !events_.empty(); });
    if (events_.empty()) return;
    const HazardEvent event = std::move(events_.front());
    events_.pop_front();
    const bool with_picture = !closing_ && events_.size() < kMaxWaitingForPictures;
    lock.unlock();
    Send(event, with_picture);
    lock.lock();
  }
}

void NoticeSender::Send(const HazardEvent& event, bool with_picture) {
  HazardNotice notice = ToMessage(event);
  const std::string& sha256 = event.hazard.image_sha256;
  const bool is_new = notice.action == HazardNotice::ADDED;
  if (with_picture && is_new && picture_bytes_ > 0 && !sha256.empty()) {
    try {
      SmallPictureLimits limits;
      limits.max_bytes = picture_bytes_;
      const auto path = zone_.ImagePath(sha256);
      if (path) notice.image.data = SmallPicture(ReadWholeFile(*path), limits);
      if (!notice.image.data.empty()) notice.image.format = "jpeg";
      ++pictures_;
    } catch (const Error&) {
      ++pictures_failed_;  // A vehicle's picture that is none; the notice counts without it.
    }
  }
  publisher_.publish(notice);
  ++sent_;
}

}  // namespace livemap
