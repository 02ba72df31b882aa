#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::streets {

/// The house numbers of an area, found by place and street. It takes some 24 bytes per number. It
/// does not change after AddressMapBuilder::Build, and threads may share it.
class AddressMap {
 public:
  std::size_t size() const { return addresses_.size(); }
  /// Bytes in memory.
  std::size_t bytes() const;
  /// The number nearest to a place, of a street of that name, within `radius_m`; empty where there
  /// is none, for a place that is not valid, and for a radius that is not in 0 to 200 m.
  std::string NumberNear(const geo::GeoPoint& place, const std::string& street,
                         double radius_m) const;

 private:
  friend class AddressMapBuilder;

  struct Address {
    std::uint64_t cell;
    std::int32_t latitude;   // 1e-7 degrees.
    std::int32_t longitude;  // The same.
    std::uint32_t street;    // In texts_.
    std::uint32_t number;    // In texts_.
  };

  std::vector<Address> addresses_;  // By cell.
  std::vector<std::string> texts_;
  std::unordered_map<std::string, std::uint32_t> street_numbers_;  // Of names of streets.
};

/// Makes an AddressMap: first the addresses that stand at nodes by their ids, then places, then
/// Build.
class AddressMapBuilder {
 public:
  /// More addresses are refused.
  explicit AddressMapBuilder(std::size_t max_addresses = 20'000'000)
      : max_addresses_(max_addresses) {}

  /// A house whose place is that of a node. Texts of more than 256 bytes are cut. Throws Error for
  /// more addresses than are accepted.
  void AddAtNode(const std::string& street, const std::string& number, std::int64_t node);
  /// The first call ends the adding at nodes: the place of a node, with the address that it has
  /// itself, if any (both texts not empty). Throws as AddAtNode.
  void SetPlace(std::int64_t node, const geo::GeoPoint& place, const std::string& street,
                const std::string& number);
  /// Houses whose node has no place are left out. The builder is empty afterwards.
  AddressMap Build();

 private:
  struct Waiting {
    std::int64_t node;
    std::uint32_t street, number;
  };

  std::uint32_t NumberOf(const std::string& text);
  void Put(const geo::GeoPoint& place, std::uint32_t street, std::uint32_t number);

  std::size_t max_addresses_;
  AddressMap map_;
  std::unordered_map<std::string, std::uint32_t> text_numbers_;
  std::vector<Waiting> waiting_;
  bool sorted_ = false;
};

}  // namespace livemap::streets
