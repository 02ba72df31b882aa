#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace livemap::tools {

/// How far long work is: one line that rewrites itself on a terminal, with the time left, else
/// plain lines, each about a tenth of the whole, on standard error.
class Progress {
 public:
  Progress(std::string what, std::size_t total);
  void At(std::size_t done);

 private:
  const std::string what_;
  const std::size_t total_;
  const bool terminal_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::size_t said_tenth_ = 0;
};

}  // namespace livemap::tools
