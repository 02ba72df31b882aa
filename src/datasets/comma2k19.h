#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::datasets {

/// A satellite receiver's fix of a recorded drive.
struct RecordedFix {
  std::int64_t stamp_ns = 0;
  geo::GeoPoint position;
};

/// The vehicle's true pose.
struct RecordedPose {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d earth_m = Eigen::Vector3d::Zero();  ///< Earth-centred, earth-fixed.
  Eigen::Quaterniond earth_from_vehicle = Eigen::Quaterniond::Identity();  ///< x forward.
};

struct RecordedSpeed {
  std::int64_t stamp_ns = 0;
  double speed_mps = 0;  ///< Of the wheels.
};

/// A drive with fixes, wheel speed and truth, each in ascending time.
struct PositionDrive {
  std::vector<RecordedFix> fixes;
  std::vector<RecordedPose> poses;
  std::vector<RecordedSpeed> speeds;
};

/// The three tables of a comma2k19 segment: `gnss_ublox.csv` (t_s, lat_deg, lon_deg, ...),
/// `pose.csv` (t_s, ecef_x_m .. ecef_z_m, q_w .. q_z, ...) and `can_speed.csv` (t_s, speed_mps).
/// Throw Error naming the line and what is accepted; `name` is the file's in it.
std::vector<RecordedFix> ParseRecordedFixes(const std::string& text, const std::string& name);
std::vector<RecordedPose> ParseRecordedPoses(const std::string& text, const std::string& name);
std::vector<RecordedSpeed> ParseRecordedSpeeds(const std::string& text, const std::string& name);

/// Reads the folder that holds them; throws Error when a table is missing, wrong or without rows.
PositionDrive ReadComma2k19(const std::string& directory);

}  // namespace livemap::datasets
