#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "zone/pictures/picture_cache.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// The small pictures of notices, each made once and kept while it is among those last asked for.
/// Thread-safe.
class NoticePictures {
 public:
  /// `max_bytes` of one picture; 0: there are none.
  NoticePictures(const zone::ZoneService& zone, std::size_t max_bytes);

  /// The picture of this content hash as a small JPEG; empty when there is none or it is not
  /// accepted: the notice counts without it. Takes milliseconds when it must be made.
  std::vector<std::uint8_t> Get(const std::string& sha256);
  /// Get needs no time.
  bool IsReady(const std::string& sha256);

  std::size_t max_bytes() const { return max_bytes_; }
  std::uint64_t failed() const { return cache_.refused(); }

 private:
  const zone::ZoneService& zone_;
  const std::size_t max_bytes_;
  zone::PictureCache cache_;
};

}  // namespace livemap::nodes
