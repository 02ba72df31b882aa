#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/time.h"
#include "geo/ground_projection.h"
#include "imaging/report_picture.h"
#include "placement/depth_ground_contact.h"
#include "placement/sighting.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/notice.h"
#include "protocol/report.h"
#include "vehicle/outbox/resend_schedule.h"
#include "vehicle/outbox/zone_finder.h"
#include "vehicle/pictures/picture_order.h"
#include "vehicle/positioning/vehicle_pose_lookup.h"
#include "vehicle/reporting/cell_follower.h"
#include "vehicle/reporting/local_hazard_map.h"
#include "vehicle/reporting/pass_sights.h"
#include "vehicle/reporting/settling_reports.h"
#include "vehicle/reporting/waiting_frame.h"

namespace livemap::vehicle {

/// Whose positions count.
enum class PositionSource {
  kFixes,  ///< The receiver's fixes; the course is that of their track.
  kFused,  ///< Poses of fixes fused with odometry; the fixes where those do not come.
};

/// What the vehicle's way to the zone costs now (LinkState.msg).
enum class LinkCost { kUnknown, kCheap, kMetered, kNone };

/// Turns what the detector sees into reports: places each hazard on the ground, sends nothing for a
/// known one, keeps the others until the zone has answered (thesis, sections 3.1 and 3.2.2).
///
/// Fixes, frames, images, notices and receipts come in as they arrive; Process works off what can
/// be worked off; TakeDue gives the reports to send now. Two clocks: `now_s` is the clock of the
/// stamps (it may be a simulated one that pauses), `steady_s` never pauses. Not thread-safe.
///
/// The reporter holds images as the camera saw them, and never puts one into a report: it orders
/// the pictures (TakePictureOrders), and takes what may leave the vehicle (AddPictures).
///
/// A report's place is that of all sights of the pass so far (PassSights). An urgent hazard is
/// reported at its first sight near enough; the others while they are in view, at most
/// settle_wait_s later, with the picture of their newest sight.
class HazardReporter {
 public:
  struct Config {
    std::string drive_id;
    /// Sightings below this confidence are ignored; the detector's own threshold stands before it.
    double min_confidence = 0.0;
    /// A sighting further away than this waits for a nearer view: its place is too uncertain, m.
    double max_range_m = 30.0;
    /// So does one whose place on the road is less certain than this, seen from the vehicle:
    /// standard deviation along its worst axis, m. A low camera reaches it before max_range_m. With
    /// fused poses the heading's error at that distance counts, too; and where fixes stand in for
    /// them, with twice this limit.
    double max_ground_sigma_m = 1.0;
    /// A frame waits at most this long for fix, course and camera; then it is dropped, s.
    double max_wait_s = 5.0;
    /// A frame whose position can only be carried on waits this long for a fix after it, s.
    double bracket_wait_s = 0.3;
    /// A frame with something to report waits at most this long for its image, s: messages of
    /// another process may overtake it.
    double image_wait_s = 0.3;
    /// Frames that wait at the same time; beyond it the oldest is dropped.
    int max_waiting_frames = 50;
    /// Antenna in base_link: forward and left of its origin, m.
    double antenna_x_m = 0.0;
    double antenna_y_m = 0.0;
    PositionSource position_source = PositionSource::kFixes;
    /// A frame waits at most this long for its fused pose; then the fixes count, s.
    double fused_wait_s = 1.0;
    PoseTrack::Config poses;
    /// Distances by depth images, where they know the one of the hazard's foot.
    bool use_depth = false;
    /// A frame waits at most this long for its depth image; then the road's plane counts, s.
    double depth_wait_s = 0.3;
    placement::DepthNoise depth;
    int depth_images = 60;  ///< So many are kept: detections come late, events later.
    /// A report that is not urgent (rank 2 or 3) waits at most this long for further sights of its
    /// hazard, s: by the clock of the stamps, and by the steady one twice as long; 0: not at all.
    double settle_wait_s = 1.5;
    /// It waits no longer than until its place, seen from the vehicle, is known this well: standard
    /// deviation along the worst axis, m.
    double settle_sigma_m = 0.2;
    PassSights::Config passes;
    imaging::CropConfig picture;
    /// How long a report of each rank of urgency may wait for a cheap link, s; rank 1 first. Below
    /// the age at which the zone refuses reports.
    std::array<double, 3> hold_s{0, 300, 21600};
    /// Whether a link of which nothing is known counts as cheap: nothing is held then.
    bool unknown_link_is_cheap = true;
    /// Where held reports lie in the outbox at the start, so long nothing is known as metered, s:
    /// the word about the link may come after us.
    double link_wait_s = 5;
    FixTrack::Config track;
    geo::GroundProjectionNoise projection;
    ResendSchedule::Config resend;
    LocalHazardMap::Config map;
    CellFollower::Config cells;
  };

  /// Since the start; sightings unless it says otherwise.
  struct Counters {
    std::uint64_t detections = 0;          ///< All that came in.
    std::uint64_t invalid_detections = 0;  ///< NaN, empty box, overlong class: dropped.
    std::uint64_t below_confidence = 0;
    std::uint64_t held_back_no_fix = 0;   ///< Had to wait for a fix or course.
    std::uint64_t dropped_no_fix = 0;     ///< Waited in vain, or overflowed the waiting room.
    std::uint64_t dropped_no_camera = 0;  ///< No camera_info or mounting, or another image size.
    std::uint64_t not_on_ground = 0;      ///< Box ends at or above the horizon.
    std::uint64_t cut_by_side = 0;        ///< By the image's: the foot may be out of view.
    std::uint64_t too_far = 0;            ///< Waits for a nearer view.
    std::uint64_t duplicates_suppressed = 0;
    std::uint64_t reports_created = 0;
    std::uint64_t reports_without_picture = 0;
    std::uint64_t pictures_requested = 0;  ///< Images of which pictures were ordered.
    std::uint64_t pictures_illegible = 0;  ///< Reports whose bytes did not suffice: CropPicture.
    std::uint64_t refused_map_full = 0;    ///< Too many unfinished reports.
    std::uint64_t reports_sent = 0;        ///< Distinct reports, at their first sending.
    std::uint64_t resends = 0;
    std::uint64_t committed = 0;  ///< Reports that the zone stored.
    std::uint64_t refused = 0;    ///< Reports that the zone will never accept.
    std::uint64_t notices = 0;
    std::uint64_t invalid_notices = 0;
    std::uint64_t cell_requests = 0;  ///< Cells that a zone was asked about.
    std::uint64_t cell_answers = 0;   ///< Cells that a zone told.
    /// Hazards that the zone took in and never announced.
    std::uint64_t forgotten_unannounced = 0;
    std::uint64_t redirected = 0;  ///< Reports whose zone is gone, sent to the one of their place.
    std::uint64_t fixes = 0;
    std::uint64_t invalid_fixes = 0;    ///< NaN, out of range, out of order.
    std::uint64_t no_fixes = 0;         ///< The receiver said that it had none.
    std::uint64_t jumps = 0;            ///< Fixes that need an impossible speed.
    std::uint64_t fixes_bad_stamp = 0;  ///< Fixes whose stamp fits neither clock nor neighbours.
    std::uint64_t store_errors = 0;
    std::uint64_t poses = 0;          ///< Fused poses that came.
    std::uint64_t invalid_poses = 0;  ///< Not finite or not later than the one before.
    std::uint64_t placed_by_fusion = 0;
    std::uint64_t placed_by_fixes = 0;
    std::uint64_t distances_by_depth = 0;  ///< Sightings; the others' are by the road's plane.
    std::uint64_t sights_used = 0;         ///< Of all reports together: their places are of these.
  };

  /// `random` makes uuids and jitter; `now_ns` (UTC) names a corrupt database's new name.
  HazardReporter(const Config& config, const protocol::HazardCatalogue& catalogue,
                 std::mt19937_64 random, std::int64_t now_ns, double steady_s);

  void SetIntrinsics(const geo::CameraIntrinsics& intrinsics) { intrinsics_ = intrinsics; }
  /// Pose of the camera's optical frame in base_link.
  void SetMounting(const std::string& frame_id, const Eigen::Isometry3d& base_from_optical);
  bool HasMounting(const std::string& frame_id) const { return mountings_.count(frame_id) != 0; }

  /// `now_ns` is the clock of the stamps; 0: it is not known.
  void AddFix(const geo::Fix& fix, std::int64_t now_ns = 0);
  /// Where base_link was then and which way it looked: fixes and odometry fused.
  void AddPose(std::int64_t stamp_ns, const geo::TrackPose& pose, std::int64_t now_ns = 0);
  /// The clock was set back, as by a bag that is played again. What waits is finished; positions,
  /// pictures and depth images of before are forgotten. Reports in the outbox and known hazards
  /// stay.
  void StartAnew(double now_s, double steady_s);
  /// Nothing more will come, as at the end of the drive. What waits for a picture or a position is
  /// reported with what is known of it now, or dropped and counted.
  void Finish(double steady_s);
  void AddFrame(const placement::SightingFrame& frame, double now_s);
  /// The depth image of the frame with this stamp, before or after it.
  void AddDepth(std::int64_t stamp_ns, const placement::DepthImage& depth);
  /// An added frame of this stamp that has not got its image yet; null: there is none.
  const placement::SightingFrame* FrameWithoutImage(std::int64_t stamp_ns) const;
  /// The image of the added frames with this stamp.
  void AddImage(std::int64_t stamp_ns, const CameraImage& image);
  /// The pictures that are wanted now, each order once. Each has to be answered by AddPictures: its
  /// frame waits for it.
  std::vector<PictureOrder> TakePictureOrders();
  /// The answer to an order: one picture for each cut, or nothing where none may leave the vehicle.
  void AddPictures(std::uint64_t order, std::vector<imaging::CroppedPicture> pictures);
  /// Reports go to the zone in which their hazard lies; those that wait for a zone that exists no
  /// longer, to the one that has their place now. Hazards of such a zone are forgotten, and what a
  /// zone says lies in another one is refused.
  void SetZones(ZoneFinder zones) {
    map_.RefuseBeyond(zones.is_beyond);
    zones_ = std::move(zones);
  }
  void SetLink(LinkCost link) { link_ = link; }
  void AddNotice(const protocol::Notice& notice);
  /// What a zone told of cells of the map.
  void AddCellNews(const protocol::CellNews& news);
  /// The vehicle is at a valid position. Returns whether it wants to hear of other cells than
  /// before: those of cells().wanted().
  bool FollowCells(const geo::GeoPoint& position) { return cells_.MoveTo(position); }
  /// As CellFollower::SetHeard.
  void SetCellsHeard(const std::string& zone, const std::vector<geo::MapCell>& cells) {
    cells_.SetHeard(zone, cells);
  }
  /// As CellFollower::SetZones.
  void SetZonesNear(const std::vector<std::string>& zones) { cells_.SetZones(zones); }
  /// What zones are to be asked about cells now.
  std::vector<protocol::CellRequest> TakeCellRequests(double steady_s);
  void AddReceipt(const protocol::Receipt& receipt);

  /// Works off waiting notices and frames, in their order.
  void Process(double now_s, double steady_s);
  /// At most `limit` reports to send now.
  std::vector<protocol::Report> TakeDue(double steady_s, std::size_t limit);

  /// Where base_link was, by the source that counts.
  const VehiclePoseLookup& vehicle_poses() const { return vehicle_poses_; }
  const std::optional<geo::CameraIntrinsics>& intrinsics() const { return intrinsics_; }
  std::optional<Eigen::Isometry3d> Mounting(const std::string& frame_id) const;

  /// Intrinsics and some camera's mounting are known.
  bool HasCamera() const { return intrinsics_ && !mountings_.empty(); }
  const FixTrack& track() const { return vehicle_poses_.fixes(); }
  const PoseTrack& poses() const { return vehicle_poses_.poses(); }
  const Config& config() const { return config_; }
  const LocalHazardMap& map() const { return map_; }
  const CellFollower& cells() const { return cells_; }
  const Counters& counters() const { return counters_; }
  std::size_t waiting_frames() const { return waiting_.size(); }
  /// Reports that wait for further sights of their hazards.
  std::size_t settling_reports() const { return settling_.size(); }
  LinkCost link() const { return link_; }
  /// Reports that wait for a cheap link.
  std::size_t HeldReports(double steady_s) const {
    return IsCheap(steady_s) ? 0 : schedule_.Held(steady_s);
  }
  /// How long before this image stamp the oldest unfinished report was made, s; 0: there is none.
  double OutboxAgeS(std::int64_t stamp_ns) const {
    return std::max(0.0, Seconds(stamp_ns - schedule_.OldestNs().value_or(stamp_ns)));
  }
  /// The store's last complaint; empty while it works.
  const std::string& store_error() const { return store_error_; }

 private:
  bool IsUsable(const placement::Sighting& sighting);
  bool IsPlaced(WaitingFrame& waiting, double now_s);
  bool IsKnown(const PlacedSighting& candidate) const;
  bool HasUnknownHazard(const WaitingFrame& waiting) const;
  bool IsCoveredByEarlierFrame(std::deque<WaitingFrame>::const_iterator waiting) const;
  void OrderPictures(WaitingFrame& waiting);
  static bool HasSizeOfFrame(const WaitingFrame& waiting);
  bool Advance(WaitingFrame& waiting, double now_s, double steady_s);
  bool FitsCamera(const placement::SightingFrame& frame) const;
  bool Place(WaitingFrame& waiting, double waited_s);
  bool WaitsForDepth(const WaitingFrame& waiting, double waited_s) const;
  void PlaceSightings(WaitingFrame& waiting, const geo::TrackPose& base, bool fused);
  std::optional<placement::HazardSight> SightOnRoad(const placement::SightingFrame& frame,
                                                    const placement::Sighting& sighting,
                                                    const geo::TrackPose& base, bool fused);
  bool IsWorthASight(const placement::HazardSight& sight) const;
  bool WaitsForPicture(WaitingFrame& waiting, double now_s);
  void ReportCandidates(WaitingFrame& waiting, double now_s, double steady_s);
  std::int64_t ShownNs() const;
  void ReportSettled(double now_s, double steady_s);
  void ReportSettledView(WaitingFrame& view, double steady_s);
  void AddReport(const protocol::Report& report, PassSights::Id pass, double steady_s);
  protocol::Report MakeReport(WaitingFrame& waiting, std::size_t index);
  void AttachPicture(WaitingFrame& waiting, std::size_t index, protocol::Report& report);
  double HoldS(int urgency) const;
  bool IsCheap(double steady_s) const;
  std::int64_t UtcNs(double steady_s) const;
  void ApplyNotices();
  void ApplyCellNews(double steady_s);
  void ForgetWhatNobodyTells(double now_s);
  std::optional<protocol::Report> LoadToSend(const Uuid& uuid);
  void TellStoreError(const StoreError& error);

  Config config_;
  protocol::HazardCatalogue catalogue_;
  std::mt19937_64 random_;
  LocalHazardMap map_;
  ZoneFinder zones_;
  VehiclePoseLookup vehicle_poses_;
  ResendSchedule schedule_;
  std::optional<geo::CameraIntrinsics> intrinsics_;
  std::map<std::string, Eigen::Isometry3d> mountings_;
  std::deque<WaitingFrame> waiting_;
  PassSights passes_;
  SettlingReports settling_;
  std::int64_t newest_frame_ns_ = 0;                      // Worked off.
  std::int64_t newest_empty_ns_ = 0;                      // Frame without a sighting.
  std::map<std::int64_t, placement::DepthImage> depths_;  // By stamp.
  std::vector<PictureOrder> picture_orders_;
  std::uint64_t last_order_ = 0;
  LinkCost link_ = LinkCost::kUnknown;
  bool held_at_start_ = false;
  std::int64_t start_ns_;  // UTC at the start...
  double start_steady_s_;  // ...and the steady clock then.
  std::deque<protocol::Notice> notices_;
  std::deque<protocol::CellNews> cell_news_;
  CellFollower cells_;
  std::optional<double> forgot_s_;  // When ForgetUnannounced last looked.
  Counters counters_;
  std::string store_error_;
};

}  // namespace livemap::vehicle
