#include "ros/parameters/vehicle_parameters.h"

#include <ctime>

namespace livemap::ros_io {
namespace {

/// "drive-20260131T235959Z".
std::string DriveName(std::int64_t now_ns) {
  const auto seconds = static_cast<std::time_t>(now_ns / 1'000'000'000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[40];
  std::strftime(text, sizeof(text), "drive-%Y%m%dT%H%M%SZ", &utc);
  return text;
}

}  // namespace

std::string ReadDriveId(ParameterReader& parameters, std::int64_t now_ns) {
  std::string drive_id;
  parameters.Read("drive_id", drive_id);
  if (drive_id.empty()) drive_id = DriveName(now_ns);
  if (drive_id.size() > 64) {
    throw Error("parameter 'drive_id' has " + std::to_string(drive_id.size()) +
                " bytes, accepted are at most 64");
  }
  return drive_id;
}

void ReadFixTrack(ParameterReader& parameters, vehicle::FixTrack::Config& track) {
  parameters.Read("max_extrapolation_s", track.max_extrapolation_s, {0, 10});
  parameters.Read("max_gap_s", track.max_gap_s, {0.01, 60});
  parameters.Read("min_baseline_m", track.min_baseline_m, {0.01, 100});
  parameters.Read("course_window_s", track.course_window_s, {0.1, 20});
  parameters.Read("course_noise_m", track.course_noise_m, {0.001, 100});
  parameters.Read("turn_rate_rps", track.turn_rate_rps, {0, 3});
  parameters.Read("max_course_sigma_rad", track.max_course_sigma_rad, {0.001, 3});
  parameters.Read("acceleration_mps2", track.acceleration_mps2, {0, 20});
  parameters.Read("default_sigma_m", track.default_sigma_m, {0.01, 100});
  parameters.Read("max_speed_mps", track.max_speed_mps, {1, 500});
}

void ReadBasePoseSource(ParameterReader& parameters, vehicle::VehiclePoseLookup::Config& pose) {
  std::string source = "gps";
  parameters.ReadChoice("position_source", source, {"gps", "fused"});
  pose.use_fused = source == "fused";
  parameters.Read("fused_wait_s", pose.fused_wait_s, {0, 60});
  parameters.Read("max_fused_gap_s", pose.poses.max_gap_s, {0.01, 10});
  parameters.Read("bracket_wait_s", pose.bracket_wait_s, {0, 60});
  parameters.Read("max_wait_s", pose.max_wait_s, {0, 600});
  parameters.Read("antenna_x_m", pose.antenna_x_m, {-50, 50});
  parameters.Read("antenna_y_m", pose.antenna_y_m, {-50, 50});
  ReadFixTrack(parameters, pose.fixes);
}

}  // namespace livemap::ros_io
