#include "perception/inference/block_cache.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <random>
#include <thread>
#include <utility>
#include <vector>

namespace livemap::perception {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;

TEST(BlockCache, AGivenBackBlockServesTheNextTakeOfAboutItsSize) {
  BlockCache cache;
  void* block = cache.Take(5 * kMiB - 1000);
  cache.Give(block);
  void* again = cache.Take(5 * kMiB - 2000);
  EXPECT_EQ(again, block);
  cache.Give(again);
}

TEST(BlockCache, AMuchSmallerTakeLeavesALargeBlockToWhoNeedsIt) {
  BlockCache cache;
  void* large = cache.Take(5 * kMiB);
  cache.Give(large);
  void* small = cache.Take(kMiB);
  EXPECT_NE(small, large);
  cache.Give(small);
}

TEST(BlockCache, BlocksOfEverySizeAreAligned) {
  BlockCache cache;
  for (const std::size_t bytes :
       {std::size_t{1}, std::size_t{63}, std::size_t{32768}, std::size_t{65472}, std::size_t{65473},
        kMiB, 64 * kMiB - 64, 64 * kMiB, 70 * kMiB}) {
    void* block = cache.Take(bytes);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(block) % BlockCache::kAlignment, 0U) << bytes;
    std::memset(block, 0xA5, bytes);  // The sanitizer's check that they are ours.
    cache.Give(block);
  }
}

TEST(BlockCache, BlocksThatAreTakenAtOnceNeverOverlap) {
  BlockCache cache;
  std::mt19937 random(7);
  std::uniform_int_distribution<std::size_t> sizes(1, 3 * kMiB);
  std::vector<std::pair<unsigned char*, std::size_t>> taken;
  for (int i = 0; i < 400; ++i) {
    if (taken.size() > 20) {
      const std::size_t which = random() % taken.size();
      const auto [block, bytes] = taken[which];
      ASSERT_EQ(block[0], static_cast<unsigned char>(bytes)) << "of " << bytes << " bytes";
      ASSERT_EQ(block[bytes - 1], static_cast<unsigned char>(bytes)) << "of " << bytes << " bytes";
      cache.Give(block);
      taken.erase(taken.begin() + static_cast<std::ptrdiff_t>(which));
    }
    const std::size_t bytes = sizes(random);
    auto* block = static_cast<unsigned char*>(cache.Take(bytes));
    std::memset(block, static_cast<int>(static_cast<unsigned char>(bytes)), bytes);
    taken.emplace_back(block, bytes);
  }
  for (const auto& [block, bytes] : taken) cache.Give(block);
}

TEST(BlockCache, MoreThanTheMachineHasIsRefused) {
  BlockCache cache;
  EXPECT_THROW(cache.Take(std::numeric_limits<std::size_t>::max()), std::bad_alloc);
  EXPECT_THROW(cache.Take(std::numeric_limits<std::size_t>::max() - 100), std::bad_alloc);
}

TEST(BlockCache, NullIsGivenBackAsNothing) { BlockCache().Give(nullptr); }

TEST(BlockCache, ThreadsGetBlocksOfTheirOwn) {
  BlockCache cache;
  std::vector<std::thread> threads;
  for (int id = 0; id < 4; ++id) {
    threads.emplace_back([&cache, id] {
      for (int i = 0; i < 300; ++i) {
        const std::size_t bytes = 40'000 + 7'000 * static_cast<std::size_t>(i % 30);
        auto* block = static_cast<unsigned char*>(cache.Take(bytes));
        std::memset(block, id, bytes);
        ASSERT_EQ(block[bytes / 2], id);
        ASSERT_EQ(block[bytes - 1], id);
        cache.Give(block);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace livemap::perception
