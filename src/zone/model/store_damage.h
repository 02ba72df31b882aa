#pragma once

#include <cstddef>
#include <string>

namespace livemap::zone {

/// What was found in a sound database that the program cannot have written: rows of impossible
/// values. They are left where they are, and not taken in.
struct StoreDamage {
  std::size_t rows = 0;
  std::string first;  ///< One sentence about the first of them; empty when there is none.

  void Note(const std::string& sentence) {
    if (rows++ == 0) first = sentence;
  }
  StoreDamage& operator+=(const StoreDamage& other) {
    if (rows == 0) first = other.first;
    rows += other.rows;
    return *this;
  }
};

}  // namespace livemap::zone
