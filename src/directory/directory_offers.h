#pragma once

#include <map>
#include <optional>
#include <string>

#include "common/mutex.h"
#include "transport/byte_view.h"

namespace livemap::directory {

/// Zone directories that brokers have sent to a vehicle, until they are looked at: the last one of
/// each zone, so that no zone can push out another one's. Thread-safe.
///
/// Typical usage:
///
///     if (const auto why_not = offers.Put("west", payload)) ROS_WARN("%s", why_not->c_str());
///     for (const auto& [zone, bytes] : offers.Take()) file.Offer(bytes);
class DirectoryOffers {
 public:
  /// Keeps what came from the broker of the zone with this id in place of what came before. Returns
  /// why it does not, in one sentence: it is larger than any directory.
  std::optional<std::string> Put(const std::string& zone, transport::ByteView payload);
  /// What has come since the last call, by zone.
  std::map<std::string, std::string> Take();

 private:
  Mutex mutex_;
  std::map<std::string, std::string> offers_ GUARDED_BY(mutex_);
};

}  // namespace livemap::directory
