#include "ros/parameters/shared/shared_parameters.h"

#include <ctime>
#include <memory>

#include "directory/zone_lookup.h"
#include "transport/topic_template.h"

namespace livemap::ros_io {
namespace {

/// "drive-20260131T235959Z".
std::string DefaultDriveName(std::int64_t now_ns) {
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
  parameters.Read(
      "drive_id", drive_id,
      "Name of this drive, at most 64 bytes. It must differ from drive to drive. Empty: "
      "drive-<start time, UTC>. vehicle.launch sets it by the argument `drive`.");
  if (drive_id.empty()) drive_id = DefaultDriveName(now_ns);
  if (drive_id.size() > 64) {
    throw Error("parameter 'drive_id' has " + std::to_string(drive_id.size()) +
                " bytes, accepted are at most 64");
  }
  return drive_id;
}

void ReadZoneDirectory(ParameterReader& parameters, ZoneParameters& zones,
                       const std::string& meaning) {
  parameters.Read("zone_directory", zones.directory, meaning);
  parameters.Read("zone_authority", zones.authority,
                  "Certificate of the authority that signs the directory, a PEM file. The launch "
                  "files set it by the argument `zone_authority`.");
  if (zones.directory.empty()) return;
  if (zones.authority.empty()) {
    throw Error(
        "parameter 'zone_authority' is missing, which 'zone_directory' needs, accepted is "
        "a PEM file with one certificate");
  }
  if (zones.zone.empty()) {
    throw Error(
        "parameter 'zone' is missing, which 'zone_directory' needs, accepted is the id of "
        "a zone");
  }
}

void ReadZoneParameters(ParameterReader& parameters, ZoneParameters& zones) {
  parameters.Read("zone", zones.zone,
                  "Id of the configured zone, as in mqtt_bridge. All that names no zone belongs to "
                  "it. Empty: there is one zone only, whatever its id. vehicle.launch sets it by "
                  "the argument `zone`.");
  if (!zones.zone.empty() && !transport::IsValidId(zones.zone)) {
    throw Error("parameter 'zone' is '" + zones.zone +
                "', accepted are 1 to 64 characters of A-Z a-z 0-9 . _ -");
  }
  ReadZoneDirectory(
      parameters, zones,
      "File of the authority's signed zone directory (docs/reference/zone-directory.md). Empty: "
      "the vehicle stays with `zone`. vehicle.launch sets it by the argument `zone_directory`.");
}

vehicle::ZoneFinder MakeZoneFinder(const ZoneParameters& zones) {
  if (zones.directory.empty()) return {};
  directory::ZoneLookup::Config config;
  config.file = zones.directory;
  const auto lookup = std::make_shared<directory::ZoneLookup>(
      config, directory::TrustedAuthority::Read(zones.authority));
  return {[lookup](const geo::GeoPoint& place) { return lookup->IdAt(place); },
          [lookup](const std::string& zone) { return lookup->IsGone(zone); },
          [lookup, configured = zones.zone](const std::string& zone, const geo::GeoPoint& place) {
            return lookup->IsBeyond(zone.empty() ? configured : zone, place);
          }};
}

void ReadFixTrack(ParameterReader& parameters, vehicle::FixTrack::Config& track) {
  parameters.Read("max_extrapolation_s", track.max_extrapolation_s, {0, 10},
                  "The newest fix is stale when it is older than this.", "s");
  parameters.Read("max_gap_s", track.max_gap_s, {0.01, 60},
                  "Two fixes further apart than this are not interpolated.", "s");
  parameters.Read("min_baseline_m", track.min_baseline_m, {0.01, 100},
                  "Distance that the course needs.", "m");
  parameters.Read("course_window_s", track.course_window_s, {0.1, 20},
                  "Time before and after the image whose fixes tell the course.", "s");
  parameters.Read("course_noise_m", track.course_noise_m, {0.001, 100},
                  "Scatter of one fix against its neighbours, standard deviation.", "m");
  parameters.Read("turn_rate_rps", track.turn_rate_rps, {0, 3},
                  "Turn rate of a driving vehicle, standard deviation.", "rad/s");
  parameters.Read("max_course_sigma_rad", track.max_course_sigma_rad, {0.001, 3},
                  "A course less certain than this counts as unknown, standard deviation.", "rad");
  parameters.Read("acceleration_mps2", track.acceleration_mps2, {0, 20},
                  "Speeding up and braking, standard deviation.", "m/s^2");
  parameters.Read("default_sigma_m", track.default_sigma_m, {0.01, 100},
                  "Standard deviation of a fix whose receiver gives no covariance.", "m");
  parameters.Read("max_speed_mps", track.max_speed_mps, {1, 500},
                  "A fix that needs a higher speed than this is a jump and is not believed.",
                  "m/s");
}

void ReadBasePoseSource(ParameterReader& parameters, vehicle::VehiclePoseLookup::Config& pose) {
  parameters.Read("antenna_x_m", pose.antenna_x_m, {-50, 50},
                  "Receiver's antenna forward of base_frame.", "m");
  parameters.Read("antenna_y_m", pose.antenna_y_m, {-50, 50},
                  "Receiver's antenna left of base_frame.", "m");
  parameters.ReadChoice<bool>("position_source", pose.use_fused, {{"gps", false}, {"fused", true}},
                              "Whose positions and headings count: gps (the fixes alone) or fused "
                              "(localization/odometry, and the fixes where it is silent). "
                              "vehicle.launch sets it by the argument `position_source`.");
  parameters.Read(
      "fused_wait_s", pose.fused_wait_s, {0, 60},
      "Time to wait for the fused pose of an image. Then the fixes count, at once where no "
      "fused pose has come for two seconds.",
      "s");
  parameters.Read("max_fused_gap_s", pose.poses.max_gap_s, {0.01, 10},
                  "Two fused poses further apart than this are not interpolated.", "s");
  parameters.Read("bracket_wait_s", pose.bracket_wait_s, {0, 60},
                  "Time to wait for a fix after the image before the position is carried on.", "s");
  parameters.Read("max_wait_s", pose.max_wait_s, {0, 600},
                  "Longest time that an image waits for position, course and camera.", "s");
  ReadFixTrack(parameters, pose.fixes);
}

void ReadPrivacy(ParameterReader& parameters, bool& privacy, perception::PrivacyMask::Config& mask,
                 const std::string& meaning) {
  parameters.Read("privacy", privacy, meaning);
  using Source = perception::PrivateRegionSource;
  parameters.ReadChoice<Source>(
      "privacy_finder", mask.regions.source,
      {{"auto", Source::kAuto}, {"networks", Source::kNetworks}, {"cascades", Source::kCascades}},
      "What looks for faces and number plates: networks, cascades (OpenCV's), or auto: the "
      "networks "
      "where ./livemap privacy-models has placed them and no privacy_face_model is named, else the "
      "cascades. Networks of which a file is missing or damaged are refused, not replaced.");
  parameters.Read("privacy_networks", mask.regions.networks,
                  "Manifest of the networks; their files are looked for from its folder. Empty: "
                  "models/privacy.yaml of the package.");
  parameters.Read("privacy_cascades", mask.regions.cascades,
                  "Folder of OpenCV's Haar cascades (frontal and profile faces, number plates).");
  parameters.Read(
      "privacy_face_model", mask.regions.face_model,
      "A YuNet model (ONNX) that looks for the faces instead of the cascades. Empty: none.");
  parameters.Read(
      "privacy_min_side_px", mask.regions.min_side_px, {8, 1000},
      "Faces and plates whose shorter side is smaller than this are not looked for by the "
      "cascades. The networks know no such limit.",
      "px");
  parameters.Read("privacy_grow", mask.grow, {0, 5},
                  "A mask is larger than the face or plate by this share of its sides.");
  parameters.Read(
      "privacy_keep_frames", mask.keep_frames, {0, 1000},
      "Number of frames for which a face or plate that is not found any more stays masked.");
}

void ReadProjectionErrors(ParameterReader& parameters, geo::GroundProjectionNoise& noise) {
  parameters.Read("pixel_sigma_px", noise.pixel_sigma_px, {0, 100},
                  "Uncertainty of the lower edge of a box or region, standard deviation. It and "
                  "the next two say how far the projection to the road can be trusted.",
                  "px");
  parameters.Read(
      "pitch_sigma_rad", noise.pitch_sigma_rad, {0, 0.5},
      "Uncertainty of the camera's pitch (suspension and mounting), standard deviation.", "rad");
  parameters.Read("height_sigma_m", noise.height_sigma_m, {0, 2},
                  "Uncertainty of the camera's height above the road, standard deviation.", "m");
}

void ReadDepthUnits(ParameterReader& parameters, double& units_per_m) {
  parameters.Read("depth_units_per_m", units_per_m, {1, 1e6},
                  "Units per metre of 16-bit depth images (REP 118: 1000). Depth images of floats "
                  "are in metres.");
}

void ReadDiagnosticsPeriod(ParameterReader& parameters, double& period_s, double min_s) {
  parameters.Read("diagnostics_period_s", period_s, {min_s, 60},
                  "Time between two messages on /diagnostics, by the wall clock.", "s");
}

void ReadStampLimit(ParameterReader& parameters, double& max_ahead_s) {
  parameters.Read("max_stamp_ahead_s", max_ahead_s, {0.1, 1e9},
                  "A message whose stamp is further ahead of the clock than this is refused and "
                  "counted as stamps_refused. More than 10 s lets one wrong stamp silence tf.",
                  "s");
}

void ListImageTransport(ParameterReader& parameters, const std::string& more) {
  parameters.Foreign("image_transport", "raw",
                     "Transport of camera_rect/image by image_transport: raw unless set." + more);
}

}  // namespace livemap::ros_io
