#include "ros/parameters/driver_page_parameters.h"

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {

DriverPageConfig ReadDriverPageConfig(ParameterReader& parameters) {
  DriverPageConfig config;
  parameters.Section("Where the page is");
  parameters.Read("page_bind", config.bind,
                  "Address to listen on. 127.0.0.1: this machine alone; 0.0.0.0: also a phone in "
                  "the vehicle's network, and whoever else is in it.");
  parameters.Read("page_port", config.port, {0, 65535}, "Port to listen on; 0: any that is free.");
  parameters.Read("web_root", config.web_root,
                  "Folder that holds driver/index.html. Empty: web of the package.");
  parameters.Section("What it shows");
  parameters.Read("catalogue", config.catalogue,
                  "Path of the hazard classes with their labels, icons and colours. Empty: "
                  "config/hazards.yaml of the package. vehicle.launch sets it by the argument "
                  "`hazards`.");
  parameters.ReadChoice<PageLook>(
      "look", config.look,
      {{"auto", PageLook::kAuto}, {"day", PageLook::kDay}, {"night", PageLook::kNight}},
      "day, night, or auto: by the sun at the vehicle's place, and as the browser prefers while no "
      "fix has come.");
  parameters.Read("night_below_deg", config.night_below_deg, {-18, 18},
                  "It is night when the sun stands lower than this above the horizon.", "degrees");
  parameters.Read("period_s", config.period_s, {0.1, 2}, "Time between two states of the page.",
                  "s");
  parameters.Read("stale_after_s", config.stale_after_s, {1, 60},
                  "A part of the vehicle that says nothing for this long counts as silent.", "s");
  parameters.Section("Period of the diagnostics");
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"diagnostic_period"});
  return config;
}

}  // namespace livemap::ros_io
