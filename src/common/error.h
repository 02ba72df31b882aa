#pragma once

#include <stdexcept>
#include <string>

namespace livemap {

/// A mistake of configuration or input that a person can mend: a bad parameter, model, calibration
/// or file. `what()` is one sentence that names the thing, its value and what is accepted.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& sentence);
};

/// The whole file as bytes; throws Error naming `path` when it cannot be read or exceeds
/// `max_bytes`.
std::string ReadFile(const std::string& path, std::size_t max_bytes);

}  // namespace livemap
