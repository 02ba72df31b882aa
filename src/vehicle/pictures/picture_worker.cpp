#include "vehicle/pictures/picture_worker.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <exception>

namespace livemap::vehicle {
namespace {

/// Where cores are short the detector goes first: a frame that it cannot look at is gone, a picture
/// may come later. Linux has priorities by thread; where it refuses, nothing is lost.
void LetOthersGoFirst() {
  constexpr int kNiceness = 5;
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
}

}  // namespace

PictureWorker::PictureWorker(const Config& config, Make make)
    : config_(config), make_(std::move(make)), thread_([this] { Work(); }) {}

PictureWorker::~PictureWorker() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
    waiting_.clear();
  }
  available_.NotifyAll();
  thread_.join();
}

void PictureWorker::Order(PictureOrder order, double steady_s, Answer answer) {
  ++counters_.ordered;
  const std::uint64_t ticket = ++last_ticket_;
  open_.push_back({ticket, steady_s + config_.max_wait_s, std::move(answer)});
  {
    const MutexLock lock(mutex_);
    if (waiting_.size() < static_cast<std::size_t>(config_.max_waiting)) {
      waiting_.push_back({ticket, std::move(order)});
    } else {
      ++counters_.refused;
      done_.push_back({ticket, {}});
    }
  }
  available_.NotifyOne();
}

void PictureWorker::Deliver(double steady_s) {
  std::vector<Done> done;
  {
    const MutexLock lock(mutex_);
    done.swap(done_);
  }
  for (Done& each : done) Close(each.ticket, std::move(each.pictures));
  while (!open_.empty() && steady_s >= open_.front().deadline_s) {
    const std::uint64_t ticket = open_.front().ticket;
    {
      const MutexLock lock(mutex_);
      waiting_.erase(
          std::remove_if(waiting_.begin(), waiting_.end(),
                         [ticket](const Waiting& each) { return each.ticket == ticket; }),
          waiting_.end());
    }
    ++counters_.late;
    Close(ticket, {});
  }
}

void PictureWorker::Close(std::uint64_t ticket, std::vector<imaging::CroppedPicture> pictures) {
  const auto open = std::find_if(open_.begin(), open_.end(),
                                 [ticket](const Open& each) { return each.ticket == ticket; });
  if (open == open_.end()) return;
  if (!pictures.empty()) ++counters_.made;
  const Answer answer = std::move(open->answer);
  open_.erase(open);
  answer(std::move(pictures));
}

std::optional<PictureWorker::Waiting> PictureWorker::Next() {
  const MutexLock lock(mutex_);
  while (!closed_ && waiting_.empty()) available_.Wait(mutex_);
  if (closed_) return std::nullopt;
  std::optional<Waiting> next(std::move(waiting_.front()));
  waiting_.pop_front();
  return next;
}

void PictureWorker::Work() {
  LetOthersGoFirst();
  while (std::optional<Waiting> next = Next()) {
    std::vector<imaging::CroppedPicture> pictures;
    try {
      pictures = make_(next->order);
    } catch (const std::exception&) {  // Nothing leaves the vehicle.
      pictures.clear();
    }
    const MutexLock lock(mutex_);
    done_.push_back({next->ticket, std::move(pictures)});
  }
}

}  // namespace livemap::vehicle
