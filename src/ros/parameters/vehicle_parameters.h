#pragma once

#include <cstdint>
#include <string>

#include "ros/parameters/parameters.h"
#include "vehicle/positioning/fix_track.h"
#include "vehicle/positioning/vehicle_pose_lookup.h"

namespace livemap::ros_io {

// Parameters that several of the vehicle's nodelets have, under the same names.

/// `drive_id`; where none is given, one made of `now_ns` (UTC). Throws Error when it is too long.
std::string ReadDriveId(ParameterReader& parameters, std::int64_t now_ns);

/// How position and course are made of the fixes.
void ReadFixTrack(ParameterReader& parameters, vehicle::FixTrack::Config& track);

/// Whose word counts for where the vehicle is: that, the fused poses, and how long is waited.
void ReadBasePoseSource(ParameterReader& parameters, vehicle::VehiclePoseLookup::Config& pose);

}  // namespace livemap::ros_io
