#pragma once

#include <cstddef>
#include <cstdint>

namespace livemap::transport {

/// Bytes that somebody else owns and keeps alive.
struct ByteView {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
};

}  // namespace livemap::transport
