#pragma once

#include <atomic>
#include <memory>

namespace livemap::web {

/// Bounds how many answers are made at once that gather something of all hazards before they write,
/// and so take memory by the number of hazards. Thread-safe; outlives what it gave.
class GatheringSlots {
 public:
  static constexpr int kMost = 8;

  /// A slot, free again when the last copy of it is gone; null where all are taken.
  std::shared_ptr<void> Take() {
    if (taken_.fetch_add(1) < kMost) {
      return {this, [](GatheringSlots* slots) { --slots->taken_; }};
    }
    --taken_;
    return nullptr;
  }

 private:
  std::atomic<int> taken_{0};
};

}  // namespace livemap::web
