#include "zone/registry/map_view.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>
#include <utility>

#include "geo/wgs84.h"

namespace livemap::zone {
namespace {

constexpr double kCellM = 25e3;    // Places within so far of each other count together.
constexpr double kReachM = 50e3;   // The view shows what lies within so far of its middle.
constexpr double kTrimmed = 0.01;  // Share of the votes that are left out on each side.
constexpr double kMargin = 0.1;    // Of its size, on each side.
constexpr double kMinHalfM = 500;  // From its middle to its edges.
constexpr double kMPerDegree = 111e3;
constexpr double kEarthM = 6371e3;  // Only to sort places into cells.

using Cell = std::array<int, 3>;

struct Votes {
  double weight = 0;
  Eigen::Vector3d sum_m = Eigen::Vector3d::Zero();  // Weighted places.
};

Eigen::Vector3d OnSphere(const geo::GeoPoint& point) {
  const double latitude = point.latitude_deg * geo::kRadiansPerDegree;
  const double longitude = point.longitude_deg * geo::kRadiansPerDegree;
  return kEarthM * Eigen::Vector3d(std::cos(latitude) * std::cos(longitude),
                                   std::cos(latitude) * std::sin(longitude), std::sin(latitude));
}

geo::GeoPoint FromSphere(const Eigen::Vector3d& place_m) {
  return {std::atan2(place_m.z(), place_m.head<2>().norm()) / geo::kRadiansPerDegree,
          std::atan2(place_m.y(), place_m.x()) / geo::kRadiansPerDegree};
}

/// To -180..180.
double Wrapped(double longitude_deg) { return std::remainder(longitude_deg, 360.0); }

std::vector<double> WeightsOf(const std::vector<ViewHazard>& hazards) {
  std::unordered_map<std::uint64_t, double> counts;
  const auto for_voters = [](const ViewHazard& hazard, const auto& take) {
    bool any = false;
    for (const std::uint64_t vehicle : hazard.supporters) {
      if (vehicle == 0) continue;
      any = true;
      take(vehicle);
    }
    if (!any) take(0);
  };
  for (const ViewHazard& hazard : hazards) {
    for_voters(hazard, [&](std::uint64_t vehicle) { counts[vehicle] += 1; });
  }
  std::vector<double> weights;
  weights.reserve(hazards.size());
  for (const ViewHazard& hazard : hazards) {
    double weight = 0;
    for_voters(hazard, [&](std::uint64_t vehicle) {
      const double count = counts[vehicle];
      weight += std::log1p(count) / count;
    });
    weights.push_back(weight);
  }
  return weights;
}

Cell CellOf(const Eigen::Vector3d& place_m) {
  Cell cell{};
  for (int axis = 0; axis < 3; ++axis) {
    cell[static_cast<std::size_t>(axis)] = static_cast<int>(std::floor(place_m[axis] / kCellM));
  }
  return cell;
}

/// The middle of the votes around the cell that has the most of them with its neighbours.
Eigen::Vector3d MiddleOf(const std::vector<ViewHazard>& hazards,
                         const std::vector<double>& weights) {
  std::map<Cell, Votes> cells;
  for (std::size_t i = 0; i < hazards.size(); ++i) {
    const Eigen::Vector3d place_m = OnSphere(hazards[i].position);
    Votes& votes = cells[CellOf(place_m)];
    votes.weight += weights[i];
    votes.sum_m += weights[i] * place_m;
  }
  Votes best;
  for (const auto& [cell, own] : cells) {
    Votes around;
    for (int i = 0; i < 27; ++i) {
      const Cell near{cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1};
      const auto votes = cells.find(near);
      if (votes == cells.end()) continue;
      around.weight += votes->second.weight;
      around.sum_m += votes->second.sum_m;
    }
    // Among equals the first in the order of cells; rounding decides nothing.
    if (around.weight > best.weight * (1 + 1e-9)) best = around;
  }
  return best.sum_m / best.weight;
}

/// The range of the values without the outermost share of the weights on each side.
std::pair<double, double> TrimmedRange(std::vector<std::pair<double, double>> values) {
  std::sort(values.begin(), values.end());
  double total = 0;
  for (const auto& value : values) total += value.second;
  std::size_t first = 0;
  std::size_t last = values.size() - 1;
  double left = kTrimmed * total;
  while (first < last && values[first].second < left) left -= values[first++].second;
  left = kTrimmed * total;
  while (last > first && values[last].second < left) left -= values[last--].second;
  return {values[first].first, values[last].first};
}

}  // namespace

std::optional<geo::GeoBox> ViewOf(const std::vector<ViewHazard>& hazards) {
  if (hazards.empty()) return std::nullopt;
  const std::vector<double> weights = WeightsOf(hazards);
  const geo::GeoPoint middle = FromSphere(MiddleOf(hazards, weights));
  const geo::LocalFrame frame(middle);
  std::vector<std::pair<double, double>> east_m;
  std::vector<std::pair<double, double>> north_m;
  for (std::size_t i = 0; i < hazards.size(); ++i) {
    if (geo::GeodesicDistanceM(middle, hazards[i].position) > kReachM) continue;
    const Eigen::Vector2d place_m = frame.ToEnu(hazards[i].position);
    east_m.emplace_back(place_m.x(), weights[i]);
    north_m.emplace_back(place_m.y(), weights[i]);
  }
  if (east_m.empty()) {  // Two crowds at the far ends of one neighbourhood; it has a middle.
    east_m.emplace_back(0, 1);
    north_m.emplace_back(0, 1);
  }
  const auto [west_m, far_east_m] = TrimmedRange(std::move(east_m));
  const auto [south_m, far_north_m] = TrimmedRange(std::move(north_m));
  const geo::GeoPoint centre =
      frame.ToGeo({(west_m + far_east_m) / 2, (south_m + far_north_m) / 2});
  const auto half = [](double from_m, double to_m) {
    return std::max(kMinHalfM, (0.5 + kMargin) * (to_m - from_m));
  };
  const double half_north_deg = half(south_m, far_north_m) / kMPerDegree;
  geo::GeoBox view;
  view.south_west.latitude_deg = std::max(-90.0, centre.latitude_deg - half_north_deg);
  view.north_east.latitude_deg = std::min(90.0, centre.latitude_deg + half_north_deg);
  const double poleward_deg =
      std::min(90.0, std::max(-view.south_west.latitude_deg, view.north_east.latitude_deg));
  const double m_per_degree = kMPerDegree * std::cos(poleward_deg * geo::kRadiansPerDegree);
  const double half_east_m = half(west_m, far_east_m);
  if (half_east_m >= 180 * m_per_degree) {  // Around a pole.
    view.south_west.longitude_deg = -180;
    view.north_east.longitude_deg = 180;
    return view;
  }
  const double half_east_deg = half_east_m / m_per_degree;
  view.south_west.longitude_deg = Wrapped(centre.longitude_deg - half_east_deg);
  view.north_east.longitude_deg = Wrapped(centre.longitude_deg + half_east_deg);
  return view;
}

}  // namespace livemap::zone
