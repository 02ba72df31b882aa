#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "datasets/sensors/gnss_receiver_model.h"
#include "protocol/hazard_catalogue.h"
#include "tools/evaluation/alert_streets.h"
#include "tools/evaluation/alert_traffic.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::tools {

/// What the zone tells wrongly, or not at all, of the directions in which hazards are passed.
struct CourseErrors {
  double sigma_deg = 5;      ///< Of a course, standard deviation.
  double none_share = 0.15;  ///< Of the hazards: the zone knows no direction.
  /// Of those within kAtJunctionM of a junction: a vehicle of the crossing street has reported it.
  /// Of the others a tenth of this share, in any direction.
  double wrong_share = 0.2;
  /// Of those on streets that are driven in both directions: a vehicle on the oncoming lane has.
  double oncoming_share = 0.2;
};

constexpr double kAtJunctionM = 20;

/// How the zone knows how vehicles passed the hazards.
struct TrailErrors {
  double none_share = 0.15;     ///< Of the vehicles: the zone knows no trail.
  std::size_t trails = 2;       ///< Vehicles of one hazard, 0 to 3.
  double bias_m = 1.5;          ///< Of a trail as a whole, standard deviation per axis, m.
  double scatter_m = 0.4;       ///< Of each of its places, the same.
  double oncoming_share = 0.2;  ///< As CourseErrors::oncoming_share, of trails.
};

/// What the vehicle is given of the simulated world.
struct AlertTrial {
  /// Of the receiver: white and slow errors, losses of the fix.
  datasets::GnssReceiverNoise receiver{0.4, 1.5, 60, 0.1, 3};
  double fixes_per_s = 5;
  /// Of the velocity that the receiver measures beside each fix, per axis; 0: it measures none.
  double velocity_sigma_mps = 0.15;
  double latency_s = 0.1;    ///< From a fix's stamp until the vehicle has it.
  double place_sigma_m = 1;  ///< Of the hazards on the zone's map, per axis; the zone tells it.
  std::uint64_t seed = 1;
  bool streets = false;  ///< The vehicle has a map of the streets, with these errors.
  StreetMapErrors map_errors;
  CourseErrors course_errors;
  TrailErrors trail_errors;
};

/// docs/reference/measures.md defines the figures.
struct AlertFigures {
  std::size_t drives = 0;
  double hours = 0;
  std::size_t on_way = 0;  ///< Passes of hazards that lie on the vehicle's way.
  std::size_t early = 0;   ///< Of them, alerted kWantedLeadS before or earlier.
  std::size_t late = 0;    ///< Of them, alerted later.
  std::size_t alerts = 0;
  std::size_t false_alerts = 0;
  std::size_t beside = 0;  ///< Alerts of hazards on the next lane: neither right nor false.
  std::size_t doubles = 0;
  std::vector<double> leads_s;  ///< Of all passes that were alerted.

  void Add(const AlertFigures& other);
};

constexpr double kWantedLeadS = 4;

/// Plays a drive to DriverAlerts as its nodelet would have it, by fixes alone, and compares what
/// the driver is told with where the vehicle came.
AlertFigures TryAlerts(const TrafficDrive& drive, const AlertTrial& trial,
                       const vehicle::DriverAlerts::Config& config,
                       const protocol::HazardCatalogue& catalogue);

nlohmann::ordered_json ToJson(const AlertFigures& figures);
/// One line of the table; `name` is that of the scenario.
std::string ToRow(const std::string& name, const AlertFigures& figures);
/// The table's first line.
std::string HeadOfAlertTable();

}  // namespace livemap::tools
