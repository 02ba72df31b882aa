#include "ros/parameters/hazard_reporting_parameters.h"

#include <cstdlib>

#include "ros/parameters/shared/datum_parameter.h"
#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

/// Where ROS keeps a user's files.
std::string DefaultReportingDatabase() {
  if (const char* ros_home = std::getenv("ROS_HOME")) {
    return std::string(ros_home) + "/livemap/local_hazards.sqlite3";
  }
  const char* home = std::getenv("HOME");
  return std::string(home != nullptr ? home : ".") + "/.ros/livemap/local_hazards.sqlite3";
}

void ReadReportingMap(ParameterReader& parameters, HazardReportingConfig& config,
                      std::int64_t now_ns) {
  vehicle::HazardReporter::Config& reporter = config.reporter;
  reporter.drive_id = ReadDriveId(parameters, now_ns);
  parameters.Read("catalogue", config.catalogue,
                  "Path of the catalogue of hazard classes. Empty: config/hazards.yaml of the "
                  "package. vehicle.launch sets it by the argument `hazards`.");
  parameters.Section("Local hazard map and outbox");
  parameters.Read(
      "database", reporter.map.path,
      "Path of the SQLite database, one file per vehicle: two vehicles on one machine need two "
      "files. Empty: $ROS_HOME/livemap/local_hazards.sqlite3, where ROS_HOME is ~/.ros unless set. "
      "vehicle.launch sets it to `directory`/local_hazards.sqlite3.");
  if (reporter.map.path.empty()) reporter.map.path = DefaultReportingDatabase();
  parameters.Read("max_known", reporter.map.max_known, {1, 10e6},
                  "Number of hazards that are remembered. Beyond it the hazards longest without "
                  "news are forgotten.");
  parameters.Read("max_pending", reporter.map.max_pending, {1, 1e6},
                  "Number of unfinished reports. Beyond it new hazards are refused and counted.");
  parameters.Read("max_pending_bytes", reporter.map.max_pending_bytes, {1e5, 1e12},
                  "Size of unfinished reports: pictures, and 1 kB each. Beyond it new hazards are "
                  "refused and counted.",
                  "bytes");
  parameters.Section("Zones",
                     "A report goes to the zone in which its hazard lies "
                     "(docs/explanation/changing-zones.md).");
  ReadZoneParameters(parameters, config.zones);
  // Without a directory there is one zone, whatever it is called.
  if (!config.zones.directory.empty()) reporter.map.zone = config.zones.zone;
}

void ReadReportingSightings(ParameterReader& parameters, HazardReportingConfig& config) {
  vehicle::HazardReporter::Config& reporter = config.reporter;
  parameters.Section("Sightings");
  parameters.Read(
      "use_events", config.use_events,
      "Source of the sightings. true: the objects of hazard/events, each once, at its best view "
      "(`tracking` of hazard_detection). false: every detection of hazard/detections that is no "
      "duplicate. vehicle.launch sets it by its argument `tracking`.");
  parameters.Removed("pictures_on_demand",
                     "hazard_reporting makes every picture itself, of the images of "
                     "camera_rect/image");
  parameters.Read(
      "memory_s", reporter.track.keep_s, {5, 600},
      "Time that fixes and fused poses are kept. An event may be this old when it comes.", "s");
  reporter.poses.keep_s = reporter.track.keep_s;
  parameters.Read(
      "min_confidence", reporter.min_confidence, {0, 1},
      "Least confidence of a sighting. The detector's own threshold applies before it.");
  parameters.Read("max_range_m", reporter.max_range_m, {0.1, 1000},
                  "Sightings further from base_link than this wait for a nearer view.", "m");
  parameters.Read(
      "max_ground_sigma_m", reporter.max_ground_sigma_m, {0.01, 1000},
      "Sightings whose place on the road is less certain than this wait for a nearer view "
      "(standard deviation of the worst axis). The distance that this means depends on the camera: "
      "it is 14 m at 1.45 m height and f = 493 px, and it grows with the square root of the "
      "height. A smaller value gives fewer false hazards, but the vehicle may pass a hazard that "
      "comes near just after a restart before the course is known.",
      "m");
  parameters.Read(
      "settle_wait_s", reporter.settle_wait_s, {0, 60},
      "Longest time that a report waits for further sights of its hazard, which make its place "
      "surer. Urgent classes (rank 1) do not wait, nor do events. 0: none waits.",
      "s");
  parameters.Read(
      "settle_sigma_m", reporter.settle_sigma_m, {0, 1000},
      "A report waits no longer than until its place is this certain, seen from the vehicle "
      "(standard deviation of the worst axis).",
      "m");
  parameters.Read("max_wait_s", reporter.max_wait_s, {0, 600},
                  "Longest time that a frame waits for fix, course and camera.", "s");
  parameters.Read("bracket_wait_s", reporter.bracket_wait_s, {0, 60},
                  "Time to wait for a fix after the image before the position is carried on.", "s");
  parameters.Read(
      "max_waiting_frames", reporter.max_waiting_frames, {1, 10000},
      "Number of frames with sightings that may wait. Beyond it the oldest frame is dropped.");
}

void ReadReportingPicture(ParameterReader& parameters, HazardReportingConfig& config) {
  vehicle::HazardReporter::Config& reporter = config.reporter;
  parameters.Section("Picture of a report");
  parameters.Read("picture_frames", config.picture_frames, {1, 1000},
                  "Number of images of camera_rect/image that are kept until it is known whether a "
                  "picture of them is wanted. As many more are kept where the tracker names them "
                  "as best views. They are pointers, but they hold the images' memory.");
  ListImageTransport(parameters, " Inside the manager raw images move by pointer.");
  parameters.Read(
      "picture_wait_s", config.pictures.max_wait_s, {0, 60},
      "Longest time that a report waits for its picture to be masked and encoded. Then the report "
      "goes without a picture.",
      "s");
  parameters.Read("jpeg_quality", reporter.picture.quality, {1, 100},
                  "JPEG quality of the report's picture.");
  parameters.Read(
      "max_image_bytes", reporter.picture.max_bytes, {0, 10e6},
      "Size of the picture. Quality, then pixels, then surroundings are lowered to meet it.",
      "bytes");
  parameters.Read("picture_context", reporter.picture.context, {0, 100},
                  "The picture shows this many times the box's sides, at least 480 x 320 pixels. "
                  "0: the whole image.");
  parameters.Read(
      "draw_boxes", config.draw_boxes,
      "Draw into each picture the box of the hazard that it is about, and faintly those "
      "of what else was found. false: they are plain, as "
      "training wants those of ./livemap zone export-labels; officials then see the "
      "hazard without its box.");
  parameters.Section("Faces and number plates");
  ReadPrivacy(parameters, config.privacy, config.mask,
              "Mask faces and number plates in every picture of a report and of an answer. With "
              "early_discard's frames these are all pictures that leave the vehicle. A picture "
              "that cannot be masked does not leave it. Set it to false only where the law and the "
              "people in the pictures allow it.");
}

void ReadReportingUrgency(ParameterReader& parameters, vehicle::HazardReporter::Config& reporter) {
  // Below the 30 days after which the zone refuses a report, with some to spare for the way.
  constexpr double kLongestHoldS = 20 * 86400.0;
  parameters.Section("When a report is sent",
                     "A class's rank (urgency in config/hazards.yaml) says how long its reports "
                     "may wait for a cheap link; link_state says what the link is. The longest "
                     "hold is 20 days: the zone refuses reports older than 30 days.");
  parameters.Read(
      "hold_urgent_s", reporter.hold_s[0], {0, kLongestHoldS},
      "Time that a report of rank 1 may wait for a cheap link. 0: it goes at once on any link.",
      "s");
  parameters.Read("hold_soon_s", reporter.hold_s[1], {0, kLongestHoldS},
                  "Time that a report of rank 2 may wait for a cheap link.", "s");
  parameters.Read("hold_later_s", reporter.hold_s[2], {0, kLongestHoldS},
                  "Time that a report of rank 3 may wait for a cheap link.", "s");
  parameters.ReadChoice<bool>("unknown_link", reporter.unknown_link_is_cheap,
                              {{"cheap", true}, {"metered", false}},
                              "State of the link while nobody publishes link_state.");
  parameters.Read("link_wait_s", reporter.link_wait_s, {0, 600},
                  "Time after a start with held reports in which the first link_state may come.",
                  "s");
  parameters.Read(
      "resend_first_s", reporter.resend.first_pause_s, {0.05, 600},
      "First pause before a report is sent again, by the steady clock: a paused bag does not stop "
      "it. The pause doubles each time. The first answer after a silence starts anew.",
      "s");
  parameters.Read("resend_longest_s", reporter.resend.longest_pause_s, {0.05, 3600},
                  "Longest pause before a report is sent again.", "s");
  parameters.Read("resend_jitter", reporter.resend.jitter, {0, 0.9}, "Pauses vary by this share.");
}

void ReadReportingVehicle(ParameterReader& parameters, HazardReportingConfig& config) {
  vehicle::HazardReporter::Config& reporter = config.reporter;
  parameters.Section("The vehicle and the projection to the road",
                     "The camera's mounting comes from tf (base_frame to the frame_id of the "
                     "images), its focal length from camera_rect/camera_info.");
  parameters.Read("base_frame", config.base_frame, "Frame at road level: x forward, y left, z up.");
  parameters.Read("antenna_x_m", reporter.antenna_x_m, {-50, 50},
                  "Receiver's antenna forward of base_frame.", "m");
  parameters.Read("antenna_y_m", reporter.antenna_y_m, {-50, 50},
                  "Receiver's antenna left of base_frame.", "m");
  ReadProjectionErrors(parameters, reporter.projection);
}

void ReadReportingPosition(ParameterReader& parameters, HazardReportingConfig& config) {
  vehicle::HazardReporter::Config& reporter = config.reporter;
  parameters.Section("Fused positions and depth");
  parameters.ReadChoice<vehicle::PositionSource>(
      "position_source", reporter.position_source,
      {{"gps", vehicle::PositionSource::kFixes}, {"fused", vehicle::PositionSource::kFused}},
      "Whose positions and headings count: gps (the fixes alone) or fused (localization/odometry "
      "of the nodelet geo_localization, and the fixes where it is silent). vehicle.launch sets it "
      "by the argument `position_source`.");
  parameters.Read(
      "fused_wait_s", reporter.fused_wait_s, {0, 60},
      "Time to wait for the fused pose of an image. Then the fixes count, at once where no "
      "fused pose has come for two seconds.",
      "s");
  parameters.Read("max_fused_gap_s", reporter.poses.max_gap_s, {0.01, 10},
                  "Two fused poses further apart than this are not interpolated.", "s");
  parameters.Read("use_depth", reporter.use_depth,
                  "Take a hazard's distance from camera/depth/image_raw at the foot of its box. "
                  "The road's plane counts where the depth is unknown. vehicle.launch sets it by "
                  "the argument `use_depth`.");
  parameters.Read("depth_wait_s", reporter.depth_wait_s, {0, 60},
                  "Time to wait for the depth image of an image. Then the plane counts.", "s");
  parameters.Read("depth_images", reporter.depth_images, {1, 10000},
                  "Number of depth images that are kept. An event may be this many images old; "
                  "then the plane counts.");
  parameters.Read(
      "depth_sigma_share", reporter.depth.sigma_share, {0, 1},
      "Error that all pixels of a depth image share, standard deviation, share of the depth.");
  parameters.Read("min_depth_m", reporter.depth.min_m, {0.01, 1000}, "Depth below this is unknown.",
                  "m");
  parameters.Read("max_depth_m", reporter.depth.max_m, {0.01, 1000}, "Depth above this is unknown.",
                  "m");
  ReadDepthUnits(parameters, config.depth_units_per_m);
}

/// After the reporter's own: what they share is read once.
void ReadReportingPolls(ParameterReader& parameters, HazardReportingConfig& config) {
  vehicle::PollResponder::Config& polls = config.polls;
  polls.drive_id = config.reporter.drive_id;
  polls.min_confidence = config.reporter.min_confidence;
  polls.bracket_wait_s = config.reporter.bracket_wait_s;
  polls.crop = config.reporter.picture;
  polls.picture_wait_s = config.pictures.max_wait_s;
  polls.projection.pixel_sigma_px = config.reporter.projection.pixel_sigma_px;
  polls.projection.pitch_sigma_rad = config.reporter.projection.pitch_sigma_rad;
  polls.projection.height_sigma_m = config.reporter.projection.height_sigma_m;
  parameters.Section("Answers to the zone's polls",
                     "A poll asks whether a hazard is still there. "
                     "docs/explanation/poll-answers.md explains the answers.");
  parameters.Read("max_polls", polls.max_open, {1, 1000},
                  "Number of polls open at the same time. Further polls are not taken.");
  parameters.Read("poll_max_range_m", polls.max_range_m, {1, 200},
                  "Views from further away than this make no \"no\": the detector may overlook the "
                  "hazard there.",
                  "m");
  parameters.Read(
      "poll_margin_share", polls.margin_share, {0, 0.4},
      "Margin of the image, share of its sides. A place in the margin does not count as seen.");
  parameters.Read("poll_gate_sigma", polls.gate_sigma, {0.1, 20},
                  "Largest distance between a detection and the place.", "standard deviations");
  parameters.Read("poll_no_views", polls.no_views, {1, 1000},
                  "Number of clear views without a match that make a \"no\".");
  parameters.Read("poll_view_spacing_m", polls.view_spacing_m, {0, 100},
                  "Distance driven between two views that count.", "m");
  parameters.Read("poll_dark_luminance", polls.dark_luminance, {0, 255},
                  "Images darker than this do not count, mean grey level.", "grey levels");
  parameters.Read("poll_miss_share", polls.miss_share, {0, 0.99},
                  "Share of clear views in which the detector misses a hazard. It gives the "
                  "confidence of a \"no\". The default is a guess until it is measured.");
  parameters.Read("poll_pose_wait_s", polls.pose_wait_s, {0, 60},
                  "Longest time that an image waits for the vehicle's position and for its "
                  "camera's calibration and mounting.",
                  "s");
  parameters.Read("poll_reserve_s", polls.reserve_s, {0, 600},
                  "Time before a poll expires at which its answer leaves at the latest.", "s");
  parameters.Read("poll_jpeg_quality", polls.jpeg_quality, {1, 100},
                  "JPEG quality of an answer's picture.");
  parameters.Read("poll_frame_bytes", polls.max_frame_bytes, {0, 1e6},
                  "Size of an answer's picture where the zone asks for the whole frame. The zone's "
                  "own bound counts where that is smaller. 0: whole frames are not sent.",
                  "bytes");
}

void ReadReportingViews(ParameterReader& parameters, HazardReportingConfig& config) {
  parameters.Section("Cells of the map",
                     "The vehicle hears of hazards in the cells of the map around it, and asks the "
                     "zone what it lacks of them (docs/explanation/delivery.md).");
  parameters.Read("cell_radius_m", config.reporter.cells.radius_m, {0, 10000},
                  "The vehicle hears of the cells that come as near as this, at most the nearest "
                  "48. 0: of none; then the zone tells it everything around it.",
                  "m");
  parameters.Read("cell_refresh_s", config.reporter.cells.refresh_s, {5, 120},
                  "Time after which the vehicle asks again about each cell: the newest "
                  "announcement may have been lost without a trace. A zone answers about 256 cells "
                  "at once and about two a second in the long run.",
                  "s");
  parameters.Section("Published views");
  parameters.Read("position_period_s", config.position_period_s, {0.01, 3600},
                  "Time between two messages on vehicle/position.", "s");
  parameters.Read("map_frame", config.map_frame,
                  "Frame of hazard/local_map and path: x east, y north.");
  config.map_datum =
      ReadDatum(parameters, "the first fix with which the next agrees",
                "Origin of map_frame, LATITUDE,LONGITUDE in degrees. Empty: the first fix with "
                "which the next agrees. With fused positions tf earth -> map_frame gives the "
                "origin.");
  parameters.Read("publish_tf", config.publish_tf,
                  "Publish tf map_frame -> base_frame, where no odometry does it. vehicle.launch "
                  "sets it by the argument `publish_tf`.");
  if (config.publish_tf && config.reporter.position_source == vehicle::PositionSource::kFused) {
    throw Error(
        "parameter 'publish_tf' is true, accepted is false with position_source fused, "
        "where tf leads from map_frame to base_frame already");
  }
  parameters.Read("path_spacing_m", config.path_spacing_m, {0.01, 1000},
                  "Distance between two poses of path.", "m");
  parameters.Read("path_max_poses", config.path_max_poses, {1, 1e6},
                  "Number of poses of path. Beyond it the oldest poses are forgotten.");
  parameters.Read("max_markers", config.max_markers, {0, 100000},
                  "Number of hazards shown on hazard/local_map: those with the newest news.");
  ReadStampLimit(parameters, config.reporter.track.stamps.max_ahead_s);
  config.reporter.poses.stamps = config.reporter.track.stamps;
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
}

}  // namespace

HazardReportingConfig ReadHazardReportingConfig(ParameterReader& parameters, std::int64_t now_ns) {
  HazardReportingConfig config;
  vehicle::HazardReporter::Config& reporter = config.reporter;
  ReadReportingMap(parameters, config, now_ns);
  ReadReportingSightings(parameters, config);
  ReadReportingPicture(parameters, config);
  ReadReportingUrgency(parameters, reporter);
  ReadReportingVehicle(parameters, config);
  ReadReportingPosition(parameters, config);
  parameters.Section("Position and course from the fixes");
  ReadFixTrack(parameters, reporter.track);
  ReadReportingPolls(parameters, config);
  ReadReportingViews(parameters, config);
  // An event is the one sight of its object: no further one comes.
  if (config.use_events) reporter.settle_wait_s = 0;
  parameters.RejectUnknown({"diagnostic_period"});  // diagnostic_updater's own.
  return config;
}

}  // namespace livemap::ros_io
