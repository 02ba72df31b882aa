#include "nodes/notice_sender.h"

#include <utility>

#include "ros/conversions/hazard_conversions.h"

namespace livemap::nodes {
namespace {

/// While more wait, notices go without pictures: drivers must know soon.
constexpr std::size_t kMaxWaitingForPictures = 8;

}  // namespace

NoticeSender::NoticeSender(NoticePictures& pictures, const ros::Publisher& publisher)
    : all_pictures_(pictures), publisher_(publisher) {
  thread_ = std::thread([this] { Work(); });
}

NoticeSender::~NoticeSender() {
  {
    const MutexLock lock(mutex_);
    closing_ = true;
  }
  changed_.NotifyOne();
  thread_.join();
}

void NoticeSender::Push(const zone::HazardEvent& event) {
  {
    const MutexLock lock(mutex_);
    events_.push_back(event);
  }
  changed_.NotifyOne();
}

void NoticeSender::Work() {
  MutexLock lock(mutex_);
  while (true) {
    while (!closing_ && events_.empty()) changed_.Wait(mutex_);
    if (events_.empty()) return;
    const zone::HazardEvent event = std::move(events_.front());
    events_.pop_front();
    const bool with_picture = !closing_ && events_.size() < kMaxWaitingForPictures;
    lock.Unlock();
    Send(event, with_picture);
    lock.Lock();
  }
}

void NoticeSender::Send(const zone::HazardEvent& event, bool with_picture) {
  HazardNotice notice = ros_io::ToMessage(event);
  if (with_picture && notice.action == HazardNotice::ADDED) {
    notice.image.data = all_pictures_.Get(event.hazard.image_sha256);
    if (!notice.image.data.empty()) {
      notice.image.format = "jpeg";
      ++pictures_;
    }
  }
  publisher_.publish(notice);
  ++sent_;
}

}  // namespace livemap::nodes
