#pragma once

#include <cstdint>
#include <string>

#include "geo/ground_projection.h"
#include "perception/privacy/privacy_mask.h"
#include "ros/parameters/shared/parameter_reader.h"
#include "vehicle/outbox/zone_finder.h"
#include "vehicle/positioning/fix_track.h"
#include "vehicle/positioning/vehicle_pose_lookup.h"

namespace livemap::ros_io {

// Parameters that several nodes have, under the same names.

/// `drive_id`; where none is given, one made of `now_ns` (UTC). Throws Error when it is too long.
std::string ReadDriveId(ParameterReader& parameters, std::int64_t now_ns);

/// The zones of a vehicle.
struct ZoneParameters {
  std::string zone;       ///< Id of the configured one; empty: there is one zone only.
  std::string directory;  ///< File of the signed zone directory; empty: none is used.
  std::string authority;  ///< File with the certificate of who signed it.
};

/// `zone_directory`, of which `meaning` says what it is for, and `zone_authority`, beside `zone`
/// that `zones` has already. Throws Error when one is missing that another one needs.
void ReadZoneDirectory(ParameterReader& parameters, ZoneParameters& zones,
                       const std::string& meaning);
/// The same with `zone`.
void ReadZoneParameters(ParameterReader& parameters, ZoneParameters& zones);

/// Asks the zone directory; empty where none is used. Throws Error when the authority's certificate
/// cannot be read.
vehicle::ZoneFinder MakeZoneFinder(const ZoneParameters& zones);

/// How position and course are made of the fixes.
void ReadFixTrack(ParameterReader& parameters, vehicle::FixTrack::Config& track);

/// Antenna, source of the positions (fixes or fused poses) and how long is waited for them.
void ReadBasePoseSource(ParameterReader& parameters, vehicle::VehiclePoseLookup::Config& pose);

/// `privacy` and what is masked; `meaning` says what the node does with pictures.
void ReadPrivacy(ParameterReader& parameters, bool& privacy, perception::PrivacyMask::Config& mask,
                 const std::string& meaning);

/// Errors of the projection from the image to the road.
void ReadProjectionErrors(ParameterReader& parameters, geo::GroundProjectionNoise& noise);

/// `depth_units_per_m` of 16-bit depth images.
void ReadDepthUnits(ParameterReader& parameters, double& units_per_m);

/// `diagnostics_period_s`, at least `min_s`.
void ReadDiagnosticsPeriod(ParameterReader& parameters, double& period_s, double min_s = 0.05);

/// `max_stamp_ahead_s` of all messages with a stamp.
void ReadStampLimit(ParameterReader& parameters, double& max_ahead_s);

/// Lists image_transport's own parameter of the topic camera_rect/image.
void ListImageTransport(ParameterReader& parameters, const std::string& more = "");

}  // namespace livemap::ros_io
