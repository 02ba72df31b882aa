#include "web/server/work_queue.h"

#include <algorithm>
#include <utility>

namespace livemap::web {

WorkQueue::WorkQueue(int threads) {
  for (int i = 0; i < std::max(1, threads); ++i) {
    threads_.emplace_back([this] { Work(); });
  }
}

WorkQueue::~WorkQueue() { Stop(); }

void WorkQueue::Post(const std::string& client, Rank rank, Job job) {
  {
    const MutexLock lock(mutex_);
    if (closing_) return;
    (rank == Rank::kOfficial ? officials_ : readers_).Put(client, std::move(job));
  }
  changed_.NotifyOne();
}

void WorkQueue::Stop() {
  // Destroyed after the lock is given back: what a job holds may post.
  Turns<Job> readers;
  Turns<Job> officials;
  {
    const MutexLock lock(mutex_);
    closing_ = true;
    std::swap(readers, readers_);
    std::swap(officials, officials_);
  }
  changed_.NotifyAll();
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
}

void WorkQueue::Work() {
  MutexLock lock(mutex_);
  while (true) {
    while (!closing_ && officials_.IsEmpty() && readers_.IsEmpty()) changed_.Wait(mutex_);
    if (closing_) return;
    Job job = (officials_.IsEmpty() ? readers_ : officials_).TakeNext();
    lock.Unlock();
    job();
    job = nullptr;  // What it holds goes away before the lock is taken.
    lock.Lock();
  }
}

}  // namespace livemap::web
