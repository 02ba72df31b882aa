#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "zone/pictures/picture_recoder.h"

namespace livemap::zone {

/// The pictures as people see them: encoded anew when first asked for, then kept in memory up to a
/// bound, the ones not asked for longest going first. Thread-safe.
///
/// Encoding happens here and not where reports are committed because it costs milliseconds and a
/// commit has microseconds for each report, and because few of the pictures are ever looked at.
/// One picture is decoded at a time, so that hostile ones cannot multiply their memory.
class ServedPictures {
 public:
  using File = std::shared_ptr<const std::vector<std::uint8_t>>;

  /// `max_bytes` of encoded pictures are kept.
  ServedPictures(const PictureLimits& limits, std::size_t max_bytes)
      : limits_(limits), max_bytes_(max_bytes) {}

  /// The picture of this content hash, stored at `path`, as a JPEG; null when it cannot be read or
  /// is not accepted, which is remembered too.
  File Get(const std::string& sha256, const std::string& path);

  /// Of encoded pictures that are kept now.
  std::size_t total_bytes() const;

 private:
  struct Entry {
    File file;  ///< Null: not accepted.
    std::list<std::string>::iterator use;
  };

  bool Find(const std::string& sha256, File& file);
  void Keep(const std::string& sha256, const File& file);

  const PictureLimits limits_;
  const std::size_t max_bytes_;
  std::mutex encoding_;  ///< Held while a picture is decoded; taken before `mutex_`.
  mutable std::mutex mutex_;
  std::unordered_map<std::string, Entry> entries_;
  std::list<std::string> uses_;  ///< Content hashes, the one asked for last in front.
  std::size_t total_bytes_ = 0;
};

}  // namespace livemap::zone
