#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// The small pictures of notices, each made once and kept while it is among the newest.
/// Thread-safe.
class NoticePictures {
 public:
  /// `max_bytes` of one picture; 0: there are none.
  NoticePictures(const zone::ZoneService& zone, std::size_t max_bytes)
      : zone_(zone), max_bytes_(max_bytes) {}

  /// The picture of this content hash as a small JPEG; empty when there is none or it is not
  /// accepted. Takes milliseconds when it must be made.
  std::vector<std::uint8_t> Get(const std::string& sha256);
  /// Get needs no time.
  bool IsReady(const std::string& sha256) const;

  std::size_t max_bytes() const { return max_bytes_; }
  std::uint64_t failed() const { return failed_; }

 private:
  static constexpr std::size_t kMaxKept = 4096;

  std::optional<std::vector<std::uint8_t>> Make(const std::string& sha256);

  const zone::ZoneService& zone_;
  const std::size_t max_bytes_;
  std::atomic<std::uint64_t> failed_{0};
  std::mutex making_;         ///< One picture is decoded at a time: taken before `mutex_`.
  mutable std::mutex mutex_;  ///< Guards what follows.
  std::map<std::string, std::vector<std::uint8_t>> kept_;
  std::deque<std::string> order_;
};

}  // namespace livemap::nodes
