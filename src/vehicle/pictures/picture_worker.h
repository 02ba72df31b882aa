#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "imaging/report_picture.h"
#include "vehicle/pictures/picture_order.h"

namespace livemap::vehicle {

/// Makes the ordered pictures one after the other on a thread of its own, because finding faces
/// takes longer than anything else that a report needs. The thread runs at a low priority. Every
/// order is answered exactly once, within `max_wait_s`: with its pictures, or with none where the
/// maker withheld or lost them, the queue was full or the time was over. So no report waits for
/// ever, and no more than `max_waiting` images wait.
///
/// Typical usage: Order as orders come up, and Deliver often; both, and all answers, on the one
/// thread that owns it.
class PictureWorker {
 public:
  struct Config {
    int max_waiting = 16;   ///< Orders that wait, not counting the one in work.
    double max_wait_s = 3;  ///< From the order to its answer, s.
  };

  /// Called on the worker's thread. One picture for each cut of the order, or nothing at all where
  /// they must not leave the vehicle; an exception counts as that.
  using Make = std::function<std::vector<imaging::CroppedPicture>(const PictureOrder& order)>;
  /// What became of an order: one picture for each cut, or nothing at all.
  using Answer = std::function<void(std::vector<imaging::CroppedPicture> pictures)>;

  /// Since the start; orders.
  struct Counters {
    std::uint64_t ordered = 0;
    std::uint64_t made = 0;     ///< Answered with pictures.
    std::uint64_t refused = 0;  ///< The queue was full.
    std::uint64_t late = 0;     ///< Not done in time.
  };

  /// Starts the thread.
  PictureWorker(const Config& config, Make make);
  /// Waits for the order in work; the others stay unanswered.
  ~PictureWorker();
  PictureWorker(const PictureWorker&) = delete;
  PictureWorker& operator=(const PictureWorker&) = delete;

  /// `answer` is called by a later Deliver.
  void Order(PictureOrder order, double steady_s, Answer answer);
  /// Answers what is done, and what is late.
  void Deliver(double steady_s);

  const Counters& counters() const { return counters_; }
  /// Orders without answer.
  std::size_t open() const { return open_.size(); }

 private:
  struct Open {
    std::uint64_t ticket;
    double deadline_s;
    Answer answer;
  };
  struct Waiting {
    std::uint64_t ticket;
    PictureOrder order;
  };
  struct Done {
    std::uint64_t ticket;
    std::vector<imaging::CroppedPicture> pictures;
  };

  void Work();
  std::optional<Waiting> Next();
  /// Without effect where the order was answered before.
  void Close(std::uint64_t ticket, std::vector<imaging::CroppedPicture> pictures);

  const Config config_;
  const Make make_;
  // The owner's own:
  std::list<Open> open_;  ///< In the order of their deadlines.
  std::uint64_t last_ticket_ = 0;
  Counters counters_;

  Mutex mutex_;
  ConditionVariable available_;
  std::deque<Waiting> waiting_ GUARDED_BY(mutex_);
  std::vector<Done> done_ GUARDED_BY(mutex_);
  bool closed_ GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace livemap::vehicle
