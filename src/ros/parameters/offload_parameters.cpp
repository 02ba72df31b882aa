#include "ros/parameters/offload_parameters.h"

#include "ros/parameters/vehicle_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadSender(ParameterReader& parameters, vehicle::OffloadSender::Config& sender) {
  parameters.Read("rate_hz", sender.rate_hz, {0.1, 60});
  parameters.Read("min_spacing_m", sender.min_spacing_m, {0, 1000});
  parameters.Read("max_bytes_per_s", sender.max_bytes_per_s, {1000, 10e6});
  parameters.Read("burst_s", sender.burst_s, {1, 600});
  parameters.Read("max_image_bytes", sender.max_image_bytes, {1000, 1e6});
  parameters.Read("min_image_bytes", sender.min_image_bytes, {1, 1e6});
  parameters.Read("max_waiting_frames", sender.max_waiting_frames, {1, 1000});
  ReadBasePoseSource(parameters, sender.pose);
}

}  // namespace

EarlyDiscardConfig ReadEarlyDiscardConfig(ParameterReader& parameters, std::int64_t now_ns) {
  EarlyDiscardConfig config;
  parameters.Read("model", config.model);
  if (config.model.empty()) {
    throw Error("parameter 'model' is empty, accepted is the path of a model manifest");
  }
  parameters.Read("threshold", config.threshold, {-1, 1});
  parameters.Read("threads", config.threads, {0, 256});
  parameters.Read("queue_size", config.queue_size, {1, 1000});
  config.sender.drive_id = ReadDriveId(parameters, now_ns);
  ReadSender(parameters, config.sender);
  parameters.Read("jpeg_quality", config.jpeg_quality, {1, 100});
  parameters.Read("privacy", config.privacy);
  parameters.Read("privacy_cascades", config.mask.regions.cascades);
  parameters.Read("privacy_face_model", config.mask.regions.face_model);
  parameters.Read("privacy_min_side_px", config.mask.regions.min_side_px, {8, 1000});
  parameters.Read("privacy_grow", config.mask.grow, {0, 5});
  parameters.Read("privacy_keep_frames", config.mask.keep_frames, {0, 1000});
  parameters.Read("base_frame", config.base_frame);
  parameters.Read("map_frame", config.map_frame);
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  parameters.RejectUnknown({"image_transport", "diagnostic_period"});
  return config;
}

OffloadIntakeConfig ReadCandidateIntakeConfig(ParameterReader& parameters) {
  OffloadIntakeConfig config;
  zone::OffloadIntake::Config& intake = config.intake;
  zone::ReportLimits& limits = intake.limits.report;
  int max_frame_bytes = 200000;
  int max_frame_side_px = 4096;
  parameters.Read("max_frame_bytes", max_frame_bytes, {1000, 1e6});
  parameters.Read("max_frame_side_px", max_frame_side_px, {16, 16384});
  limits.max_image_bytes = static_cast<std::size_t>(max_frame_bytes);
  limits.max_image_side_px = static_cast<std::uint32_t>(max_frame_side_px);
  double max_pixels = 4e6;
  parameters.Read("max_frame_pixels", max_pixels, {256, 20e6});
  limits.max_image_pixels = static_cast<std::int64_t>(max_pixels);
  parameters.Read("max_future_s", limits.max_future_s, {0, 86400});
  limits.max_age_s = 3e9;  // The zone's own limit for reports decides, and whether it replays.
  parameters.Read("max_age_s", limits.max_age_s, {1, 1e10});
  parameters.Read("max_position_sigma_m", limits.max_position_sigma_m, {0.01, 1000});
  parameters.Read("frames_per_minute", intake.allowance.frames_per_minute, {1, 6000});
  parameters.Read("bytes_per_minute", intake.allowance.bytes_per_minute, {1000, 1e9});
  parameters.Read("max_waiting", intake.max_waiting, {1, 100000});
  parameters.Read("max_waiting_bytes", intake.max_waiting_bytes, {1000, 1e10});
  parameters.Read("max_in_flight", intake.max_in_flight, {1, 1000});
  parameters.Read("detection_timeout_s", intake.detection_timeout_s, {0.1, 3600});
  parameters.Read("min_confidence", intake.min_confidence, {0, 1});
  parameters.Read("max_range_m", intake.max_range_m, {0.1, 1000});
  parameters.Read("max_ground_sigma_m", intake.max_ground_sigma_m, {0.01, 1000});
  parameters.Read("pixel_sigma_px", intake.projection.pixel_sigma_px, {0, 100});
  parameters.Read("pitch_sigma_rad", intake.projection.pitch_sigma_rad, {0, 0.5});
  parameters.Read("height_sigma_m", intake.projection.height_sigma_m, {0, 2});
  parameters.Read("jpeg_quality", config.jpeg_quality, {1, 100});
  parameters.Read("max_image_bytes", config.max_image_bytes, {0, 1e6});
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  parameters.RejectUnknown({"image_transport", "diagnostic_period"});
  return config;
}

}  // namespace livemap::ros_io
