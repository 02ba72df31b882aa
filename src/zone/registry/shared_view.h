#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "common/clock.h"
#include "common/mutex.h"
#include "geo/geo_box.h"

namespace livemap::zone {

/// The view of a map that is opened (ViewOf), shared by all who ask for it. It is made anew for at
/// most a hundredth of the time, so it may be a little old. Thread-safe.
class SharedView {
 public:
  using Make = std::function<std::optional<geo::GeoBox>()>;
  using Clock = std::function<std::int64_t()>;  ///< Never goes back, ns.

  explicit SharedView(Clock steady_ns = SteadyNs) : steady_ns_(std::move(steady_ns)) {}

  /// The newest view, made by `make` where it is time; none where that makes none. Only the one
  /// caller who makes it waits, and those who come before there is any. What `make` throws is
  /// thrown to that caller; the next one makes it again. No lock is held while `make` runs.
  std::optional<geo::GeoBox> Get(const Make& make);

 private:
  const Clock steady_ns_;
  Mutex mutex_;  ///< Never held while a view is made.
  ConditionVariable changed_;
  std::optional<geo::GeoBox> view_ GUARDED_BY(mutex_);
  /// When it is made anew; none before the first view.
  std::optional<std::int64_t> due_ns_ GUARDED_BY(mutex_);
  bool is_being_made_ GUARDED_BY(mutex_) = false;
};

}  // namespace livemap::zone
