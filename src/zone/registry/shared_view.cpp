#include "zone/registry/shared_view.h"

namespace livemap::zone {
namespace {

/// A view is made for one part of so many of the time.
constexpr std::int64_t kShareOfTime = 100;

}  // namespace

std::optional<geo::GeoBox> SharedView::Get(const Make& make) {
  MutexLock lock(mutex_);
  while (is_being_made_ && !due_ns_) changed_.Wait(mutex_);
  const std::int64_t begin_ns = steady_ns_();
  if (is_being_made_ || (due_ns_ && begin_ns < *due_ns_)) return view_;
  is_being_made_ = true;
  lock.Unlock();
  std::optional<geo::GeoBox> view;
  try {
    view = make();
  } catch (...) {
    lock.Lock();
    is_being_made_ = false;
    changed_.NotifyAll();
    throw;
  }
  lock.Lock();
  view_ = view;
  const std::int64_t end_ns = steady_ns_();
  due_ns_ = end_ns + kShareOfTime * (end_ns - begin_ns);
  is_being_made_ = false;
  changed_.NotifyAll();
  return view_;
}

}  // namespace livemap::zone
