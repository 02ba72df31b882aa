#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "common/huge_pages.h"
#include "common/uuid.h"
#include "zone/belief/hazard_fusion.h"
#include "zone/belief/hazard_lifecycle.h"

namespace livemap::zone {

/// A picture's name in 33 bytes: format and the SHA-256 itself.
class PackedPicture {
 public:
  PackedPicture() = default;
  /// `sha256`: 64 hex digits or empty. What is neither, or of an unknown format, packs to none.
  PackedPicture(const std::string& sha256, const std::string& format);

  bool empty() const { return format_ == 0; }
  std::string Sha256() const;
  std::string Format() const;

 private:
  std::uint8_t format_ = 0;  ///< 1 + place in the list of formats; 0: no picture.
  std::array<std::uint8_t, 32> sha256_{};
};

/// A hazard as the registry keeps it: no memory of its own behind it, so that copies are cheap and
/// a look at it touches one place.
struct HazardRecord {
  Uuid uuid;
  HazardEstimate estimate;
  std::uint64_t sequence = 0;
  std::uint64_t announced_sequence = 0;
  std::int64_t updated_ns = 0;
  std::uint32_t id = 0;            ///< In the store, from 1.
  std::uint32_t hazard_class = 0;  ///< Place in the registry's list of classes.
  float presence = 1;
  float course_rad = std::numeric_limits<float>::quiet_NaN();  ///< As Hazard::course_rad.
  PackedPicture picture;
  PresenceRecord life;  ///< With the state.
};

/// Records by slot, in blocks that never move: growth costs one block, not a copy of everything.
class HazardRecords {
 public:
  std::size_t size() const { return size_; }
  HazardRecord& operator[](std::size_t slot) { return blocks_[slot / kBlock][slot % kBlock]; }
  const HazardRecord& operator[](std::size_t slot) const {
    return blocks_[slot / kBlock][slot % kBlock];
  }
  void push_back(const HazardRecord& record) {
    if (size_ == blocks_.size() * kBlock) {
      blocks_.emplace_back();
      blocks_.back().reserve(kBlock);
    }
    blocks_[size_ / kBlock].push_back(record);
    ++size_;
  }
  void pop_back() {
    --size_;
    blocks_[size_ / kBlock].pop_back();
    if (blocks_.back().empty()) blocks_.pop_back();
  }

 private:
  /// As many as fit into some huge pages.
  static constexpr std::size_t kBlock =
      8 * HugePageAllocator<HazardRecord>::kPageBytes / sizeof(HazardRecord);
  std::vector<std::vector<HazardRecord, HugePageAllocator<HazardRecord>>> blocks_;
  std::size_t size_ = 0;
};

}  // namespace livemap::zone
