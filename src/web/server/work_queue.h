#pragma once

#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "common/mutex.h"
#include "common/queues/turns.h"

namespace livemap::web {

/// Does the server's work on threads of its own, so that those that read and write sockets never
/// wait for the zone. Officials' jobs go first. Among officials, and among all others, clients take
/// turns: however many connections one client works on, any other one waits for a single job of
/// it. Thread-safe.
///
/// Typical usage:
///   WorkQueue work(2);
///   work.Post(client, WorkQueue::Rank::kReader, [] { MakeNextPiece(); });
class WorkQueue {
 public:
  /// A short piece of work, which must not throw.
  using Job = std::function<void()>;
  enum class Rank {
    kReader,   ///< Anybody.
    kOfficial  ///< Whoever has shown a valid token.
  };

  /// Starts `threads` threads, at least one.
  explicit WorkQueue(int threads);
  ~WorkQueue();
  WorkQueue(const WorkQueue&) = delete;
  WorkQueue& operator=(const WorkQueue&) = delete;

  /// Has the job done for this client; drops it, without a call, after Stop().
  void Post(const std::string& client, Rank rank, Job job);
  /// Ends after the jobs that are being done; what waits is dropped without a call. When it
  /// returns, nothing is being done.
  void Stop();

 private:
  void Work();

  Mutex mutex_;
  ConditionVariable changed_;
  Turns<Job> readers_ GUARDED_BY(mutex_);
  Turns<Job> officials_ GUARDED_BY(mutex_);
  bool closing_ GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

}  // namespace livemap::web
