#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <queue>
#include <string>
#include <unordered_map>
#include <vector>

#include "geo/spatial_grid.h"
#include "zone/hazard_life.h"
#include "zone/vehicle_track.h"

namespace livemap {

/// Which vehicle to ask about which hazard.
struct PollChoice {
  std::uint64_t hazard = 0;  ///< The caller's id.
  std::string vehicle_id;
  bool picture_wanted = false;
  std::int64_t expires_ns = 0;  ///< Zone clock; then the poll is closed by itself.
};

/// Decides who is asked what and when. Knows no store, no threads and no clock; nothing of it needs
/// to be stored: after a restart SetHazard and SetVehicle build it again.
///
/// When. A told hazard that is gone costs drivers one wrong minute per minute; a poll costs bytes.
/// Asked every T seconds, a hazard that ends at the rate r stands wrongly on the map for T/2
/// seconds r times a second, so its cost rate is r T/2 + price/T, least at T = sqrt(2 price / r).
/// At that T the wrong time expected since the last word, the integral of 1 - p, has just grown to
/// r T^2/2 = `price`. So the rule is: ask when that integral reaches the price of a poll, in
/// seconds of wrong map. It holds for any p: short lives are asked often, long ones rarely (the
/// rate grows with the root of the death rate, the optimum for a given number of polls; compare Cho
/// and Garcia-Molina, "Effective page refresh policies for web crawlers", ACM TODS 28, 2003), and a
/// hazard that somebody denied at once. A yes settles the debt; a no or a silence does not, so the
/// next vehicle is asked. A candidate's debt is the integral of p: true ones should be told soon;
/// there a no settles it. Sightings settle like answers: what was just seen is not asked about.
///
/// Who. Vehicles whose course leads past the place within `lookahead_s`, each about one hazard at
/// most once in `same_vehicle_gap_s` and never while a poll to it is open; vehicles that spoke of
/// the hazard within that gap are not asked either.
///
/// Bytes. A bucket that fills with `bytes_per_hour` and holds one hour's; as it empties the price
/// rises, price / fill^2, so that what is worth most is asked still.
///
/// Cost. Hazards wait in a heap for the time they are due, and due ones in a grid for a vehicle to
/// come by: a tick looks at what fell due and at what lies around vehicles that moved, never at
/// all.
class PollScheduler {
 public:
  struct Config {
    double price_s = 120;          ///< Of a poll, in seconds of wrong map; > 0.
    double bytes_per_hour = 10e6;  ///< Of polls, answers and pictures together.
    double poll_bytes = 600;       ///< One poll and its answer on the wire.
    double picture_bytes =
        20000;                   ///< Most that an answer's picture may have; 0: never ask for one.
    double picture_share = 0.5;  ///< Pictures are asked for while the bucket is fuller than this.
    double picture_age_s = 7 * 86400.0;  ///< A told hazard's picture is renewed after this.
    double lookahead_s = 30;       ///< A vehicle is asked this long before it passes at most...
    double lookahead_m = 400;      ///< ...and at most this far ahead.
    double corridor_m = 20;        ///< Half width of its way at the vehicle...
    double corridor_slope = 0.3;   ///< ...which grows by this per metre ahead: roads bend.
    double answer_timeout_s = 60;  ///< A poll is open for this long.
    double same_vehicle_gap_s = 6 * 3600.0;
    double vehicle_silence_s = 15;  ///< A vehicle not heard of for this long is not asked.
    std::size_t max_open_per_hazard = 1;
    std::size_t max_open_per_vehicle = 4;
    std::size_t max_vehicles = 10000;  ///< The longest silent one goes beyond it.
  };

  /// Throws Error naming the value that is out of range. `hash_seed`: see SpatialGrid.
  PollScheduler(const Config& config, std::uint64_t hash_seed);

  /// The hazard as it is now: after every step of its life, a new position or a new picture. One
  /// that is not on the map is forgotten. `picture_ns`: stamp of its newest picture, 0 without one.
  void SetHazard(std::uint64_t hazard, const GeoPoint& position, const LifeClass& entry,
                 const LifeRecord& life, std::int64_t picture_ns, std::int64_t now_ns);
  void RemoveHazard(std::uint64_t hazard);
  /// Where a vehicle is now. `point.stamp_ns` is when the zone heard it.
  void SetVehicle(const std::string& vehicle_id, const TrackPoint& point);

  /// The polls to send now. Each counts as open until Answered or its expiry.
  std::vector<PollChoice> TakeDue(std::int64_t now_ns);
  /// An answer came, of whatever kind; to be called before SetHazard with what followed from it.
  /// `bytes`: what it and the poll really took, in place of the estimate. False: no such open poll.
  bool Answered(std::uint64_t hazard, const std::string& vehicle_id, double bytes,
                std::int64_t now_ns);

  std::size_t hazards() const { return hazards_.size(); }
  std::size_t open_polls() const { return open_count_; }
  /// Bytes of all polls so far; estimates for those not answered.
  double bytes() const { return bytes_; }

 private:
  struct Target;
  struct Asked;
  struct Rider;

  Config config_;
};

}  // namespace livemap
