#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "common/uuid.h"
#include "geo/wgs84.h"

namespace livemap::protocol {

/// One object that one vehicle found changed since an earlier drive: msg/MapChange.msg.
struct MapChangeReport {
  Uuid uuid;
  std::string vehicle_id;  ///< Empty on the vehicle; the zone's bridge writes it.
  std::string drive_id;
  std::int64_t stamp_ns = 0;          ///< UTC; of the last image that shows it.
  std::int64_t earlier_stamp_ns = 0;  ///< Of the picture it was compared with.
  std::string class_name;             ///< As ChangeClassName has it.
  bool vanished = false;              ///< Else it appeared.
  float confidence = 0;               ///< 0..1.
  std::uint32_t seen = 0;             ///< Images that show it,
  std::uint32_t missed = 0;           ///< and that should, but do not.
  geo::GeoPoint position;             ///< Of its foot on the road.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< East-north axes.
  std::string zone;  ///< Id of the zone in which the object lies; empty at the zone.
};

}  // namespace livemap::protocol
