#pragma once

#include <cstddef>
#include <string>

namespace livemap {

/// SHA-256 (FIPS 180-4) of `size` bytes as 64 lower-case hexadecimal digits.
std::string Sha256Hex(const void* data, std::size_t size);

inline std::string Sha256Hex(const std::string& bytes) {
  return Sha256Hex(bytes.data(), bytes.size());
}

}  // namespace livemap
