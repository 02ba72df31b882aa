#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/mutex.h"

namespace livemap::perception {

/// Memory for a network's activations. A network asks for the same few sizes with every image and
/// gives them back, mostly in MiB; the C library returns such to the kernel, which then clears
/// every page again with the next image. Here given-back blocks are kept for the next Take of their
/// size class, and stand in huge pages where the kernel has them. What is held is the most that
/// was ever taken at once, class by class. Thread-safe.
class BlockCache {
 public:
  BlockCache() = default;
  ~BlockCache();
  BlockCache(const BlockCache&) = delete;
  BlockCache& operator=(const BlockCache&) = delete;

  /// At least `bytes` bytes on a boundary of kAlignment, not cleared. Throws std::bad_alloc.
  void* Take(std::size_t bytes);
  /// Gives a block of Take of this cache back; null is nothing.
  void Give(void* block) noexcept;

  static constexpr std::size_t kAlignment = 64;

 private:
  /// Four size classes for each doubling from the smallest to the largest block that is kept;
  /// others come from the C library.
  static constexpr std::size_t kSmallestBits = 16;
  static constexpr std::size_t kLargestBits = 26;
  static constexpr std::size_t kClasses = 4 * (kLargestBits - kSmallestBits) + 1;
  static constexpr std::size_t kSlabBytes = std::size_t{1} << 25;

  struct Slab {
    std::byte* memory;
    std::size_t bytes;
  };
  /// The smallest class of blocks of at least `bytes`; kClasses: too small or too large to keep.
  static std::size_t ClassOf(std::size_t bytes);
  static std::size_t BytesOf(std::size_t size_class);
  std::byte* Carve(std::size_t bytes) REQUIRES(mutex_);

  Mutex mutex_;
  std::array<std::vector<void*>, kClasses> kept_ GUARDED_BY(mutex_);
  std::vector<Slab> slabs_ GUARDED_BY(mutex_);
  std::size_t carved_ GUARDED_BY(mutex_) = 0;  ///< Bytes of the last slab that are blocks.
};

}  // namespace livemap::perception
