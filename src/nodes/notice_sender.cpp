#include "nodes/notice_sender.h"

#include <utility>

#include "ros/conversions/hazard_conversions.h"

namespace livemap::nodes {
namespace {

/// While more wait, notices go without pictures: drivers must know soon.
constexpr std::size_t kMaxWaitingForPictures = 8;

}  // namespace

NoticeSender::NoticeSender(NoticePictures& pictures, const Publishers& publishers)
    : all_pictures_(pictures), publishers_(publishers) {
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

void NoticeSender::Push(const zone::HazardEvent& event, std::vector<zone::CellLog::Step> steps) {
  {
    const MutexLock lock(mutex_);
    events_.push_back({event, std::move(steps)});
  }
  changed_.NotifyOne();
}

void NoticeSender::Work() {
  MutexLock lock(mutex_);
  while (true) {
    while (!closing_ && events_.empty()) changed_.Wait(mutex_);
    if (events_.empty()) return;
    const News news = std::move(events_.front());
    events_.pop_front();
    const bool with_picture = !closing_ && events_.size() < kMaxWaitingForPictures;
    lock.Unlock();
    Send(news, with_picture);
    lock.Lock();
  }
}

void NoticeSender::Send(const News& news, bool with_picture) {
  HazardNotice notice = ros_io::ToMessage(news.event);
  if (with_picture && notice.action == HazardNotice::ADDED) {
    notice.image.data = all_pictures_.Get(news.event.hazard.image_sha256);
    if (!notice.image.data.empty()) {
      notice.image.format = "jpeg";
      ++pictures_;
    }
  }
  // An empty publisher cannot be asked to publish.
  if (publishers_.all) publishers_.all.publish(notice);
  for (const zone::CellLog::Step& step : news.steps) SendToCell(notice, step);
  ++sent_;
}

/// The cell follows from the notice's place, so one that tells of a hazard's leaving has a place in
/// the cell that was left.
void NoticeSender::SendToCell(HazardNotice notice, const zone::CellLog::Step& step) const {
  notice.previous_sequence = step.previous;
  if (step.leaves) {
    const geo::GeoPoint middle = step.cell.Middle();
    notice.action = HazardNotice::REMOVED;
    notice.latitude = middle.latitude_deg;
    notice.longitude = middle.longitude_deg;
    notice.image.format.clear();
    notice.image.data.clear();
  }
  publishers_.cells.publish(notice);
}

}  // namespace livemap::nodes
