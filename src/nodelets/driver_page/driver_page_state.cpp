#include "nodelets/driver_page/driver_page_state.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geo/sun.h"

namespace livemap::nodelets {
namespace {

constexpr std::size_t kHazardsShown = 3;
constexpr std::array<const char*, 5> kShownNodes = {
    "camera_ingest", "mqtt_bridge", "hazard_reporting", "driver_speech", "driver_alert"};

const char* SideName(vehicle::HazardAlert::Side side) {
  if (side == vehicle::HazardAlert::Side::kLeft) return "left";
  return side == vehicle::HazardAlert::Side::kRight ? "right" : "ahead";
}

const char* LevelName(int level) {
  if (level == diagnostic_msgs::DiagnosticStatus::OK) return "good";
  return level == diagnostic_msgs::DiagnosticStatus::WARN ? "warn" : "bad";
}

/// A value of a line as JSON: a number, a truth value or a text.
web::Json ValueOf(const std::string& text) {
  if (text == "True" || text == "true") return true;
  if (text == "False" || text == "false") return false;
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  const bool is_number = end != text.c_str() && *end == '\0' && std::isfinite(number);
  return is_number ? web::Json(web::Rounded(number, 2)) : web::Json(text);
}

}  // namespace

void DriverPageState::Take(const sensor_msgs::NavSatFix& fix, double now_s) {
  fix_ = fix;
  fix_heard_s_ = now_s;
  const geo::GeoPoint place{fix.latitude, fix.longitude};
  if (fix.status.status < sensor_msgs::NavSatStatus::STATUS_FIX || !geo::IsValid(place)) return;
  ahead_.Move(place, now_s);
  if (!fix.header.stamp.isZero()) {
    sun_deg_ = geo::SunElevationDeg(place, static_cast<std::int64_t>(fix.header.stamp.toNSec()));
  }
}

void DriverPageState::Take(const diagnostic_msgs::DiagnosticArray& diagnostics, double now_s) {
  for (const diagnostic_msgs::DiagnosticStatus& status : diagnostics.status) {
    const bool is_shown =
        std::find(kShownNodes.begin(), kShownNodes.end(), status.hardware_id) != kShownNodes.end();
    if (!is_shown) continue;
    Line line;
    line.level = static_cast<std::uint8_t>(status.level);
    line.heard_s = now_s;
    for (const diagnostic_msgs::KeyValue& pair : status.values) line.values[pair.key] = pair.value;
    lines_[status.hardware_id] = std::move(line);
  }
}

const DriverPageState::Line* DriverPageState::LineOf(const std::string& hardware_id,
                                                     double now_s) const {
  const auto found = lines_.find(hardware_id);
  if (found == lines_.end()) return nullptr;
  return now_s - found->second.heard_s > config_.stale_after_s ? nullptr : &found->second;
}

web::Json DriverPageState::Part(const std::string& hardware_id, const std::string& value,
                                double now_s) const {
  const Line* const line = LineOf(hardware_id, now_s);
  if (line == nullptr) return nullptr;
  const auto found = line->values.find(value);
  return {{"level", LevelName(line->level)},
          {value, found == line->values.end() ? web::Json(nullptr) : ValueOf(found->second)}};
}

web::Json DriverPageState::Receiver(double now_s) const {
  if (!fix_ || now_s - fix_heard_s_ > config_.stale_after_s) return nullptr;
  const bool has_fix = fix_->status.status >= sensor_msgs::NavSatStatus::STATUS_FIX;
  web::Json accuracy_m = nullptr;
  const double variance_m2 = std::max(fix_->position_covariance[0], fix_->position_covariance[4]);
  const bool is_known =
      fix_->position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  if (has_fix && is_known && variance_m2 > 0 && std::isfinite(variance_m2)) {
    accuracy_m = web::Rounded(std::sqrt(variance_m2), 1);
  }
  return {{"level", has_fix ? "good" : "bad"}, {"fix", has_fix}, {"accuracy_m", accuracy_m}};
}

web::Json DriverPageState::Hazards(double now_s, std::size_t& more) const {
  web::Json hazards = web::Json::array();
  const std::vector<vehicle::HazardAlert> ahead = ahead_.At(now_s);
  more = ahead.size() - std::min(ahead.size(), kHazardsShown);
  for (std::size_t i = 0; i < std::min(ahead.size(), kHazardsShown); ++i) {
    const vehicle::HazardAlert& alert = ahead[i];
    hazards.push_back({{"id", alert.id.ToString()},
                       {"class", alert.class_name},
                       {"urgency", alert.urgency},
                       {"side", SideName(alert.side)},
                       {"distance_m", web::Rounded(alert.distance_m, 1)}});
  }
  return hazards;
}

web::Json DriverPageState::Dark() const {
  if (config_.look == ros_io::PageLook::kDay) return false;
  if (config_.look == ros_io::PageLook::kNight) return true;
  return sun_deg_ ? web::Json(*sun_deg_ < config_.night_below_deg) : web::Json(nullptr);
}

web::Json DriverPageState::At(double now_s) const {
  std::size_t more = 0;
  web::Json state;
  state["hazards"] = Hazards(now_s, more);
  state["more"] = more;
  state["speed_mps"] =
      ahead_.speed_mps() ? web::Json(web::Rounded(*ahead_.speed_mps(), 1)) : web::Json(nullptr);
  state["dark"] = Dark();
  state["alerts"] = Part("driver_alert", "hazards", now_s);
  state["camera"] = Part("camera_ingest", "rate_hz", now_s);
  state["receiver"] = Receiver(now_s);
  state["zone"] = Part("mqtt_bridge", "connected", now_s);
  state["reports"] = Part("hazard_reporting", "pending", now_s);
  state["voice"] = Part("driver_speech", "voice", now_s);
  return state;
}

}  // namespace livemap::nodelets
