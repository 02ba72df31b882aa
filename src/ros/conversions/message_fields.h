#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <boost/array.hpp>
#include <cstdint>
#include <string>

#include "common/error.h"
#include "common/uuid.h"

namespace livemap::ros_io {

// Fields that several messages share. Private to the conversions of this module.

/// Throws Error unless the message has a schema version that this program knows: its own, or one
/// from `oldest` on.
template <typename Message>
void CheckVersion(const Message& message, const char* name,
                  std::uint16_t oldest = Message::SCHEMA_VERSION) {
  constexpr std::uint16_t newest = Message::SCHEMA_VERSION;
  if (message.schema_version >= oldest && message.schema_version <= newest) return;
  const std::string first = oldest < newest ? std::to_string(oldest) + " to " : "";
  throw Error(std::string(name) + " has schema version " + std::to_string(message.schema_version) +
              ", accepted is " + first + std::to_string(newest));
}

inline Uuid ToUuid(const boost::array<std::uint8_t, 16>& bytes) {
  Uuid uuid;
  std::copy(bytes.begin(), bytes.end(), uuid.bytes.begin());
  return uuid;
}

inline boost::array<std::uint8_t, 16> ToBytes(const Uuid& uuid) {
  boost::array<std::uint8_t, 16> bytes;
  std::copy(uuid.bytes.begin(), uuid.bytes.end(), bytes.begin());
  return bytes;
}

/// Row-major 2x2, as in HazardReport.msg.
inline boost::array<double, 4> ToArray(const Eigen::Matrix2d& matrix) {
  return {{matrix(0, 0), matrix(0, 1), matrix(1, 0), matrix(1, 1)}};
}

inline Eigen::Matrix2d ToMatrix(const boost::array<double, 4>& array) {
  Eigen::Matrix2d matrix;
  matrix << array[0], array[1], array[2], array[3];
  return matrix;
}

}  // namespace livemap::ros_io
