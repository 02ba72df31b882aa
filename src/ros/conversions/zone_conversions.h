#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/time.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "geo/wgs84.h"
#include "protocol/hazard_catalogue.h"
#include "zone/service/zone_service.h"

namespace livemap::ros_io {

/// Where each vehicle of the zone lately drove, for rviz; bounded.
class VehiclePaths {
 public:
  /// Remembers the position unless it lies within a metre of the vehicle's last one.
  void Add(const zone::VehicleState& vehicle);
  /// Forgets all but these vehicles.
  void KeepOnly(const std::vector<zone::VehicleState>& vehicles);
  const std::map<std::string, std::deque<geo::GeoPoint>>& paths() const { return paths_; }

 private:
  static constexpr std::size_t kMaxPoints = 2000;
  std::map<std::string, std::deque<geo::GeoPoint>> paths_;
};

/// The zone for rviz, in `map_frame` (x east, y north): the hazards as one list of spheres per
/// class in its colour, a label each while there are few, every vehicle as a red arrow along its
/// course with blue dots behind it. Replaces what was shown before.
visualization_msgs::MarkerArray ZoneMarkers(const std::vector<zone::Hazard>& hazards,
                                            const std::vector<zone::VehicleState>& vehicles,
                                            const VehiclePaths& paths,
                                            const protocol::HazardCatalogue& catalogue,
                                            const geo::LocalFrame& map,
                                            const std::string& map_frame, const ros::Time& stamp);

/// What the node itself counts; the rest is in ZoneStatistics.
struct ZoneCloudletCounters {
  std::uint64_t reports_received = 0;
  std::uint64_t reports_malformed = 0;   ///< Answered REFUSED: an unknown schema.
  std::uint64_t reports_not_queued = 0;  ///< The queue was full: their vehicles send them again.
  std::uint64_t positions_malformed = 0;
  std::uint64_t commits = 0;
  std::uint64_t store_errors = 0;  ///< Batches whose vehicles send them again.
  std::uint64_t notices_sent = 0;  ///< To everybody.
  std::uint64_t notice_pictures = 0;
  std::uint64_t notice_pictures_failed = 0;
  std::uint64_t cell_requests_refused = 0;  ///< More than the vehicle may ask, or too many wait.
  std::uint64_t cell_requests_malformed = 0;
  std::uint64_t cells_told = 0;  ///< To one vehicle each.
  std::uint64_t cell_hazards_told = 0;
  std::uint64_t vehicle_notices_sent = 0;  ///< To one vehicle each.
  std::uint64_t vehicles_joined = 0;       ///< Told all around them.
  std::uint64_t vehicles_behind = 0;       ///< Told what they missed.
  std::uint64_t answers_malformed = 0;
  std::uint64_t answers_dropped = 0;  ///< Too many at the same time.
  std::size_t reports_waiting = 0;
  std::uint64_t map_changes_received = 0;
  std::uint64_t map_changes_malformed = 0;   ///< Answered REFUSED: an unknown schema or direction.
  std::uint64_t map_changes_not_queued = 0;  ///< Too many waited: they are sent again.
  std::size_t map_changes_waiting = 0;
  std::size_t web_connections = 0;
  std::uint64_t web_connections_ended = 0;    ///< For others that needed their place.
  std::uint64_t web_connections_refused = 0;  ///< There was no place.
  std::uint64_t web_held_bytes = 0;           ///< Of the answers that are being written.
  std::uint64_t web_pictures_refused = 0;     ///< Not accepted when they were to be shown.
  std::string web_pictures_last_refusal;
  std::uint64_t web_pictures_busy = 0;      ///< Not made: too many waited.
  std::uint64_t web_failed_handshakes = 0;  ///< Connections that began TLS in vain.
  std::optional<double> web_certificate_s;  ///< Until it ends; none: plain HTTP is spoken.
  std::string web_certificate_refusal;      ///< Of the pair in the files; empty: it is served.
  /// Under which the zone writes, where a standby waits.
  struct Lease {
    bool is_held = false;
    std::string holder;
    std::uint64_t epoch = 0;
    double age_s = 0;  ///< Since it was renewed.
  };
  std::optional<Lease> lease;
  std::string store_error;  ///< Of the newest batch; empty when it went well.
};

/// Every counter under its own name; an error while the store fails.
void DescribeZone(const ZoneCloudletCounters& counters, const zone::ZoneStatistics& statistics,
                  diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace livemap::ros_io
