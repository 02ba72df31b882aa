#pragma once

#include <ros/callback_queue_interface.h>

#include <boost/make_shared.hpp>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <utility>

namespace livemap::nodelets {

/// Frames that wait to be worked on behind all messages that have come, in the same callback queue:
/// so what costs little (taking in messages) is never kept waiting for what costs much, and no
/// second thread is needed. When more frames wait than may, the oldest goes and is counted: fresh
/// frames matter more than old ones, and a node that is too slow for its camera must not fall
/// behind further with every frame. Not thread-safe: to be used from callbacks of `queue`, which
/// calls one at a time.
template <typename Frame>
class FrameBacklog {
 public:
  using Work = std::function<void(const Frame&)>;

  /// `capacity` >= 1 frames may wait, not counting the one in work. `queue` outlives this.
  FrameBacklog(std::size_t capacity, ros::CallbackQueueInterface& queue, Work work)
      : capacity_(capacity), queue_(queue), work_(std::move(work)) {}
  /// Waits for the frame in work.
  ~FrameBacklog() { queue_.removeByID(Id()); }
  FrameBacklog(const FrameBacklog&) = delete;
  FrameBacklog& operator=(const FrameBacklog&) = delete;

  void Push(Frame frame) {
    ++in_;
    if (frames_.size() == capacity_) {
      frames_.pop_front();
      ++displaced_;
    }
    frames_.push_back(std::move(frame));
    AskForTurn();
  }

  /// What waits is displaced.
  void Clear() {
    displaced_ += frames_.size();
    frames_.clear();
  }

  std::uint64_t in() const { return in_; }                ///< Pushed so far.
  std::uint64_t displaced() const { return displaced_; }  ///< Never worked on.
  std::size_t waiting() const { return frames_.size(); }

 private:
  /// A place in the callback queue, behind what has come.
  class Turn : public ros::CallbackInterface {
   public:
    explicit Turn(FrameBacklog& backlog) : backlog_(backlog) {}
    CallResult call() override {
      backlog_.TakeTurn();
      return Success;
    }

   private:
    FrameBacklog& backlog_;
  };

  /// Asks for the next turn when the work is done, by an error too: behind what came meanwhile.
  struct TurnAfterwards {
    FrameBacklog& backlog;
    ~TurnAfterwards() { backlog.AskForTurn(); }
  };

  std::uint64_t Id() const { return reinterpret_cast<std::uintptr_t>(this); }

  void AskForTurn() {
    if (has_turn_ || frames_.empty()) return;
    has_turn_ = true;
    queue_.addCallback(boost::make_shared<Turn>(*this), Id());
  }

  void TakeTurn() {
    has_turn_ = false;
    if (frames_.empty()) return;  // Cleared meanwhile.
    const Frame frame = std::move(frames_.front());
    frames_.pop_front();
    const TurnAfterwards turn{*this};
    work_(frame);
  }

  const std::size_t capacity_;
  ros::CallbackQueueInterface& queue_;
  const Work work_;
  std::deque<Frame> frames_;
  bool has_turn_ = false;  // One is in the callback queue.
  std::uint64_t in_ = 0;
  std::uint64_t displaced_ = 0;
};

}  // namespace livemap::nodelets
