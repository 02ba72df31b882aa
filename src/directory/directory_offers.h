#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "transport/byte_view.h"

namespace livemap::directory {

/// Zone directories that brokers have sent to a vehicle, until they are looked at: a few of each
/// zone, so that no zone can push out another one's. Thread-safe.
///
/// Typical usage:
///
///     if (const auto why_not = offers.Put("west", payload)) ROS_WARN("%s", why_not->c_str());
///     for (const auto& [zone, bytes] : offers.Take()) file.Offer(bytes);
class DirectoryOffers {
 public:
  /// Of one zone so many wait at most. A zone gives one at a time, and another one only after a new
  /// login or a change of its file.
  static constexpr std::size_t kMostOfAZone = 4;

  /// Keeps what came from the broker of the zone with this id. Returns why it does not, in one
  /// sentence: it is larger than any directory, or as many of that zone wait already.
  std::optional<std::string> Put(const std::string& zone, transport::ByteView payload);
  /// What has come since the last call, the id of the zone and the directory, as it came.
  std::vector<std::pair<std::string, std::string>> Take();

 private:
  Mutex mutex_;
  std::vector<std::pair<std::string, std::string>> offers_ GUARDED_BY(mutex_);
};

}  // namespace livemap::directory
