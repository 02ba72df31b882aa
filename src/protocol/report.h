#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/wgs84.h"
#include "imaging/box.h"

namespace livemap::protocol {

/// Class names of detectors and of the zone may be this long.
constexpr std::size_t kMaxClassNameBytes = 64;

/// One hazard that one vehicle asks the zone to put on the map (HazardReport.msg without ROS).
/// Everything that handles reports is idempotent by `uuid`.
struct Report {
  Uuid uuid;               ///< Version 4, made by the vehicle.
  std::string vehicle_id;  ///< Empty on the vehicle; the zone's bridge writes the proven identity.
  std::string drive_id;
  std::int64_t stamp_ns = 0;  ///< Of the image, vehicle clock (UTC), ns since 1970.
  std::string class_name;
  float confidence = 0;    ///< 0..1.
  imaging::Box box;        ///< In the original image.
  geo::GeoPoint position;  ///< Of the hazard itself on the ground.
  /// Of the horizontal position, local east-north axes, m^2; symmetric, positive definite.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();
  std::uint32_t image_width = 0;  ///< Of the original image, pixels.
  std::uint32_t image_height = 0;
  std::string image_frame_id;       ///< Optical frame of the original image.
  std::string image_format;         ///< "jpeg", or empty when there is no picture.
  std::vector<std::uint8_t> image;  ///< Annotated picture as a compressed file; may be empty.
  imaging::PixelRegion shown;       ///< What of the original image the picture shows.
  std::string zone;                 ///< Id of the zone in which the hazard lies; empty at the zone.
};

/// The zone's answer to one report.
struct Receipt {
  enum class Status {
    kCommitted,  ///< Durably stored by the zone.
    kRefused,    ///< Will never be accepted; see `reason`.
  };
  Status status = Status::kRefused;
  Uuid report_uuid;
  Uuid hazard_uuid;        ///< The hazard it became or was merged into; nil when refused.
  std::string vehicle_id;  ///< Addressee.
  std::string reason;      ///< One sentence, empty when committed.
  std::string zone;        ///< Id of the zone that answers; empty at the zone.
};

}  // namespace livemap::protocol
