#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <boost/array.hpp>
#include <cstdint>
#include <string>

#include "base/error.h"
#include "base/uuid.h"

namespace livemap {

// Fields that several messages share. Private to the conversions of this room.

/// Throws Error unless the message has the schema version that this program knows.
template <typename Message>
void CheckVersion(const Message& message, const char* name) {
  if (message.schema_version == Message::SCHEMA_VERSION) return;
  throw Error(std::string(name) + " has schema version " + std::to_string(message.schema_version) +
              ", accepted is " + std::to_string(Message::SCHEMA_VERSION));
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

}  // namespace livemap
