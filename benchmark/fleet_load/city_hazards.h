#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>
#include <vector>

namespace livemap::bench {

/// The hazards that are really there: each has a number, a place and an end. No two are so close
/// that the zone could take them for one.
class CityHazards {
 public:
  /// Puts a hazard there; its number, or none when another is too close.
  std::optional<std::uint32_t> Add(const Eigen::Vector2d& place_m);
  void End(std::uint32_t hazard) { is_there_[hazard] = false; }

  bool IsThere(std::uint32_t hazard) const { return is_there_[hazard]; }
  const Eigen::Vector2d& PlaceOf(std::uint32_t hazard) const { return places_[hazard]; }
  std::size_t size() const { return places_.size(); }
  /// The hazard at a place that the zone names, there or ended.
  std::optional<std::uint32_t> FindAt(const Eigen::Vector2d& place_m) const;
  /// Calls `visit` with each hazard, there or ended, within `radius_m`, at most kCellM.
  void Visit(const Eigen::Vector2d& place_m, double radius_m,
             const std::function<void(std::uint32_t)>& visit) const;

  static constexpr double kCellM = 50;
  static constexpr double kApartM = 20;  ///< At least, between two hazards.

 private:
  static std::uint64_t Cell(std::int64_t east, std::int64_t north) {
    return static_cast<std::uint64_t>(east) << 32 ^ static_cast<std::uint32_t>(north);
  }

  std::vector<Eigen::Vector2d> places_;
  std::vector<bool> is_there_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

}  // namespace livemap::bench
