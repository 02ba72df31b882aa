#include "zone/pictures/picture_queue.h"

#include <utility>

namespace livemap::zone {

PictureQueue::PictureQueue(PictureCache& cache, const Config& config)
    : cache_(cache), config_(config) {
  thread_ = std::thread([this] { Work(); });
}

PictureQueue::~PictureQueue() { Stop(); }

void PictureQueue::Stop() {
  {
    const MutexLock lock(mutex_);
    closing_ = true;
  }
  changed_.NotifyOne();
  if (thread_.joinable()) thread_.join();
  decltype(jobs_) dropped;  // Destroyed after the lock is given back.
  const MutexLock lock(mutex_);
  std::swap(dropped, jobs_);
}

bool PictureQueue::Ask(const std::string& client, const std::string& sha256,
                       const std::string& path, Done done) {
  if (const auto kept = cache_.Find(sha256)) {
    done(*kept);
    return true;
  }
  {
    const MutexLock lock(mutex_);
    if (closing_ || jobs_.size() >= config_.max_waiting ||
        jobs_.SizeOf(client) >= config_.max_waiting_per_client) {
      ++busy_;
      return false;
    }
    jobs_.Put(client, {sha256, path, std::move(done)});
  }
  changed_.NotifyOne();
  return true;
}

void PictureQueue::Work() {
  MutexLock lock(mutex_);
  while (true) {
    while (!closing_ && jobs_.IsEmpty()) changed_.Wait(mutex_);
    if (closing_) return;
    const Job job = jobs_.TakeNext();
    lock.Unlock();
    job.done(cache_.Get(job.sha256, job.path));
    lock.Lock();
  }
}

std::uint64_t PictureQueue::busy() const {
  const MutexLock lock(mutex_);
  return busy_;
}

}  // namespace livemap::zone
