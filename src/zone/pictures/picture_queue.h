#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>

#include "common/mutex.h"
#include "common/queues/turns.h"
#include "zone/pictures/picture_cache.h"

namespace livemap::zone {

/// Makes the pictures that readers ask for on a thread of its own, so that whoever serves readers
/// never decodes. Clients take turns: one that asks for many pictures delays nobody but itself.
/// Thread-safe.
///
/// Typical usage:
///   PictureQueue queue(cache, {});
///   if (!queue.Ask(client, sha256, path, [](const auto& picture) { Serve(picture); })) SayBusy();
class PictureQueue {
 public:
  /// Called with the picture, or with null when it is not accepted, from the queue's thread; must
  /// not block.
  using Done = std::function<void(const PictureCache::File& picture)>;
  struct Config {
    std::size_t max_waiting = 128;            ///< Pictures that wait, of all clients.
    std::size_t max_waiting_per_client = 16;  ///< Further ones are not taken.
  };

  /// `cache` outlives the queue.
  PictureQueue(PictureCache& cache, const Config& config);
  ~PictureQueue();
  PictureQueue(const PictureQueue&) = delete;
  PictureQueue& operator=(const PictureQueue&) = delete;

  /// Takes the picture of this content hash, stored at `path`, into the queue; false when too many
  /// wait. A picture that the cache keeps is answered at once, before Ask returns.
  bool Ask(const std::string& client, const std::string& sha256, const std::string& path,
           Done done);

  /// Ends after the picture that is being made; what waits is dropped without a call, and nothing
  /// is taken any more. When it returns, nothing is being called.
  void Stop();

  /// How often a picture was not taken because too many waited, since the start.
  std::uint64_t busy() const;

 private:
  struct Job {
    std::string sha256;
    std::string path;
    Done done;
  };

  void Work();

  PictureCache& cache_;
  const Config config_;
  mutable Mutex mutex_;
  ConditionVariable changed_;
  Turns<Job> jobs_ GUARDED_BY(mutex_);
  std::uint64_t busy_ GUARDED_BY(mutex_) = 0;
  bool closing_ GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace livemap::zone
