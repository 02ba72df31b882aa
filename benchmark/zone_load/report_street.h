#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "geo/wgs84.h"
#include "protocol/report.h"

namespace livemap::bench {

/// Which reports a fleet sends: every hazard is reported by two vehicles, first by its own, then by
/// the next one. Vehicles drive north beside each other, one lane each, a hazard per step.
class ReportStreet {
 public:
  struct Place {
    std::uint32_t row = 0;
    std::uint32_t lane = 0;
    std::uint64_t Key() const { return std::uint64_t{row} << 32 | lane; }
  };

  /// `first_ns`: stamp of every vehicle's first report.
  ReportStreet(std::uint32_t vehicles, std::int64_t first_ns)
      : vehicles_(vehicles), first_ns_(first_ns) {}

  /// Of vehicle `vehicle`'s report number `step`: even ones are new, odd ones confirm.
  Place PlaceOf(std::uint32_t vehicle, std::uint32_t step) const {
    const bool confirms = step % 2 == 1;
    return {step / 2, confirms ? (vehicle + vehicles_ - 1) % vehicles_ : vehicle};
  }
  /// Without uuid and vehicle.
  protocol::Report ReportOf(std::uint32_t vehicle, std::uint32_t step) const {
    const Place place = PlaceOf(vehicle, step);
    protocol::Report report;
    report.drive_id = "load";
    report.stamp_ns = first_ns_ + std::int64_t{step} * kStepNs;
    report.class_name = "pothole";
    report.confidence = 0.7F;
    report.box = {10, 20, 110, 90};
    report.position = {kCorner.latitude_deg + place.row * kDegreesNorth,
                       kCorner.longitude_deg + place.lane * kDegreesEast};
    report.covariance_m2 = Eigen::Vector2d(1.0, 1.0).asDiagonal();
    report.image_width = 640;
    report.image_height = 480;
    return report;
  }
  /// Of the hazard at this position; none when it is not one of ours.
  std::optional<Place> PlaceAt(const geo::GeoPoint& position) const {
    const double row = std::round((position.latitude_deg - kCorner.latitude_deg) / kDegreesNorth);
    const double lane = std::round((position.longitude_deg - kCorner.longitude_deg) / kDegreesEast);
    if (!(row >= 0 && row < 1e9 && lane >= 0 && lane < vehicles_)) return std::nullopt;
    return Place{static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(lane)};
  }

 private:
  static constexpr geo::GeoPoint kCorner{40.0, -80.0};
  // About 12 m each: more than the radius within which two reports are of one hazard.
  static constexpr double kDegreesNorth = 12.0 / 111000.0;
  static constexpr double kDegreesEast = 12.0 / 85000.0;
  // Slow enough that a vehicle which changes from the last lane to the first stays below 100 m/s.
  static constexpr std::int64_t kStepNs = 5'000'000'000;

  std::uint32_t vehicles_;
  std::int64_t first_ns_;
};

}  // namespace livemap::bench
