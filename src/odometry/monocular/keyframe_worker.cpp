#include "odometry/monocular/keyframe_worker.h"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <utility>

namespace livemap::odometry {
namespace {

/// On one core the frames go first: they come 30 times a second, and a keyframe may come later.
/// Linux has priorities by thread; where it refuses, nothing is lost.
void LetFramesGoFirst() {
  constexpr int kNiceness = 10;
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNiceness);
}

KeyframeWorker::Made MadeOf(KeyframeWorker::Order order, DepthLearner& learner) {
  KeyframeWorker::Made made;
  made.learnt = learner.Learn({order.smooth, order.result.world_from_camera}, order.metres_per_unit,
                              order.before);
  made.order = std::move(order);
  return made;
}

}  // namespace

KeyframeWorker::KeyframeWorker(DepthLearner& learner, int delay_frames)
    : learner_(learner), delay_frames_(delay_frames) {
  if (delay_frames_ == 0) thread_ = std::thread([this] { Work(); });
}

KeyframeWorker::~KeyframeWorker() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
  }
  changed_.NotifyAll();
  if (thread_.joinable()) thread_.join();
}

void KeyframeWorker::Give(Order order) {
  busy_ = true;
  frames_left_ = delay_frames_;
  const MutexLock lock(mutex_);
  if (delay_frames_ > 0) {
    made_ = MadeOf(std::move(order), learner_);
    return;
  }
  order_ = std::move(order);
  changed_.NotifyAll();
}

std::optional<KeyframeWorker::Made> KeyframeWorker::Take() {
  if (!busy_ || --frames_left_ > 0) return std::nullopt;
  const MutexLock lock(mutex_);
  if (!made_) return std::nullopt;
  busy_ = false;
  return std::exchange(made_, std::nullopt);
}

std::optional<KeyframeWorker::Made> KeyframeWorker::WaitAndTake(double longest_s) {
  if (!busy_) return std::nullopt;
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::nanoseconds>(
                                             std::chrono::duration<double>(longest_s));
  const MutexLock lock(mutex_);
  while (!made_) {
    if (!changed_.WaitUntil(mutex_, deadline)) break;
  }
  if (!made_) return std::nullopt;
  busy_ = false;
  return std::exchange(made_, std::nullopt);
}

void KeyframeWorker::Cancel() {
  const MutexLock lock(mutex_);
  while (busy_ && !made_) changed_.Wait(mutex_);
  made_.reset();
  busy_ = false;
}

void KeyframeWorker::Work() {
  LetFramesGoFirst();
  MutexLock lock(mutex_);
  while (true) {
    while (!closed_ && !order_) changed_.Wait(mutex_);
    if (closed_) return;
    Order order = std::move(*order_);
    order_.reset();
    lock.Unlock();
    Made made = MadeOf(std::move(order), learner_);
    lock.Lock();
    made_ = std::move(made);
    changed_.NotifyAll();
  }
}

}  // namespace livemap::odometry
