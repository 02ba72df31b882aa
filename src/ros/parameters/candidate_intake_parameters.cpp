#include "ros/parameters/candidate_intake_parameters.h"

#include <cstdint>

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadIntakeFrameLimits(ParameterReader& parameters, zone::ReportLimits& limits) {
  parameters.Section("Limits of a frame", "A frame beyond them is refused and counted.");
  // Defaults of frames; those of a report's picture are others.
  limits.max_image_bytes = 200000;
  limits.max_image_side_px = 4096;
  double max_pixels = 4e6;
  limits.max_age_s = 3e9;  // The zone's own limit for reports decides, and whether it replays.
  parameters.Read("max_frame_bytes", limits.max_image_bytes, {1000, 1e6}, "Largest picture.",
                  "bytes");
  parameters.Read("max_frame_side_px", limits.max_image_side_px, {16, 16384},
                  "Longer side of the picture.", "px");
  parameters.Read("max_frame_pixels", max_pixels, {256, 20e6}, "Largest picture.", "px");
  limits.max_image_pixels = static_cast<std::int64_t>(max_pixels);
  parameters.Read("max_future_s", limits.max_future_s, {0, 86400},
                  "How far a stamp may lie ahead of the zone's clock.", "s");
  parameters.Read("max_age_s", limits.max_age_s, {1, 1e10},
                  "How far a stamp may lie behind the zone's clock. About the reports made of a "
                  "frame, zone_cloudlet's own max_age_s and replay decide.",
                  "s");
  parameters.Read("max_position_sigma_m", limits.max_position_sigma_m, {0.01, 1000},
                  "Largest standard deviation of the vehicle's own position.", "m");
}

void ReadIntakeVehicleLimits(ParameterReader& parameters, zone::OffloadIntake::Config& intake) {
  parameters.Section("Limits of a vehicle");
  parameters.Read("frames_per_minute", intake.allowance.frames_per_minute, {1, 6000},
                  "Frames of one vehicle per minute. The default is a third more than the 3 per "
                  "second that a vehicle sends at most.");
  parameters.Read("bytes_per_minute", intake.allowance.bytes_per_minute, {1000, 1e9},
                  "Bytes of pictures of one vehicle per minute. The default is 0.8 Mbit/s.",
                  "bytes");
  parameters.Section("On the way to the detector");
  parameters.Read(
      "max_waiting", intake.max_waiting, {1, 100000},
      "Number of frames that wait for the detector. Beyond it the oldest goes, counted.");
  parameters.Read("max_waiting_bytes", intake.max_waiting_bytes, {1000, 1e10},
                  "The same in bytes of their pictures.", "bytes");
  parameters.Read("max_in_flight", intake.max_in_flight, {1, 1000},
                  "Number of frames at the detector at once. Keep it at or below the detector's "
                  "engines plus its queue_size: then the detector never drops a frame.");
  parameters.Read("detection_timeout_s", intake.detection_timeout_s, {0.1, 3600},
                  "Time after which a frame without an answer is given up.", "s");
}

void ReadIntakeReports(ParameterReader& parameters, CandidateIntakeConfig& config) {
  zone::OffloadIntake::Config& intake = config.intake;
  parameters.Section("What is reported", "As hazard_reporting of a vehicle with a detector.");
  parameters.Read("catalogue", config.catalogue,
                  "Path of the catalogue of hazard classes, which says how deep things are. Empty: "
                  "config/hazards.yaml of the package. zone.launch sets it by the argument "
                  "`hazards`.");
  parameters.Read("min_confidence", intake.min_confidence, {0, 1},
                  "Least confidence of a detection that is reported. The detector's own threshold "
                  "stands before it.");
  parameters.Read("max_range_m", intake.max_range_m, {0.1, 1000},
                  "Largest distance from base_link. Hazards further away are not reported.", "m");
  parameters.Read("max_ground_sigma_m", intake.max_ground_sigma_m, {0.01, 1000},
                  "Largest standard deviation of the place on the road as seen from the vehicle.",
                  "m");
  ReadProjectionErrors(parameters, intake.projection);
  parameters.Read("jpeg_quality", config.jpeg_quality, {1, 100},
                  "JPEG quality of the report's picture.");
  parameters.Read("max_image_bytes", config.max_image_bytes, {0, 1e6},
                  "Largest picture of a report.", "bytes");
}

}  // namespace

CandidateIntakeConfig ReadCandidateIntakeConfig(ParameterReader& parameters) {
  CandidateIntakeConfig config;
  ReadIntakeFrameLimits(parameters, config.intake.limits.report);
  ReadIntakeVehicleLimits(parameters, config.intake);
  ReadIntakeReports(parameters, config);
  parameters.Section("Period of the diagnostics");
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"image_transport", "diagnostic_period"});
  return config;
}

}  // namespace livemap::ros_io
