#pragma once

#include <string>

#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// How the in-car page looks.
enum class PageLook { kAuto, kDay, kNight };

/// Defaults of the driver_page nodelet; the reader states their meanings.
struct DriverPageConfig {
  std::string catalogue;  ///< Path of the hazard classes; empty: the package's.
  std::string bind = "127.0.0.1";
  int port = 8090;
  std::string web_root;  ///< Folder of the page; empty: the package's.
  PageLook look = PageLook::kAuto;
  double night_below_deg = -1;  ///< Elevation of the sun.
  double period_s = 0.5;        ///< Of the state.
  double stale_after_s = 5;     ///< What was heard before is not known any more.
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error.
DriverPageConfig ReadDriverPageConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
