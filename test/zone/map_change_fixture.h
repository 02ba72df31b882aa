#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "geo/wgs84.h"
#include "protocol/map_change_report.h"

namespace livemap::zone {

constexpr std::int64_t kChangeNowNs = 1'700'000'000'000'000'000;
constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr geo::GeoPoint kChangePlace{40.44, -79.94};

/// An acceptable word of a barrier that appeared, one metre of sigma, with a uuid of its own.
inline protocol::MapChangeReport MakeMapChange(const std::string& vehicle = "car-1",
                                               const std::string& drive = "drive-1") {
  static std::mt19937_64 generator(2);
  protocol::MapChangeReport report;
  report.uuid = Uuid::Random(generator);
  report.vehicle_id = vehicle;
  report.drive_id = drive;
  report.stamp_ns = kChangeNowNs - 100 * kSecondNs;
  report.earlier_stamp_ns = report.stamp_ns - 86400 * kSecondNs;
  report.class_name = "barrier";
  report.confidence = 0.5F;
  report.seen = 5;
  report.missed = 1;
  report.position = kChangePlace;
  report.covariance_m2 = Eigen::Matrix2d::Identity();
  return report;
}

/// The place so many metres to the east of kChangePlace.
inline geo::GeoPoint EastOf(double metres) {
  return geo::LocalFrame(kChangePlace).ToGeo(Eigen::Vector2d(metres, 0));
}

}  // namespace livemap::zone
