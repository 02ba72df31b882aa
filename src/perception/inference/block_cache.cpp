#include "perception/inference/block_cache.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <new>

#include "common/huge_pages.h"

namespace livemap::perception {
namespace {

/// In front of each block, as long as the alignment so that the block is aligned too.
struct alignas(BlockCache::kAlignment) Header {
  std::size_t size_class;
};

constexpr std::size_t BlockBytesRoundedUp(std::size_t bytes, std::size_t step) {
  return (bytes + step - 1) / step * step;
}

}  // namespace

BlockCache::~BlockCache() {
  for (const Slab& slab : slabs_)
    HugePageAllocator<std::byte>().deallocate(slab.memory, slab.bytes);
}

std::size_t BlockCache::ClassOf(std::size_t bytes) {
  if (bytes <= BytesOf(0) / 2 || bytes > BytesOf(kClasses - 1)) return kClasses;
  std::size_t size_class = 0;
  while (BytesOf(size_class) < bytes) ++size_class;
  return size_class;
}

std::size_t BlockCache::BytesOf(std::size_t size_class) {
  return (4 + size_class % 4) << (kSmallestBits - 2 + size_class / 4);
}

void* BlockCache::Take(std::size_t bytes) {
  if (bytes > std::numeric_limits<std::size_t>::max() / 2) throw std::bad_alloc();
  const std::size_t with_header = bytes + sizeof(Header);
  const std::size_t size_class = ClassOf(with_header);
  void* memory = nullptr;
  if (size_class == kClasses) {
    memory = std::aligned_alloc(kAlignment, BlockBytesRoundedUp(with_header, kAlignment));
    if (memory == nullptr) throw std::bad_alloc();
  } else {
    const MutexLock lock(mutex_);
    std::vector<void*>& kept = kept_[size_class];
    if (kept.empty()) {
      // Room for every block of the class, so that Give needs no memory.
      kept.reserve(kept.capacity() + 1);
      memory = Carve(BytesOf(size_class));
    } else {
      memory = kept.back();
      kept.pop_back();
    }
  }
  return new (memory) Header{size_class} + 1;
}

void BlockCache::Give(void* block) noexcept {
  if (block == nullptr) return;
  Header* header = static_cast<Header*>(block) - 1;
  if (header->size_class == kClasses) {
    std::free(header);
    return;
  }
  const MutexLock lock(mutex_);
  kept_[header->size_class].push_back(header);
}

std::byte* BlockCache::Carve(std::size_t bytes) {
  if (slabs_.empty() || slabs_.back().bytes - carved_ < bytes) {
    constexpr std::size_t kPage = HugePageAllocator<std::byte>::kPageBytes;
    const std::size_t slab_bytes = std::max(kSlabBytes, BlockBytesRoundedUp(bytes, kPage));
    slabs_.reserve(slabs_.size() + 1);
    slabs_.push_back({HugePageAllocator<std::byte>().allocate(slab_bytes), slab_bytes});
    carved_ = 0;
  }
  std::byte* block = slabs_.back().memory + carved_;
  carved_ += bytes;
  return block;
}

}  // namespace livemap::perception
