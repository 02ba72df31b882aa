#pragma once

#include <optional>
#include <string>

#include "geo/wgs84.h"
#include "perception/privacy/privacy_mask.h"
#include "ros/parameters/shared/parameter_reader.h"
#include "ros/parameters/shared/shared_parameters.h"
#include "vehicle/pictures/picture_worker.h"
#include "vehicle/polls/poll_responder.h"
#include "vehicle/reporting/hazard_reporter.h"

namespace livemap::ros_io {

/// Defaults of the hazard_reporting nodelet; the reader states their meanings.
struct HazardReportingConfig {
  vehicle::HazardReporter::Config reporter;
  ZoneParameters zones;
  vehicle::PollResponder::Config polls;
  vehicle::PictureWorker::Config pictures;
  int picture_frames = 64;  ///< Images that may be wanted.
  bool draw_boxes = true;   ///< Into the pictures, before they are cut out.
  bool privacy = true;      ///< Mask faces and number plates in all pictures.
  perception::PrivacyMask::Config mask;
  std::string catalogue;   ///< Path of hazards.yaml; empty: the package's own.
  bool use_events = true;  ///< Sightings of hazard/events; false: of hazard/detections.
  std::string base_frame = "base_link";
  std::string map_frame = "map";
  std::optional<geo::GeoPoint> map_datum;  ///< Of the map frame; nothing: the first fix.
  bool publish_tf = false;                 ///< map_frame -> base_frame, where no odometry does it.
  double position_period_s = 1.0;          ///< Stamp to stamp.
  double path_spacing_m = 1.0;
  int path_max_poses = 5000;
  int max_markers = 1000;
  double depth_units_per_m = 1000;  ///< Of 16-bit depth (REP 118).
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error. `now_ns` names the drive when no parameter does.
HazardReportingConfig ReadHazardReportingConfig(ParameterReader& parameters, std::int64_t now_ns);

}  // namespace livemap::ros_io
