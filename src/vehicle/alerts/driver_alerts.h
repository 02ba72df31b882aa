#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "common/uuid.h"
#include "geo/spatial_grid.h"
#include "geo/vehicle_pose.h"
#include "geo/wgs84.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/trail.h"
#include "streets/street_map.h"
#include "vehicle/alerts/course_filter.h"
#include "vehicle/alerts/street_way.h"
#include "vehicle/alerts/trail_way.h"
#include "vehicle/alerts/way_ahead.h"

namespace livemap::vehicle {

/// A hazard of which the driver may be warned.
struct AlertHazard {
  Uuid id;
  std::string class_name;
  geo::GeoPoint position;
  double sigma_m = 0;                ///< Of the position, per axis; 0: not known.
  std::optional<double> altitude_m;  ///< Above the ellipsoid, where known.
  /// Of a vehicle that passed it, as protocol::Notice has it.
  double course_rad = std::numeric_limits<double>::quiet_NaN();
  std::vector<protocol::Trail> trails{};  ///< As protocol::Notice has them.
};

/// Word to the driver about one hazard.
struct HazardAlert {
  enum class State {
    kApproach,   ///< It lies ahead on the vehicle's way.
    kPassed,     ///< The vehicle has passed it.
    kCancelled,  ///< It lies no longer on the way, or is gone.
  };
  enum class Side { kAhead, kLeft, kRight };

  Uuid id;
  std::string class_name;
  int urgency = 2;  ///< As the catalogue has it, 1 is the worst.
  State state = State::kApproach;
  Side side = Side::kAhead;
  double distance_m = 0;   ///< Along the way; 0 where it is passed or cancelled.
  double time_s = 0;       ///< Until it is reached at the present speed; as above.
  double probability = 0;  ///< That it lies on the way; as above.
};

/// Says which hazards lie on the vehicle's own way, early enough and once per approach.
///
/// The way is predicted by how the vehicle drives (WayAhead), and where the vehicle has a map of
/// its streets and is on one of them, by their geometry (StreetWay). Each hazard is far,
/// approached, or done with: passed or cancelled, until it is left behind far enough. A vehicle
/// that stands is told nothing new. Deterministic. Not thread-safe.
///
/// Typical usage: Put and Remove as the map changes, Add for every position; what Add and Remove
/// return goes to the driver in that order.
class DriverAlerts {
 public:
  struct Config {
    double min_lead_s = 5.0;    ///< An alert comes at least so long before the hazard, s.
    double reaction_s = 1.5;    ///< Of the driver, s.
    double braking_mps2 = 3.5;  ///< Of the vehicle, comfortably: its time to stop is added, m/s^2.
    double urgent_extra_s = 0.5;  ///< More for classes of rank 1, s.
    double starting_mps2 = 1.5;   ///< Assumed of a vehicle slower than starting_speed_mps.
    double starting_speed_mps = 7;
    double alert_above = 0.5;     ///< Probability from which the driver is told...
    double sure_time_s = 0.3;     ///< ...if its running mean over this time is above it, too, s.
    double cancel_below = 0.05;   ///< Below it an alert is cancelled...
    double cancel_after_s = 1.0;  ///< ...when it has been so for this long, s.
    double min_speed_mps = 2.0;   ///< A slower vehicle is told nothing new, m/s.
    double max_course_sigma_rad = 0.4;  ///< With a course less certain nothing new is told.
    double side_from_m = 2.5;           ///< Further to the side it is not ahead but left or right.
    double forget_beyond_m = 100;  ///< A hazard done with is told of again after this distance, m.
    double max_reach_m = 350;      ///< Hazards further away are not looked at, m.
    double default_sigma_m = 1.5;  ///< Of a hazard's place where the zone does not tell, m.
    double max_altitude_difference_m = 4;  ///< Beyond it, it is on another level.
    std::size_t max_hazards = 100000;      ///< Kept; beyond it new ones are refused.
    std::size_t max_near = 1000;           ///< Followed at the same time.
    /// On streets of a map: where the vehicle takes the way to a hazard with a probability of less
    /// than sure_above, because of junctions, the driver is told only so long before, s, when more
    /// is known.
    double unsure_lead_s = 4.5;
    double unsure_above = 0.64;  ///< Probability from which the driver is told then.
    double sure_above = 0.97;
    /// Nearer than this, s, such an alert comes late anyway: from this probability.
    double late_s = 3.9;
    double late_above = 0.9;
    double at_once_above = 0.9;     ///< Its running mean does not count above this one.
    double brakes_from_mps2 = 0.3;  ///< From here on a vehicle brakes.
    double speeding_up_mps2 = 2.4;  ///< Assumed on streets of a map below the usual speed.
    CourseFilter::Config course;
    WayAhead::Config way;
    TrailWay::Config trails;
    StreetWay::Config streets;
  };

  struct Counters {
    std::uint64_t positions = 0;
    std::uint64_t invalid_positions = 0;
    std::uint64_t velocities = 0;  ///< That counted.
    std::uint64_t invalid_hazards = 0;
    std::uint64_t refused_full = 0;
    std::uint64_t approaches = 0;
    std::uint64_t passed = 0;
    std::uint64_t cancelled = 0;
  };

  /// Throws Error for a config that cannot be. Without `map` the streets are not known.
  DriverAlerts(const Config& config, const protocol::HazardCatalogue& catalogue,
               std::shared_ptr<const streets::StreetMap> map = nullptr);

  /// Adds a hazard or replaces it. False when it is refused: no valid position or course, or too
  /// many.
  bool Put(const AlertHazard& hazard);
  /// Takes a hazard away; cancels its alert, if one stands.
  std::vector<HazardAlert> Remove(const Uuid& id);

  /// Where the vehicle is: position and covariance of the pose count; course and its variance only
  /// with `course_is_measured`, by something else than the positions. Returns what is to be told:
  /// what is passed or cancelled, then the approached, the worst first.
  std::vector<HazardAlert> Add(std::int64_t stamp_ns, const geo::TrackPose& pose,
                               bool course_is_measured = false,
                               std::optional<double> altitude_m = std::nullopt);
  /// What the receiver measured by the Doppler shift at a stamp. It counts with the position of the
  /// same stamp, whichever comes first; without one it does not. False when it is not finite.
  bool AddVelocity(std::int64_t stamp_ns, const CourseFilter::Velocity& velocity);
  /// What is ahead now and has been told, the worst first.
  std::vector<HazardAlert> Ahead() const;
  /// The vehicle's clock was set back: positions are forgotten, hazards are not. Returns the alerts
  /// that stood, cancelled.
  std::vector<HazardAlert> StartAnew();

  /// How long before a hazard of this rank of urgency the driver is told, s.
  double LeadS(int urgency, double speed_mps) const;
  bool Knows(const Uuid& id) const { return numbers_.count(id) != 0; }
  std::size_t size() const { return numbers_.size(); }
  const Counters& counters() const { return counters_; }
  const CourseFilter& course() const { return filter_; }
  /// That the vehicle is on a street of its map; 0 without one.
  double on_street() const { return street_way_ ? street_way_->on_street() : 0; }
  /// The driver's odds to turn at a junction against those of all drivers; 1 without a map.
  double turn_habit() const { return street_way_ ? street_way_->turn_habit() : 1; }

 private:
  /// A hazard near the vehicle.
  struct Near {
    HazardAlert alert;
    bool told = false;
    std::optional<double> likely;  // Running mean of the probability.
    bool on_way = false;           // The streets lead there, without a choice.
    bool unsure = false;           // Because of junctions.
    bool done = false;             // Passed or cancelled.
    double unlikely_s = 0;         // So long it has lain off the way.
  };
  struct Known {
    AlertHazard hazard;
    int urgency;
  };

  void FollowVehicle(const geo::GeoPoint& position);
  double ReachM(double time_s, bool may_start = true) const;
  double ReachOnStreetM(double time_s) const;
  WayAhead::Relation RelationOf(const WayAhead& way, const Known& known, double fix_variance_m2,
                                Near& near) const;
  void WeighTrails(const AlertHazard& hazard, const Eigen::Vector2d& place_m,
                   double fix_variance_m2, WayAhead::Relation& relation, Near& near) const;
  void Remember();
  bool OnOtherLevel(const AlertHazard& hazard, std::optional<double> altitude_m) const;
  bool IsDue(const Near& near) const;
  void Judge(const Known& known, const WayAhead::Relation& relation, double time_s, Near& near,
             std::vector<HazardAlert>& told);
  void End(HazardAlert::State state, Near& near, std::vector<HazardAlert>& told);
  void ForgetFar(const std::unordered_set<std::uint64_t>& seen, std::vector<HazardAlert>& told);

  Config config_;
  protocol::HazardCatalogue catalogue_;
  CourseFilter filter_;
  std::deque<DrivenPlace> driven_;       // The last metres of the way, on the filter's plane.
  std::optional<StreetWay> street_way_;  // With a map of streets.
  std::optional<geo::LocalFrame> frame_;
  std::optional<std::int64_t> newest_ns_;
  std::optional<std::pair<std::int64_t, CourseFilter::Velocity>> velocity_;  // Waits for its fix.
  geo::SpatialGrid grid_;
  std::vector<Known> known_;  // The grid's numbers are places in it; free ones are used again.
  std::vector<std::uint64_t> free_numbers_;
  std::unordered_map<Uuid, std::uint64_t> numbers_;
  std::unordered_map<std::uint64_t, Near> near_;
  Counters counters_;
};

}  // namespace livemap::vehicle
