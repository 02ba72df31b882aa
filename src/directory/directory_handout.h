#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/mutex.h"
#include "common/queues/token_bucket.h"
#include "directory/directory_file.h"

namespace livemap::directory {

/// Says when a zone gives its file with the zone directory to which vehicle: at the first message
/// of the vehicle, at the first one after the directory changed, and again after a time, because a
/// broker that is killed may lose what it had for a vehicle. All vehicles together get so many
/// bytes a second that the zone's other messages are not held up. Thread-safe.
///
/// Typical usage:
///
///     if (handout.ReadIfChanged() && !handout.damage().empty()) ROS_WARN(...);
///     handout.Hear("car-1");
///     for (const auto& gift : handout.Next(now_ns)) Publish(TopicOf(gift.vehicle), *gift.bytes);
class DirectoryHandout {
 public:
  struct Config {
    double repeat_s = 600;               ///< A vehicle is given the directory again after this.
    std::size_t max_vehicles = 100'000;  ///< Beyond it all are given it anew.
    double bytes_per_s = 1 << 20;        ///< To all vehicles.
  };

  /// A vehicle and what it is to be given.
  struct Gift {
    std::string vehicle;
    std::shared_ptr<const std::string> bytes;
  };

  DirectoryHandout(DirectoryFile file, const Config& config);

  /// As DirectoryFile::ReadIfChanged. A directory of another version goes to every vehicle.
  bool ReadIfChanged();
  /// What was wrong with the file that was read last; empty: nothing.
  std::string damage() const;
  /// Version of the directory that is given to vehicles; 0: none is.
  std::uint64_t version() const;

  /// A message of this vehicle has come.
  void Hear(const std::string& vehicle);
  /// What is to be given now to vehicles that were heard; then they count as given. `now_ns` is of
  /// a clock that never goes back.
  std::vector<Gift> Next(std::int64_t now_ns);
  /// It could not be sent to that vehicle, or nobody was there to take it: the vehicle is given it
  /// at its next message.
  void TakeBack(const std::string& vehicle);
  /// Nobody counts as given any more: the broker began anew.
  void TakeBackAll();

 private:
  const Config config_;
  mutable Mutex mutex_;
  DirectoryFile file_ GUARDED_BY(mutex_);
  std::shared_ptr<const std::string> bytes_ GUARDED_BY(mutex_);
  std::unordered_map<std::string, std::int64_t> given_ns_ GUARDED_BY(mutex_);  // By vehicle.
  std::set<std::string> heard_ GUARDED_BY(mutex_);
  TokenBucket budget_ GUARDED_BY(mutex_);  // Bytes.
};

}  // namespace livemap::directory
