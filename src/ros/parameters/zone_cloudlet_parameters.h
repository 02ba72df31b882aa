#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "ros/parameters/shared/parameter_reader.h"
#include "web/http/web_config.h"
#include "zone/inbox/catch_up_planner.h"
#include "zone/service/zone_service.h"

namespace livemap::ros_io {

/// Defaults of the zone_cloudlet node; the reader states their meanings.
struct ZoneCloudletConfig {
  std::string hazards;      ///< Path of the catalogue; empty: config/hazards.yaml.
  std::string streets;      ///< Extract of OpenStreetMap; empty: the zone knows no streets.
  std::string work_orders;  ///< File of recipients and rules; empty: the zone has no work orders.
  zone::ZoneService::Config zone;
  double lease_s = 0;  ///< Of the lease that the active process holds; 0: there is no standby.
  double lease_renew_s = 1;                ///< Between two renewals; at most half of lease_s.
  int batch_reports = 500;                 ///< Most reports of one commit.
  int queue_reports = 20000;               ///< Waiting for a commit; beyond it they are not taken.
  double queue_bytes = 256e6;              ///< The same in bytes of pictures.
  zone::CatchUpPlanner::Config catch_up;   ///< join_* and catch_up_* of the file.
  int join_max_hazards = 2000;             ///< What a vehicle is told at once: the nearest ones.
  int join_picture_bytes = 100000;         ///< Of all pictures of what a vehicle is told at once.
  bool notices_to_all = true;              ///< Tell announcements to every vehicle, too.
  int notice_picture_bytes = 4096;         ///< Of the picture in a notice of a new hazard; 0: none.
  double advance_period_s = 1.0;           ///< Between two looks at what time has changed.
  std::string map_frame = "map";           ///< Of hazard/markers: x east, y north.
  std::optional<geo::GeoPoint> map_datum;  ///< Its origin; none: the first hazard or vehicle.
  double marker_period_s = 0.5;            ///< Between two pictures of the map for rviz.
  int max_markers = 20000;                 ///< Hazards shown in rviz.
  double diagnostics_period_s = 1.0;
  bool json_log = false;  ///< The log is lines of JSON.
  bool web = true;        ///< Serve the live map.
  web::WebConfig web_options;

  /// The zones around this one, whose hazards near the border the live map shows
  /// (region::Neighbours).
  struct Neighbours {
    std::string zone;       ///< This zone's id in the directory.
    std::string directory;  ///< Signed file of all zones; empty: no other zone is followed.
    std::string authority;
    std::string ca_file;
    double margin_m = 500;
    double ask_every_s = 2;
  };
  Neighbours neighbours;
};

/// Reads and checks every private parameter; `package_path` completes the defaults that name files
/// of the package. Throws Error with one sentence.
ZoneCloudletConfig ReadZoneCloudletConfig(ParameterReader& parameters,
                                          const std::string& package_path);

}  // namespace livemap::ros_io
