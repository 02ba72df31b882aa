#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <sensor_msgs/NavSatFix.h>

#include <map>
#include <optional>
#include <string>

#include "ros/parameters/driver_page_parameters.h"
#include "vehicle/display/alerts_ahead.h"
#include "web/json/json.h"

namespace livemap::nodelets {

/// What the in-car page shows, from what the other nodelets say. Times are steady, s. Not
/// thread-safe.
class DriverPageState {
 public:
  explicit DriverPageState(const ros_io::DriverPageConfig& config)
      : config_(config), ahead_(vehicle::AlertsAhead::Config()) {}

  void Take(const vehicle::HazardAlert& alert, double now_s) { ahead_.Take(alert, now_s); }
  void Take(const sensor_msgs::NavSatFix& fix, double now_s);
  void Take(const diagnostic_msgs::DiagnosticArray& diagnostics, double now_s);

  /// {"hazards": [the nearest three], "more", "speed_mps", "dark", "alerts", "camera", "receiver",
  /// "zone", "reports", "voice"}; what is not known is null.
  web::Json At(double now_s) const;

 private:
  /// The newest line of a node on /diagnostics.
  struct Line {
    int level = 0;
    std::map<std::string, std::string> values;
    double heard_s = 0;
  };

  const Line* LineOf(const std::string& hardware_id, double now_s) const;
  web::Json Part(const std::string& hardware_id, const std::string& value, double now_s) const;
  web::Json Receiver(double now_s) const;
  web::Json Hazards(double now_s, std::size_t& more) const;
  web::Json Dark() const;

  ros_io::DriverPageConfig config_;
  vehicle::AlertsAhead ahead_;
  std::map<std::string, Line> lines_;  ///< By hardware id, of those that are shown.
  std::optional<sensor_msgs::NavSatFix> fix_;
  double fix_heard_s_ = 0;
  std::optional<double> sun_deg_;  ///< Its elevation.
};

}  // namespace livemap::nodelets
