#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "common/huge_pages.h"
#include "common/uuid.h"

namespace livemap::zone {

/// Finds a number by its uuid; the caller keeps the uuids. One flat table of 8 bytes a place, so
/// that a look-up in a large one is a single cache miss. The uuids are the zone's own random ones:
/// nobody else can choose where they land. Not thread-safe.
class UuidIndex {
 public:
  UuidIndex() : places_(16) {}

  std::size_t size() const { return size_; }

  /// The number whose uuid is `uuid`; `uuid_of(number)` answers with the uuid of a number.
  template <typename UuidOf>
  std::optional<std::uint32_t> Find(const Uuid& uuid, const UuidOf& uuid_of) const {
    const std::uint32_t hash = Hash(uuid);
    for (std::size_t i = Home(hash); places_[i].number != kEmpty; i = Next(i)) {
      if (places_[i].hash == hash && uuid_of(places_[i].number) == uuid) return places_[i].number;
    }
    return std::nullopt;
  }
  /// Adds a number below 2^32 - 1 whose uuid is not there yet.
  void Insert(const Uuid& uuid, std::uint32_t number) {
    if (2 * (size_ + 1) > places_.size()) Grow();
    Put({Hash(uuid), number});
    ++size_;
  }
  /// Takes away a number that was inserted with this uuid.
  void Erase(const Uuid& uuid, std::uint32_t number) {
    std::size_t hole = Home(Hash(uuid));
    while (places_[hole].number != number) hole = Next(hole);
    // Backward shift, as SpatialGrid does: no tombstones, so searches stay short for ever.
    for (std::size_t i = Next(hole); places_[i].number != kEmpty; i = Next(i)) {
      const std::size_t home = Home(places_[i].hash);
      const bool stays = hole <= i ? (hole < home && home <= i) : (hole < home || home <= i);
      if (stays) continue;
      places_[hole] = places_[i];
      hole = i;
    }
    places_[hole] = Place{};
    --size_;
  }
  /// Asks for the memory that Find or Insert of this uuid will read.
  void Prefetch(const Uuid& uuid) const { __builtin_prefetch(&places_[Home(Hash(uuid))], 1); }

 private:
  static constexpr std::uint32_t kEmpty = 0xffffffff;
  struct Place {
    std::uint32_t hash = 0;
    std::uint32_t number = kEmpty;
  };

  static std::uint32_t Hash(const Uuid& uuid) {
    std::uint32_t hash = 0;
    std::memcpy(&hash, uuid.bytes.data(), sizeof(hash));
    return hash;
  }
  std::size_t Next(std::size_t i) const { return (i + 1) & (places_.size() - 1); }
  std::size_t Home(std::uint32_t hash) const { return hash & (places_.size() - 1); }
  void Put(Place place) {
    std::size_t i = Home(place.hash);
    while (places_[i].number != kEmpty) i = Next(i);
    places_[i] = place;
  }
  void Grow() {
    decltype(places_) old(2 * places_.size());
    old.swap(places_);
    for (const Place& place : old) {
      if (place.number != kEmpty) Put(place);
    }
  }

  std::vector<Place, HugePageAllocator<Place>>
      places_;  ///< A power of two, at most half full, linear probing.
  std::size_t size_ = 0;
};

}  // namespace livemap::zone
