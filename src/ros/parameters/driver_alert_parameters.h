#pragma once

#include <string>

#include "ros/parameters/shared/parameter_reader.h"
#include "ros/parameters/shared/shared_parameters.h"
#include "vehicle/alerts/driver_alerts.h"
#include "vehicle/positioning/fix_track.h"

namespace livemap::ros_io {

/// Defaults of the driver_alert nodelet; the reader states their meanings.
struct DriverAlertConfig {
  std::string catalogue;  ///< Path of the hazard classes; empty: the package's.
  std::string database;   ///< Of hazard_reporting's local map; empty: notices alone count.
  double database_period_s = 10;
  ZoneParameters zones;  ///< By which is judged what a zone may announce.
  std::string streets;   ///< Extract of OpenStreetMap; empty: the course alone counts.
  vehicle::DriverAlerts::Config alerts;
  bool use_fused = false;
  double fused_wait_s = 1.0;
  vehicle::FixTrack::Config fixes;
  std::string base_frame = "base_link";
  std::string map_frame = "map";  ///< Of fused poses.
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error.
DriverAlertConfig ReadDriverAlertConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
