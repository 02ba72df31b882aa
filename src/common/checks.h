#pragma once

#include <string>

#include "common/error.h"

namespace livemap {

/// Throws Error that names the value and what is accepted unless it lies within both, edges
/// included. NaN lies nowhere.
inline void CheckRange(const char* name, double value, double min, double max) {
  if (value >= min && value <= max) return;
  throw Error(std::string(name) + " is " + std::to_string(value) + ", accepted is " +
              std::to_string(min) + " to " + std::to_string(max));
}

}  // namespace livemap
