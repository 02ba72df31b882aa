#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "geo/wgs84.h"

namespace livemap::zone {

/// What one vehicle is to be told.
struct CatchUpOrder {
  std::string vehicle_id;
  geo::GeoPoint centre;  ///< What lies around it.
  /// What was announced since; 0: all that drivers are told of there now.
  std::uint64_t since = 0;
  /// What the vehicle says it knows. More than was ever announced: the zone began anew.
  std::uint64_t known = 0;
};

/// Decides which vehicles must be told something by themselves: by their positions and what they
/// say they know. Knows no store, no threads and no clock.
///
/// All that is there: to a vehicle that is new, was silent for long, knows nothing, knows of a zone
/// of before, or has driven half the radius away from where it was last told. What it missed: to
/// one that after `lag_s` still does not know what was announced then. What it missed is told
/// around where it was last told all, so that within half the radius around a vehicle its map is
/// right. Nothing: to a vehicle that asks about cells of the map itself.
class CatchUpPlanner {
 public:
  struct Config {
    double radius_m = 5000;
    double lag_s = 3;    ///< Announcements are on their way for this long.
    double retry_s = 5;  ///< After a telling; doubled each time until the vehicle knows more.
    double longest_retry_s = 60;
    double gap_s = 60;        ///< A vehicle silent for this long is new.
    double cell_wait_s = 0;   ///< A new vehicle has so long to ask about cells.
    double cell_gap_s = 300;  ///< One that has not asked about cells for this long no longer does.
    std::size_t max_vehicles = 10000;  ///< Beyond it the longest silent one is forgotten.
  };

  explicit CatchUpPlanner(const Config& config) : config_(config) {}

  /// A vehicle said where it is and up to where it knows the announcements, of which `announced` is
  /// the newest. What it is to be told now, if anything; then nothing more until Told.
  std::optional<CatchUpOrder> Update(const std::string& vehicle_id, const geo::GeoPoint& position,
                                     std::uint64_t map_sequence, std::uint64_t announced,
                                     std::int64_t now_ns);
  /// Whether the vehicle is to be invited to ask about cells of the map, if it can: it is new, and
  /// has not asked. True once.
  bool TakeInvitation(const std::string& vehicle_id);
  /// The vehicle has asked about cells of the map.
  void NoteCellRequest(const std::string& vehicle_id, std::int64_t now_ns);
  /// The order of this vehicle is done.
  void Told(const std::string& vehicle_id, std::int64_t now_ns);

  std::size_t vehicles() const { return vehicles_.size(); }

 private:
  struct Vehicle {
    std::int64_t heard_ns = 0;
    std::int64_t new_ns = 0;  // When it was new.
    std::optional<std::int64_t> asked_cells_ns;
    bool is_invited = false;
    std::optional<geo::GeoPoint> centre;  // Where it was last told all.
    std::uint64_t target = 0;             // What it should know by target_ns + lag.
    std::uint64_t known = 0;              // The most that it said it knows, of what was announced.
    std::int64_t target_ns = 0;
    std::int64_t not_before_ns = 0;
    double retry_s = 0;
    bool in_progress = false;
  };

  Vehicle& Heard(const std::string& vehicle_id, std::int64_t now_ns);

  Config config_;
  std::map<std::string, Vehicle> vehicles_;
};

}  // namespace livemap::zone
