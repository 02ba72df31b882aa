#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <list>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/queues/token_bucket.h"
#include "common/uuid.h"
#include "geo/spatial_grid.h"
#include "zone/belief/hazard_lifecycle.h"
#include "zone/registry/vehicle_track.h"

namespace livemap::zone {

/// Which vehicle to ask about which hazard.
struct PollChoice {
  Uuid poll;                 ///< Names the poll from now on.
  std::uint64_t hazard = 0;  ///< The caller's id.
  std::string vehicle_id;
  bool picture_wanted = false;
  bool frame_wanted = false;    ///< The whole frame, for an official (AskForFrame).
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
/// Frames. Of a hazard for which an official wants a whole frame the next vehicle that passes is
/// asked whatever it costs in wrong map, one after the other until ForgetFrame, as far as there are
/// bytes.
///
/// Cost. Hazards wait in a heap for the time they are due, and due ones in a grid for a vehicle to
/// come by: a tick looks at what fell due and at what lies around vehicles that moved on or turned,
/// never at all.
class PollScheduler {
 public:
  struct Config {
    double price_s = 120;          ///< Of a poll, in seconds of wrong map; > 0.
    double bytes_per_hour = 10e6;  ///< Of polls, answers and pictures together.
    double poll_bytes = 600;       ///< One poll and its answer on the wire.
    double picture_bytes =
        20000;                    ///< Most that an answer's picture may have; 0: never ask for one.
    double frame_bytes = 100000;  ///< Most that a whole frame may have; 0: none is ever asked for.
    double picture_share = 0.5;   ///< Pictures are asked for while the bucket is fuller than this.
    double picture_age_s = 7 * 86400.0;  ///< A told hazard's picture is renewed after this.
    double lookahead_s = 30;       ///< A vehicle is asked this long before it passes at most...
    double lookahead_m = 400;      ///< ...and at most this far ahead.
    double corridor_m = 20;        ///< Half width of its way at the vehicle...
    double corridor_slope = 0.3;   ///< ...which grows by this per metre ahead: roads bend.
    double answer_timeout_s = 60;  ///< A poll is open for this long.
    double same_vehicle_gap_s = 6 * 3600.0;
    double vehicle_silence_s = 15;  ///< A vehicle not heard of for this long is forgotten.
    std::size_t max_open_per_hazard = 1;
    std::size_t max_open_per_vehicle = 4;
    std::size_t max_vehicles = 10000;  ///< The longest silent one goes beyond it.
  };

  /// A poll that was sent and waits for its answer. It is open up to and including `expires_ns`.
  struct OpenPoll {
    std::uint64_t hazard = 0;
    std::string vehicle_id;
    std::int64_t asked_ns = 0;
    std::int64_t expires_ns = 0;
    double bytes = 0;  ///< Estimate of what poll and answer take, with the picture.
    bool picture_wanted = false;
    bool frame_wanted = false;
  };

  /// Throws Error naming the value that is out of range. `seed`: of the grids' hashes (see
  /// SpatialGrid) and of the polls' uuids.
  PollScheduler(const Config& config, std::uint64_t seed);

  /// The hazard as it is now: after every step of its life, a new position or a new picture. One
  /// that is not on the map is forgotten. `picture_ns`: stamp of its newest picture, 0 without one.
  void SetHazard(std::uint64_t hazard, const geo::GeoPoint& position, const ClassModel& entry,
                 const PresenceRecord& life, std::int64_t picture_ns, std::int64_t now_ns);
  void RemoveHazard(std::uint64_t hazard);
  /// From now on vehicles that pass the hazard are asked for a whole frame, until `until_ns` or
  /// ForgetFrame, also while the hazard is unknown for a time. None is asked for it twice within
  /// kFrameAgainS. A further call for the same hazard takes the place of the one before.
  void AskForFrame(std::uint64_t hazard, std::int64_t until_ns, std::int64_t now_ns);
  void ForgetFrame(std::uint64_t hazard) { frames_.erase(hazard); }
  /// Whether the settings leave bytes for a whole frame at all.
  bool AsksForFrames() const {
    return config_.frame_bytes > 0 &&
           config_.frame_bytes + config_.poll_bytes <= budget_.capacity();
  }
  /// Whether vehicles can be asked about the hazard at all.
  bool HasHazard(std::uint64_t hazard) const { return hazards_.count(hazard) != 0; }
  /// A vehicle that brought no frame is asked for the same one again after so long, s.
  static constexpr double kFrameAgainS = 600;
  /// Where a vehicle is now. `point.stamp_ns` is when the zone heard it.
  void SetVehicle(const std::string& vehicle_id, const TrackPoint& point);

  /// The polls to send now. Each is open until Answered or its expiry.
  std::vector<PollChoice> TakeDue(std::int64_t now_ns);
  /// The open poll of this uuid; none when it was never asked, is answered or has expired.
  std::optional<OpenPoll> FindOpen(const Uuid& poll, std::int64_t now_ns) const;
  /// An answer came, of whatever kind; to be called before SetHazard with what followed from it.
  /// `bytes`: what it and the poll really took, in place of the estimate. What a vehicle sends
  /// beyond that it was not asked for, and takes nothing from others. False: no such open poll.
  bool Answered(const Uuid& poll, double bytes, std::int64_t now_ns);

  std::size_t hazards() const { return hazards_.size(); }
  /// Bytes of all polls so far; estimates for those not answered.
  double bytes() const { return bytes_; }

 private:
  struct Target {
    geo::GeoPoint position;
    ClassSurvival survival;
    std::int64_t at_ns = 0;  ///< `log_odds` and `debt_s` are of this moment.
    std::int64_t first_seen_ns = 0;
    std::int64_t last_yes_ns = 0;
    std::int64_t picture_ns = 0;
    double log_odds = 0;
    double debt_s = 0;  ///< Seconds of wrong map expected since the last word that settled it.
    std::uint32_t version = 0;  ///< Of its entry in the heap.
    std::uint16_t open = 0;
    HazardState state = HazardState::kCandidate;
    bool waiting = false;  ///< Due, in `waiting_`.
  };
  /// The vehicles that lately spoke of a hazard or were asked about it, in a ring.
  struct Asked {
    std::array<std::uint64_t, 8> vehicle{};
    std::array<std::int64_t, 8> at_ns{};
    std::size_t next = 0;
  };
  struct TrackedVehicle {
    std::string id;
    std::uint64_t key = 0;
    TrackPoint point;
    std::size_t open = 0;
    bool moved = false;
    std::optional<TrackPoint> last_scanned_at;  ///< When what waits was last sought around it.
  };
  using RiderPlace = std::list<TrackedVehicle>::iterator;
  struct Due {
    std::int64_t at_ns;
    std::uint64_t hazard;
    std::uint32_t version;
    friend bool operator<(const Due& a, const Due& b) { return a.at_ns > b.at_ns; }
  };
  /// A whole frame that somebody waits for, and when each vehicle was last asked for it.
  struct Frame {
    std::int64_t until_ns = 0;
    std::map<std::uint64_t, std::int64_t> asked_ns;
  };
  double DebtS(const Target& target, std::int64_t now_ns) const;
  double PriceS() const;
  std::int64_t DueNs(const Target& target, double price_s) const;
  void Schedule(std::uint64_t hazard, Target& target, std::int64_t now_ns);
  void ForgetRider(RiderPlace rider);
  void StartWaiting(std::uint64_t hazard, Target& target);
  void StopWaiting(std::uint64_t hazard, Target& target);
  void RecordPoll(std::uint64_t hazard, std::uint64_t vehicle, std::int64_t at_ns);
  bool WasAsked(std::uint64_t hazard, std::uint64_t vehicle, std::int64_t now_ns) const;
  void ForgetAsked(std::int64_t now_ns);
  bool MayAskForFrame(std::uint64_t hazard, std::uint64_t vehicle, std::int64_t now_ns) const;
  void ExpirePolls(std::int64_t now_ns);
  void ExpireFrames(std::int64_t now_ns);
  void TakeFallenDue(std::int64_t now_ns);
  void LookAround(std::uint64_t hazard, std::int64_t now_ns, std::vector<PollChoice>& choices);
  void TryAsk(std::uint64_t hazard, TrackedVehicle& rider, std::int64_t now_ns,
              std::vector<PollChoice>& choices);
  bool Passes(const TrackPoint& point, const geo::GeoPoint& place) const;
  bool SeesOtherPlaces(const TrackedVehicle& rider) const;
  void Close(const OpenPoll& poll);
  void CompactHeap();

  Config config_;
  std::unordered_map<std::uint64_t, Target> hazards_;
  std::vector<Due> heap_;                   // Soonest first; entries of an old version are stale.
  geo::SpatialGrid waiting_;                // Hazards that are due.
  std::vector<std::uint64_t> look_around_;  // Due since the last tick, or free to be asked again.
  std::unordered_map<std::uint64_t, Frame> frames_;  // By hazard.
  std::unordered_map<std::uint64_t, Asked> asked_;
  std::deque<std::pair<std::int64_t, std::uint64_t>> asked_order_;  // When noted, hazard.
  std::list<TrackedVehicle> riders_;                                // Longest silent first.
  std::unordered_map<std::string, RiderPlace> riders_by_id_;
  std::unordered_map<std::uint64_t, RiderPlace> riders_by_key_;
  geo::SpatialGrid rider_grid_;
  std::vector<std::uint64_t> moved_;  // Keys of riders heard since the last tick.
  std::unordered_map<Uuid, OpenPoll> open_;
  std::deque<Uuid> expiry_order_;  // Soonest first; answered ones are in `open_` no more.
  std::mt19937_64 generator_;      // Of the polls' uuids.
  TokenBucket budget_;             // Bytes.
  double bytes_ = 0;
};

}  // namespace livemap::zone
