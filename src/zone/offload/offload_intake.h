#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "geo/ground_projection.h"
#include "placement/sighting.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/offloaded_frame.h"
#include "protocol/report.h"
#include "zone/admission/offload_allowance.h"
#include "zone/admission/offload_validation.h"
#include "zone/admission/speed_rule.h"

namespace livemap::zone {

/// The zone's side of a small vehicle: takes its candidate frames, hands them to a detector a few
/// at a time under stamps of the zone's own (those of two vehicles may be equal), and turns what
/// the detector says into reports, placed by the pose that came with the frame. Trusts no vehicle:
/// every frame is checked, each vehicle has an allowance, all memory is bounded. Not thread-safe.
class OffloadIntake {
 public:
  struct Config {
    OffloadLimits limits;
    OffloadAllowance::Config allowance;
    SpeedRule speed;                  ///< Between the places of a vehicle's frames.
    int max_waiting = 200;            ///< Frames that wait for the detector; then the oldest goes.
    double max_waiting_bytes = 32e6;  ///< Of their pictures.
    int max_in_flight = 4;            ///< Frames at the detector, so that it never drops one.
    double detection_timeout_s = 10;  ///< A frame without an answer is given up after this long, s.
    /// Frames of which each vehicle's are known again when the broker brings them twice.
    int max_remembered = 10000;
    /// As hazard_reporting on a big vehicle has them.
    double min_confidence = 0.0;
    double max_range_m = 30.0;
    double max_ground_sigma_m = 1.0;
    geo::GroundProjectionNoise projection;
  };

  /// Since the start. frames = refused + over_allowance + repeated + displaced + undecodable +
  /// lost_by_detector + detected + waiting + in flight.
  struct Counters {
    std::uint64_t frames = 0;
    std::uint64_t bytes = 0;             ///< Of all pictures that came.
    std::uint64_t refused = 0;           ///< Broken, see WhyOffloadRefused, or too fast.
    std::uint64_t too_fast = 0;          ///< Of these, for the speed that their places would need.
    std::uint64_t over_allowance = 0;    ///< More than the vehicle may send.
    std::uint64_t repeated = 0;          ///< Known already.
    std::uint64_t displaced = 0;         ///< The detector was too far behind.
    std::uint64_t undecodable = 0;       ///< A good header, but no picture behind it.
    std::uint64_t lost_by_detector = 0;  ///< No answer in time.
    std::uint64_t detected = 0;          ///< Frames with an answer.
    std::uint64_t empty = 0;             ///< Of these, without a hazard: sent in vain.
    std::uint64_t sightings = 0;         ///< In them.
    std::uint64_t invalid_sightings = 0;
    std::uint64_t below_confidence = 0;
    std::uint64_t cut_by_side = 0;  ///< By the image's: the foot may be out of view.
    std::uint64_t not_on_ground = 0;
    std::uint64_t too_far = 0;
    std::uint64_t reports = 0;
  };

  /// A frame at the detector.
  struct Job {
    std::int64_t internal_ns = 0;  ///< Its stamp within the zone: unique, ascending.
    protocol::OffloadedFrame frame;
  };

  /// The catalogue says how far the middles of things lie behind what the camera sees.
  OffloadIntake(const Config& config, protocol::HazardCatalogue catalogue)
      : config_(config), catalogue_(std::move(catalogue)), allowance_(config.allowance) {}

  /// Why the frame is not taken, in one sentence; empty when it is. `now_ns` is the zone's clock.
  std::string Add(protocol::OffloadedFrame frame, std::int64_t now_ns);

  /// The next frame for the detector, or null when it has enough to do or none waits. Valid until
  /// Finish or Abandon of it, or Expire. `steady_s` never pauses.
  const Job* Next(std::int64_t now_ns, double steady_s);
  /// The frame's picture could not be decoded.
  void Abandon(std::int64_t internal_ns);
  /// The detector's answer to the frame with this stamp: its reports, without pictures. A stamp
  /// that is unknown, or known no more, gives none.
  std::vector<protocol::Report> Finish(std::int64_t internal_ns,
                                       const placement::SightingFrame& answer);
  /// Gives up frames that the detector has lost; their stamps.
  std::vector<std::int64_t> Expire(double steady_s);

  const Counters& counters() const { return counters_; }
  std::size_t waiting() const { return waiting_.size(); }
  std::size_t in_flight() const { return in_flight_.size(); }

 private:
  struct InFlight {
    Job job;
    double since_s = 0;
  };
  struct Track {
    ReportTrack track;
    std::int64_t heard_ns = 0;  ///< Zone clock.
  };
  using Key = std::pair<std::string, std::int64_t>;  // Vehicle and stamp.

  bool IsUsable(const placement::Sighting& sighting);
  std::optional<geo::GroundPoint> PlaceOnRoad(const protocol::OffloadedFrame& frame,
                                              const placement::Sighting& sighting);
  protocol::Report ReportOf(const protocol::OffloadedFrame& frame,
                            const placement::Sighting& sighting, const geo::GroundPoint& ground);
  bool Remember(const protocol::OffloadedFrame& frame);
  std::optional<double> ChallengePlace(const protocol::OffloadedFrame& frame, std::int64_t now_ns);

  Config config_;
  const protocol::HazardCatalogue catalogue_;
  OffloadAllowance allowance_;
  std::deque<protocol::OffloadedFrame> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::map<std::int64_t, InFlight> in_flight_;  // By internal stamp.
  std::int64_t newest_internal_ns_ = 0;
  std::set<Key> remembered_;
  std::deque<Key> remembered_order_;
  /// Where each vehicle was; as many vehicles as the allowance has, beyond which the longest silent
  /// one goes. The reports that come of the frames are judged once more, by what the zone has
  /// stored.
  std::map<std::string, Track> tracks_;
  Counters counters_;
};

/// Of a hazard seen in a candidate frame: always the same for the same vehicle, stamp, class and
/// box (to a tenth of a pixel), so that a frame that comes twice is one report. RFC 9562 version 8,
/// by SHA-256.
Uuid OffloadReportUuid(const std::string& vehicle_id, std::int64_t stamp_ns,
                       const std::string& class_name, const imaging::Box& box);

}  // namespace livemap::zone
