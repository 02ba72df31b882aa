#pragma once

#include <chrono>
#include <thread>

namespace livemap::transport {

/// Waits for a condition of another thread; the limit only keeps a broken test from hanging.
template <typename Condition>
bool Eventually(Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

}  // namespace livemap::transport
