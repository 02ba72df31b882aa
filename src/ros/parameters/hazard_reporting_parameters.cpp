#include "ros/parameters/hazard_reporting_parameters.h"

#include <cstdlib>

#include "ros/parameters/datum_parameter.h"
#include "ros/parameters/vehicle_parameters.h"

namespace livemap::ros_io {
namespace {

/// Where ROS keeps a user's files.
std::string DefaultDatabase() {
  if (const char* ros_home = std::getenv("ROS_HOME")) {
    return std::string(ros_home) + "/livemap/local_hazards.sqlite3";
  }
  const char* home = std::getenv("HOME");
  return std::string(home != nullptr ? home : ".") + "/.ros/livemap/local_hazards.sqlite3";
}

void ReadUrgency(ParameterReader& parameters, vehicle::HazardReporter::Config& reporter) {
  // Below the 30 days after which the zone refuses a report, with some to spare for the way.
  constexpr double kLongestHoldS = 20 * 86400.0;
  parameters.Read("hold_urgent_s", reporter.hold_s[0], {0, kLongestHoldS});
  parameters.Read("hold_soon_s", reporter.hold_s[1], {0, kLongestHoldS});
  parameters.Read("hold_later_s", reporter.hold_s[2], {0, kLongestHoldS});
  std::string unknown = "cheap";
  parameters.ReadChoice("unknown_link", unknown, {"cheap", "metered"});
  reporter.unknown_link_is_cheap = unknown == "cheap";
  parameters.Read("link_wait_s", reporter.link_wait_s, {0, 600});
}

void ReadPositionSource(ParameterReader& parameters, HazardReportingConfig& config) {
  vehicle::HazardReporter::Config& reporter = config.reporter;
  std::string source = "gps";
  parameters.ReadChoice("position_source", source, {"gps", "fused"});
  if (source == "fused") reporter.position_source = vehicle::PositionSource::kFused;
  parameters.Read("fused_wait_s", reporter.fused_wait_s, {0, 60});
  parameters.Read("max_fused_gap_s", reporter.poses.max_gap_s, {0.01, 10});
  parameters.Read("use_depth", reporter.use_depth);
  parameters.Read("depth_wait_s", reporter.depth_wait_s, {0, 60});
  parameters.Read("depth_images", reporter.depth_images, {1, 10000});
  parameters.Read("depth_sigma_share", reporter.depth.sigma_share, {0, 1});
  parameters.Read("min_depth_m", reporter.depth.min_m, {0.01, 1000});
  parameters.Read("max_depth_m", reporter.depth.max_m, {0.01, 1000});
  parameters.Read("depth_units_per_m", config.depth_units_per_m, {1, 1e6});
}

/// After the reporter's own: what they share is read once.
void ReadPollAnswering(ParameterReader& parameters, HazardReportingConfig& config) {
  vehicle::PollResponder::Config& polls = config.polls;
  polls.drive_id = config.reporter.drive_id;
  polls.min_confidence = config.reporter.min_confidence;
  polls.bracket_wait_s = config.reporter.bracket_wait_s;
  polls.picture_wait_s = config.reporter.picture_wait_s;
  polls.crop = config.reporter.picture;
  polls.projection.pixel_sigma_px = config.reporter.projection.pixel_sigma_px;
  polls.projection.pitch_sigma_rad = config.reporter.projection.pitch_sigma_rad;
  polls.projection.height_sigma_m = config.reporter.projection.height_sigma_m;
  parameters.Read("max_polls", polls.max_open, {1, 1000});
  parameters.Read("poll_max_range_m", polls.max_range_m, {1, 200});
  parameters.Read("poll_margin_share", polls.margin_share, {0, 0.4});
  parameters.Read("poll_gate_sigma", polls.gate_sigma, {0.1, 20});
  parameters.Read("poll_no_views", polls.no_views, {1, 1000});
  parameters.Read("poll_view_spacing_m", polls.view_spacing_m, {0, 100});
  parameters.Read("poll_dark_luminance", polls.dark_luminance, {0, 255});
  parameters.Read("poll_miss_share", polls.miss_share, {0, 0.99});
  parameters.Read("poll_pose_wait_s", polls.pose_wait_s, {0, 60});
  parameters.Read("poll_reserve_s", polls.reserve_s, {0, 600});
  parameters.Read("poll_jpeg_quality", polls.jpeg_quality, {1, 100});
}

}  // namespace

HazardReportingConfig ReadHazardReportingConfig(ParameterReader& parameters, std::int64_t now_ns) {
  HazardReportingConfig config;
  vehicle::HazardReporter::Config& reporter = config.reporter;
  reporter.drive_id = ReadDriveId(parameters, now_ns);
  parameters.Read("catalogue", config.catalogue);
  parameters.Read("database", reporter.map.path);
  if (reporter.map.path.empty()) reporter.map.path = DefaultDatabase();
  parameters.Read("max_known", reporter.map.max_known, {1, 10e6});
  parameters.Read("max_pending", reporter.map.max_pending, {1, 1e6});
  parameters.Read("max_pending_bytes", reporter.map.max_pending_bytes, {1e5, 1e12});

  parameters.Read("min_confidence", reporter.min_confidence, {0, 1});
  parameters.Read("max_range_m", reporter.max_range_m, {0.1, 1000});
  parameters.Read("max_ground_sigma_m", reporter.max_ground_sigma_m, {0.01, 1000});
  parameters.Read("max_wait_s", reporter.max_wait_s, {0, 600});
  parameters.Read("bracket_wait_s", reporter.bracket_wait_s, {0, 60});
  parameters.Read("picture_wait_s", reporter.picture_wait_s, {0, 60});
  parameters.Read("max_waiting_frames", reporter.max_waiting_frames, {1, 10000});
  parameters.Read("antenna_x_m", reporter.antenna_x_m, {-50, 50});
  parameters.Read("antenna_y_m", reporter.antenna_y_m, {-50, 50});
  parameters.Read("use_events", config.use_events);
  reporter.pictures_on_demand = config.use_events;
  parameters.Read("pictures_on_demand", reporter.pictures_on_demand);
  parameters.Read("memory_s", reporter.track.keep_s, {5, 600});
  reporter.poses.keep_s = reporter.track.keep_s;
  parameters.Read("jpeg_quality", reporter.picture.quality, {1, 100});
  int max_image_bytes = static_cast<int>(reporter.picture.max_bytes);
  parameters.Read("max_image_bytes", max_image_bytes, {0, 10e6});
  reporter.picture.max_bytes = static_cast<std::size_t>(max_image_bytes);
  parameters.Read("picture_context", reporter.picture.context, {0, 100});
  parameters.Read("pixel_sigma_px", reporter.projection.pixel_sigma_px, {0, 100});
  parameters.Read("pitch_sigma_rad", reporter.projection.pitch_sigma_rad, {0, 0.5});
  parameters.Read("height_sigma_m", reporter.projection.height_sigma_m, {0, 2});
  ReadUrgency(parameters, reporter);
  ReadFixTrack(parameters, reporter.track);
  ReadPositionSource(parameters, config);
  ReadPollAnswering(parameters, config);
  parameters.Read("resend_first_s", reporter.resend.first_pause_s, {0.05, 600});
  parameters.Read("resend_longest_s", reporter.resend.longest_pause_s, {0.05, 3600});
  parameters.Read("resend_jitter", reporter.resend.jitter, {0, 0.9});

  parameters.Read("base_frame", config.base_frame);
  parameters.Read("map_frame", config.map_frame);
  config.map_datum = ReadDatum(parameters, "the first fix");
  parameters.Read("publish_tf", config.publish_tf);
  if (config.publish_tf && reporter.position_source == vehicle::PositionSource::kFused) {
    throw Error(
        "parameter 'publish_tf' is true, accepted is false with position_source fused, "
        "where tf leads from map_frame to base_frame already");
  }
  parameters.Read("position_period_s", config.position_period_s, {0.01, 3600});
  parameters.Read("path_spacing_m", config.path_spacing_m, {0.01, 1000});
  parameters.Read("path_max_poses", config.path_max_poses, {1, 1e6});
  parameters.Read("max_markers", config.max_markers, {0, 100000});
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  parameters.RejectUnknown({"diagnostic_period"});  // diagnostic_updater's own.
  return config;
}

}  // namespace livemap::ros_io
