#include "ros/parameters/driver_alert_parameters.h"

#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

void ReadAlertSources(ParameterReader& parameters, DriverAlertConfig& config) {
  parameters.Section("What the vehicle knows of hazards");
  parameters.Read(
      "catalogue", config.catalogue,
      "Path of the hazard classes with their urgency. Empty: config/hazards.yaml of the "
      "package. vehicle.launch sets it by the argument `hazards`.");
  parameters.Read("database", config.database,
                  "Path of hazard_reporting's local hazard map, which is read for what was "
                  "announced before the start or missed. Empty: the notices alone count. "
                  "vehicle.launch sets it by the argument `directory`.");
  parameters.Read("database_period_s", config.database_period_s, {0.1, 3600},
                  "Time between two readings of it.", "s");
  ReadZoneParameters(parameters, config.zones);
  parameters.Read("max_hazards", config.alerts.max_hazards, {1, 1e7},
                  "Number of hazards kept in memory. Beyond it new ones are refused and counted.");
  parameters.Read("place_sigma_m", config.alerts.default_sigma_m, {0.01, 100},
                  "Standard deviation per axis of a hazard's place where no notice tells it.", "m");
}

void ReadAlertTimes(ParameterReader& parameters, vehicle::DriverAlerts::Config& alerts) {
  parameters.Section("When the driver is told");
  parameters.Read("min_lead_s", alerts.min_lead_s, {0.5, 60},
                  "An alert comes at least this long before the hazard is reached.", "s");
  parameters.Read("reaction_s", alerts.reaction_s, {0, 10}, "Time that the driver needs to react.",
                  "s");
  parameters.Read("braking_mps2", alerts.braking_mps2, {0.5, 10},
                  "Comfortable braking. The time to react and the time over the way to stop count "
                  "where they are longer than min_lead_s.",
                  "m/s^2");
  parameters.Read("urgent_extra_s", alerts.urgent_extra_s, {0, 30},
                  "Further time for classes of urgency 1.", "s");
  parameters.Read("alert_above", alerts.alert_above, {0.01, 0.99},
                  "Least probability that a hazard lies on the vehicle's way.");
  parameters.Read("sure_time_s", alerts.sure_time_s, {0.01, 10},
                  "Time constant of the running mean of that probability, which must be above it, "
                  "too.",
                  "s");
  parameters.Read("cancel_below", alerts.cancel_below, {0, 0.99},
                  "An alert is cancelled where the probability is below this.");
  parameters.Read("cancel_after_s", alerts.cancel_after_s, {0, 60}, "Time for which it must be so.",
                  "s");
  parameters.Read("min_speed_mps", alerts.min_speed_mps, {0.1, 20},
                  "A slower vehicle is told nothing new.", "m/s");
  parameters.Read("side_from_m", alerts.side_from_m, {0, 100},
                  "A hazard further to the side of the way is said to lie left or right.", "m");
  parameters.Read("forget_beyond_m", alerts.forget_beyond_m, {10, 1000},
                  "A hazard that is passed or cancelled may be told again when the vehicle has "
                  "been further away than this.",
                  "m");
}

void ReadAlertWay(ParameterReader& parameters, vehicle::DriverAlerts::Config& alerts) {
  parameters.Section("The way that the vehicle is expected to drive",
                     "docs/explanation/driver-alerts.md has the model.");
  parameters.Read("fix_noise_m", alerts.course.fix_noise_m, {0.01, 100},
                  "Scatter of a fix against its neighbours, standard deviation per axis.", "m");
  parameters.Read(
      "velocity_noise_mps", alerts.course.velocity_noise_mps, {0.01, 100},
      "Scatter of the receiver's velocity, standard deviation per axis. 30 % of what the "
      "receiver states counts where that is more.",
      "m/s");
  parameters.Read("sideways_mps2", alerts.course.sideways_mps2, {0.05, 10},
                  "Sideways acceleration in bends, standard deviation.", "m/s^2");
  parameters.Read("steady_mps2", alerts.course.steady_mps2, {0.001, 10},
                  "The same on a steady road.", "m/s^2");
  parameters.Read("steady_s", alerts.course.steady_s, {0.5, 600},
                  "Mean time for which a road stays steady.", "s");
  parameters.Read("bending_s", alerts.course.bending_s, {0.5, 600},
                  "Mean time for which it stays bending.", "s");
  parameters.Read("bend_spacing_m", alerts.way.bend_spacing_m, {10, 10000},
                  "Mean way between two bends.", "m");
  parameters.Read("others_per_m", alerts.way.others_per_m, {1e-4, 1},
                  "Hazards of other roads per hazard of the own road and metre to its side. The "
                  "greater, the fewer false alerts, and the later those in bends.",
                  "1/m");
}

void ReadAlertStreets(ParameterReader& parameters, DriverAlertConfig& config) {
  parameters.Section("The streets that the vehicle knows",
                     "docs/explanation/driver-alerts.md has the model.");
  parameters.Read("streets", config.streets,
                  "Path of an extract of OpenStreetMap with the area's streets (.osm.pbf or .osm), "
                  "which is read once, at the start. Empty: the way is predicted by the course "
                  "alone. vehicle.launch sets it by the argument `streets`.");
  vehicle::DriverAlerts::Config& alerts = config.alerts;
  parameters.Read("street_sigma_m", alerts.streets.map_sigma_m, {0.05, 50},
                  "Standard deviation of the map's streets to their side.", "m");
  parameters.Read("sure_above", alerts.sure_above, {0, 1},
                  "Where the vehicle takes the way to a hazard, by the junctions before it, with a "
                  "probability of less than this, the driver is told later.");
  parameters.Read("unsure_lead_s", alerts.unsure_lead_s, {0.5, 60},
                  "Namely this long before the hazard is reached.", "s");
  parameters.Read("unsure_above", alerts.unsure_above, {0.01, 0.99},
                  "Least probability, in place of alert_above, that it lies on the way then.");
}

}  // namespace

DriverAlertConfig ReadDriverAlertConfig(ParameterReader& parameters) {
  DriverAlertConfig config;
  ReadAlertSources(parameters, config);
  ReadAlertTimes(parameters, config.alerts);
  ReadAlertWay(parameters, config.alerts);
  ReadAlertStreets(parameters, config);
  parameters.Section("Position of the vehicle");
  parameters.Read("base_frame", config.base_frame, "Frame at road level: x forward, y left, z up.");
  parameters.Read("map_frame", config.map_frame, "Frame of the fused poses.");
  parameters.ReadChoice<bool>("position_source", config.use_fused,
                              {{"gps", false}, {"fused", true}},
                              "Whose positions count: gps (the fixes alone) or fused "
                              "(localization/odometry, and the fixes where it is silent). "
                              "vehicle.launch sets it by the argument `position_source`.");
  parameters.Read("fused_wait_s", config.fused_wait_s, {0, 60},
                  "The fixes count when no fused pose has come for this long.", "s");
  ReadFixTrack(parameters, config.fixes);
  parameters.Section("Period of the diagnostics");
  ReadStampLimit(parameters, config.fixes.stamps.max_ahead_s);
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"diagnostic_period"});
  return config;
}

}  // namespace livemap::ros_io
