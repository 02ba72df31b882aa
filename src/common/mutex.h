#pragma once

#include <pthread.h>
#include <sched.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <mutex>

/// Clang's thread-safety analysis (https://clang.llvm.org/docs/ThreadSafetyAnalysis.html): the
/// clang builds check with -Wthread-safety what these annotations say. Other compilers see nothing.
#if defined(__clang__)
#define LIVEMAP_THREAD_ANNOTATION(x) __attribute__((x))
#else
#define LIVEMAP_THREAD_ANNOTATION(x)
#endif
/// The member may be read or written only while the mutex is held.
#define GUARDED_BY(mutex) LIVEMAP_THREAD_ANNOTATION(guarded_by(mutex))
/// What the pointer points to may be used only while the mutex is held.
#define PT_GUARDED_BY(mutex) LIVEMAP_THREAD_ANNOTATION(pt_guarded_by(mutex))
/// The caller holds the mutex.
#define REQUIRES(...) LIVEMAP_THREAD_ANNOTATION(requires_capability(__VA_ARGS__))
/// The caller holds the mutex at least for reading.
#define REQUIRES_SHARED(...) LIVEMAP_THREAD_ANNOTATION(requires_shared_capability(__VA_ARGS__))
/// The caller must not hold the mutex, since the function locks it.
#define EXCLUDES(...) LIVEMAP_THREAD_ANNOTATION(locks_excluded(__VA_ARGS__))
/// This mutex is always locked before the others.
#define ACQUIRED_BEFORE(...) LIVEMAP_THREAD_ANNOTATION(acquired_before(__VA_ARGS__))
/// The function locks in a way that the analysis cannot follow.
#define NO_THREAD_SAFETY_ANALYSIS LIVEMAP_THREAD_ANNOTATION(no_thread_safety_analysis)

namespace livemap {

class ConditionVariable;

/// A std::mutex that the thread-safety analysis knows.
///
/// Typical usage:
///
///   Mutex mutex_;
///   std::deque<Item> items_ GUARDED_BY(mutex_);
///   ...
///   const MutexLock lock(mutex_);
///   items_.push_back(item);
class LIVEMAP_THREAD_ANNOTATION(capability("mutex")) Mutex {
 public:
  void Lock() LIVEMAP_THREAD_ANNOTATION(acquire_capability()) { mutex_.lock(); }
  void Unlock() LIVEMAP_THREAD_ANNOTATION(release_capability()) { mutex_.unlock(); }
  /// Tells the analysis that the mutex is held, which it cannot see inside a lambda. Nothing is
  /// checked at run time: whoever runs the lambda holds the mutex.
  void AssertHeld() const LIVEMAP_THREAD_ANNOTATION(assert_capability(this)) {}

 private:
  friend class ConditionVariable;
  std::mutex mutex_;
};

/// A lock for one writer or many readers. A waiting writer goes before readers that come after it,
/// so that readers who overlap without pause cannot keep it out, as they can with
/// std::shared_mutex, which lets readers pass. A thread that holds the lock for reading must
/// therefore not lock it again: a writer that came in between would wait for that thread, and that
/// thread for the writer.
class LIVEMAP_THREAD_ANNOTATION(capability("shared mutex")) SharedMutex {
 public:
  SharedMutex() {
    // None of these calls fails for attributes and a kind that exist.
    pthread_rwlockattr_t writers_first;
    pthread_rwlockattr_init(&writers_first);
    pthread_rwlockattr_setkind_np(&writers_first, PTHREAD_RWLOCK_PREFER_WRITER_NONRECURSIVE_NP);
    pthread_rwlock_init(&lock_, &writers_first);
    pthread_rwlockattr_destroy(&writers_first);
  }
  ~SharedMutex() { pthread_rwlock_destroy(&lock_); }
  SharedMutex(const SharedMutex&) = delete;
  SharedMutex& operator=(const SharedMutex&) = delete;

  void Lock() LIVEMAP_THREAD_ANNOTATION(acquire_capability()) { pthread_rwlock_wrlock(&lock_); }
  void Unlock() LIVEMAP_THREAD_ANNOTATION(release_capability()) { pthread_rwlock_unlock(&lock_); }
  void LockShared() LIVEMAP_THREAD_ANNOTATION(acquire_shared_capability()) {
    // Too many readers at once give an error of their own, and none of the lock.
    while (pthread_rwlock_rdlock(&lock_) == EAGAIN) sched_yield();
  }
  void UnlockShared() LIVEMAP_THREAD_ANNOTATION(release_shared_capability()) {
    pthread_rwlock_unlock(&lock_);
  }

 private:
  pthread_rwlock_t lock_;
};

/// Holds a Mutex from its construction to its end. Unlock and Lock open a gap in between.
class LIVEMAP_THREAD_ANNOTATION(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) LIVEMAP_THREAD_ANNOTATION(acquire_capability(mutex))
      : mutex_(mutex) {
    mutex_.Lock();
  }
  ~MutexLock() LIVEMAP_THREAD_ANNOTATION(release_capability()) {
    if (held_) mutex_.Unlock();
  }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void Unlock() LIVEMAP_THREAD_ANNOTATION(release_capability()) {
    held_ = false;
    mutex_.Unlock();
  }
  void Lock() LIVEMAP_THREAD_ANNOTATION(acquire_capability()) {
    mutex_.Lock();
    held_ = true;
  }

 private:
  Mutex& mutex_;
  bool held_ = true;
};

/// Holds a SharedMutex for writing.
class LIVEMAP_THREAD_ANNOTATION(scoped_lockable) WriterLock {
 public:
  explicit WriterLock(SharedMutex& mutex) LIVEMAP_THREAD_ANNOTATION(acquire_capability(mutex))
      : mutex_(mutex) {
    mutex_.Lock();
  }
  ~WriterLock() LIVEMAP_THREAD_ANNOTATION(release_capability()) { mutex_.Unlock(); }
  WriterLock(const WriterLock&) = delete;
  WriterLock& operator=(const WriterLock&) = delete;

 private:
  SharedMutex& mutex_;
};

/// Holds a SharedMutex for reading.
class LIVEMAP_THREAD_ANNOTATION(scoped_lockable) ReaderLock {
 public:
  explicit ReaderLock(SharedMutex& mutex)
      LIVEMAP_THREAD_ANNOTATION(acquire_shared_capability(mutex))
      : mutex_(mutex) {
    mutex_.LockShared();
  }
  ~ReaderLock() LIVEMAP_THREAD_ANNOTATION(release_capability()) { mutex_.UnlockShared(); }
  ReaderLock(const ReaderLock&) = delete;
  ReaderLock& operator=(const ReaderLock&) = delete;

 private:
  SharedMutex& mutex_;
};

/// A std::condition_variable for Mutex. Its waits take no predicate, so that the analysis sees
/// the condition: `while (!ready_) changed_.Wait(mutex_);`.
class ConditionVariable {
 public:
  void NotifyOne() { condition_.notify_one(); }
  void NotifyAll() { condition_.notify_all(); }

  /// Gives the mutex up, waits for a notification (or wakes without one), and holds it again.
  void Wait(Mutex& mutex) REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    condition_.wait(lock);
    lock.release();
  }
  /// The same until `deadline` at the latest; false when it has passed.
  template <typename Clock, typename Duration>
  bool WaitUntil(Mutex& mutex, const std::chrono::time_point<Clock, Duration>& deadline)
      REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    const bool in_time = condition_.wait_until(lock, deadline) == std::cv_status::no_timeout;
    lock.release();
    return in_time;
  }
  /// The same for `duration` at the longest.
  template <typename Rep, typename Period>
  bool WaitFor(Mutex& mutex, const std::chrono::duration<Rep, Period>& duration) REQUIRES(mutex) {
    return WaitUntil(mutex, std::chrono::steady_clock::now() + duration);
  }

 private:
  std::condition_variable condition_;
};

}  // namespace livemap
