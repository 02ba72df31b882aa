#include "ros/conversions/zone_conversions.h"

#include <cmath>
#include <set>

#include "ros/views/class_colour.h"

namespace livemap::ros_io {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

// Larger than life: a zone is looked at from far above.
constexpr double kHazardDiameterM = 3.0;
constexpr double kLabelHeightM = 2.5;
constexpr std::size_t kMaxLabels = 500;
constexpr double kVehicleLengthM = 8.0;
constexpr double kVehicleWidthM = 3.5;
constexpr double kTrailDotM = 1.2;
constexpr double kTrailSpacingM = 1.0;

std_msgs::ColorRGBA ZoneMarkerColour(float red, float green, float blue) {
  std_msgs::ColorRGBA colour;
  colour.r = red;
  colour.g = green;
  colour.b = blue;
  colour.a = 1.0F;
  return colour;
}

geometry_msgs::Point ZoneMarkerPoint(const Eigen::Vector2d& east_north_m, double z_m) {
  geometry_msgs::Point point;
  point.x = east_north_m.x();
  point.y = east_north_m.y();
  point.z = z_m;
  return point;
}

Marker BeginZoneMarker(const Marker& base, const std::string& name_space, int id, int type,
                       double size_m) {
  Marker marker = base;
  marker.ns = name_space;
  marker.id = id;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.scale.x = marker.scale.y = marker.scale.z = size_m;
  return marker;
}

void AppendZoneHazards(const std::vector<zone::Hazard>& hazards,
                       const protocol::HazardCatalogue& catalogue, const geo::LocalFrame& map,
                       const Marker& base, MarkerArray& array) {
  std::map<std::string, Marker> spheres;
  std::vector<Marker> labels;
  for (const zone::Hazard& hazard : hazards) {
    const auto known = spheres.find(hazard.class_name);
    Marker& list = known != spheres.end() ? known->second : spheres[hazard.class_name];
    const protocol::HazardClass entry = catalogue.Get(hazard.class_name);
    if (known == spheres.end()) {
      list = BeginZoneMarker(base, "hazards", static_cast<int>(spheres.size()), Marker::SPHERE_LIST,
                             kHazardDiameterM);
      list.color = ClassColour(entry, 1.0F);
    }
    const Eigen::Vector2d place_m = map.ToEnu(hazard.position);
    list.points.push_back(ZoneMarkerPoint(place_m, kHazardDiameterM / 2));
    if (hazards.size() > kMaxLabels) continue;
    labels.push_back(BeginZoneMarker(base, "labels", static_cast<int>(labels.size()),
                                     Marker::TEXT_VIEW_FACING, kLabelHeightM));
    // North of the sphere: seen from above, height would leave the label on top of it.
    const Eigen::Vector2d beside_m(0, kHazardDiameterM);
    labels.back().pose.position = ZoneMarkerPoint(place_m + beside_m, kHazardDiameterM);
    labels.back().color = ZoneMarkerColour(1.0F, 1.0F, 1.0F);
    labels.back().text = entry.label;
  }
  for (const auto& list : spheres) array.markers.push_back(list.second);
  array.markers.insert(array.markers.end(), labels.begin(), labels.end());
}

void AppendZoneVehicle(const zone::VehicleState& vehicle, const std::deque<geo::GeoPoint>& path,
                       int id, const geo::LocalFrame& map, const Marker& base, MarkerArray& array) {
  Marker body = BeginZoneMarker(base, "vehicles", id, Marker::ARROW, kVehicleWidthM);
  body.pose.position = ZoneMarkerPoint(map.ToEnu(vehicle.position), kVehicleWidthM / 2);
  if (std::isfinite(vehicle.course_rad)) {
    body.scale.x = kVehicleLengthM;
    const double yaw_rad = M_PI / 2 - vehicle.course_rad;  // Counterclockwise from east.
    body.pose.orientation.z = std::sin(yaw_rad / 2);
    body.pose.orientation.w = std::cos(yaw_rad / 2);
  } else {
    body.type = Marker::CUBE;
  }
  body.color = ZoneMarkerColour(0.9F, 0.1F, 0.1F);
  array.markers.push_back(body);
  if (path.empty()) return;
  Marker trail = BeginZoneMarker(base, "trails", id, Marker::SPHERE_LIST, kTrailDotM);
  trail.color = ZoneMarkerColour(0.15F, 0.4F, 1.0F);
  for (const geo::GeoPoint& point : path)
    trail.points.push_back(ZoneMarkerPoint(map.ToEnu(point), 0.0));
  array.markers.push_back(trail);
}

void DescribeZoneMapChanges(const ZoneCloudletCounters& counters,
                            const zone::MapChangeStatistics& changes,
                            diagnostic_updater::DiagnosticStatusWrapper& status) {
  for (std::size_t i = 0; i < zone::kMapChangeStates; ++i) {
    status.add(std::string("map_changes_") +
                   zone::MapChangeStateName(static_cast<zone::MapChangeState>(i)),
               changes.by_state[i]);
  }
  status.add("map_changes_received", counters.map_changes_received);
  status.add("map_changes_accepted", changes.added);
  status.add("map_changes_merged", changes.merged);
  status.add("map_changes_denied", changes.denied);
  status.add("map_changes_known", changes.known);
  status.add("map_changes_repeated", changes.repeated);
  status.add("map_changes_refused", changes.refused);
  status.add("map_changes_too_fast", changes.too_fast);
  status.add("map_changes_not_now", changes.not_now);
  status.add("map_changes_malformed", counters.map_changes_malformed);
  status.add("map_changes_not_queued", counters.map_changes_not_queued);
  status.add("map_changes_waiting", counters.map_changes_waiting);
}

}  // namespace

void VehiclePaths::Add(const zone::VehicleState& vehicle) {
  std::deque<geo::GeoPoint>& path = paths_[vehicle.vehicle_id];
  if (!path.empty() && geo::GeodesicDistanceM(path.back(), vehicle.position) < kTrailSpacingM)
    return;
  path.push_back(vehicle.position);
  if (path.size() > kMaxPoints) path.pop_front();
}

void VehiclePaths::KeepOnly(const std::vector<zone::VehicleState>& vehicles) {
  std::set<std::string> kept;
  for (const zone::VehicleState& vehicle : vehicles) kept.insert(vehicle.vehicle_id);
  for (auto path = paths_.begin(); path != paths_.end();) {
    path = kept.count(path->first) != 0 ? std::next(path) : paths_.erase(path);
  }
}

MarkerArray ZoneMarkers(const std::vector<zone::Hazard>& hazards,
                        const std::vector<zone::VehicleState>& vehicles, const VehiclePaths& paths,
                        const protocol::HazardCatalogue& catalogue, const geo::LocalFrame& map,
                        const std::string& map_frame, const ros::Time& stamp) {
  Marker base;
  base.header.frame_id = map_frame;
  base.header.stamp = stamp;
  base.pose.orientation.w = 1.0;
  base.action = Marker::DELETEALL;
  MarkerArray array;
  array.markers.push_back(base);
  AppendZoneHazards(hazards, catalogue, map, base, array);
  int id = 0;
  for (const zone::VehicleState& vehicle : vehicles) {
    const auto path = paths.paths().find(vehicle.vehicle_id);
    AppendZoneVehicle(vehicle,
                      path == paths.paths().end() ? std::deque<geo::GeoPoint>{} : path->second,
                      id++, map, base, array);
  }
  return array;
}

void DescribeZone(const ZoneCloudletCounters& counters, const zone::ZoneStatistics& statistics,
                  diagnostic_updater::DiagnosticStatusWrapper& status) {
  using diagnostic_msgs::DiagnosticStatus;
  if (!counters.store_error.empty()) {
    status.summary(DiagnosticStatus::ERROR, counters.store_error);
  } else if (counters.lease && !counters.lease->is_held) {
    status.summary(DiagnosticStatus::ERROR, "the zone's lease was not renewed in time");
  } else if (statistics.store_damage.rows > 0) {
    status.summary(DiagnosticStatus::WARN, "the store holds rows of impossible values");
  } else if (statistics.active_hazards == 0) {
    status.summary(DiagnosticStatus::OK, "no hazard yet");
  } else {
    status.summary(DiagnosticStatus::OK, "serving");
  }
  status.add("hazards_on_map", statistics.active_hazards);
  for (std::size_t i = 0; i < zone::kHazardStates; ++i) {
    status.add(std::string("hazards_") + zone::HazardStateName(static_cast<zone::HazardState>(i)),
               statistics.hazards_by_state[i]);
  }
  status.add("store_rows_broken", statistics.store_damage.rows);
  status.add("vehicles_suspect", statistics.suspect_vehicles);
  status.add("reports_received", counters.reports_received);
  status.add("reports_accepted", statistics.added);
  status.add("reports_merged", statistics.merged);
  status.add("reports_repeated", statistics.repeated);
  status.add("reports_refused", statistics.refused);
  for (std::size_t i = 0; i < zone::kRefusalKinds; ++i) {
    status.add(std::string("refused_") + zone::RefusalName(static_cast<zone::RefusalKind>(i)),
               statistics.refused_by_kind[i]);
  }
  status.add("reports_not_now", statistics.not_now);
  status.add("reports_malformed", counters.reports_malformed);
  status.add("reports_not_queued", counters.reports_not_queued);
  status.add("reports_waiting", counters.reports_waiting);
  status.add("commits", counters.commits);
  status.add("store_errors", counters.store_errors);
  status.add("notices_sent", counters.notices_sent);
  status.add("notice_pictures", counters.notice_pictures);
  status.add("notice_pictures_failed", counters.notice_pictures_failed);
  status.add("vehicle_notices_sent", counters.vehicle_notices_sent);
  status.add("polls", statistics.polls);
  status.add("answers", statistics.answers);
  status.add("answers_refused",
             statistics.answers_refused + counters.answers_malformed + counters.answers_dropped);
  status.add("vehicle_positions", statistics.vehicle_positions);
  status.add("vehicle_positions_refused",
             statistics.vehicle_positions_refused + counters.positions_malformed);
  for (std::size_t i = 0; i < zone::kRefusalKinds; ++i) {
    status.add(
        std::string("positions_refused_") + zone::RefusalName(static_cast<zone::RefusalKind>(i)),
        statistics.positions_refused_by_kind[i]);
  }
  status.add("reports_of_unknown_class", statistics.of_unknown_class);
  status.add("vehicles_joined", counters.vehicles_joined);
  status.add("vehicles_behind", counters.vehicles_behind);
  status.add("cells_told", counters.cells_told);
  status.add("cell_hazards_told", counters.cell_hazards_told);
  status.add("cell_requests_refused", counters.cell_requests_refused);
  status.add("cell_requests_malformed", counters.cell_requests_malformed);
  status.add("image_bytes", statistics.image_bytes);
  for (std::size_t i = 0; i < zone::kPictureRefusals; ++i) {
    status.add(std::string("pictures_refused_") +
                   zone::PictureRefusalName(static_cast<zone::PictureRefusal>(i)),
               statistics.pictures_refused[i]);
  }
  status.add("web_connections", counters.web_connections);
  status.add("web_connections_ended", counters.web_connections_ended);
  status.add("web_connections_refused", counters.web_connections_refused);
  status.add("web_held_bytes", counters.web_held_bytes);
  if (counters.web_certificate_s) {
    status.add("web_certificate_days", *counters.web_certificate_s / 86400);
    status.add("web_certificate_refusal", counters.web_certificate_refusal);
    status.add("web_failed_handshakes", counters.web_failed_handshakes);
  }
  status.add("web_pictures_refused", counters.web_pictures_refused);
  status.add("web_pictures_last_refusal", counters.web_pictures_last_refusal);
  status.add("web_pictures_busy", counters.web_pictures_busy);
  DescribeZoneMapChanges(counters, statistics.map_changes, status);
  if (!counters.lease) return;
  status.add("zone_active", counters.lease->is_held);
  status.add("lease_holder", counters.lease->holder);
  status.add("lease_epoch", counters.lease->epoch);
  status.add("lease_age_s", counters.lease->age_s);
}

}  // namespace livemap::ros_io
