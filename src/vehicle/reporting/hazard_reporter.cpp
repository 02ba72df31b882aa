#include "vehicle/reporting/hazard_reporter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/stamp_gate.h"
#include "common/time.h"
#include "placement/road_ground_contact.h"

namespace livemap::vehicle {
namespace {

constexpr double kEndlessRangeM = 1e4;  // The projection's own limit; max_range_m is ours.

VehiclePoseLookup::Config ReporterPoseConfigOf(const HazardReporter::Config& config) {
  VehiclePoseLookup::Config pose;
  pose.use_fused = config.position_source == PositionSource::kFused;
  pose.fused_wait_s = config.fused_wait_s;
  pose.bracket_wait_s = config.bracket_wait_s;
  pose.max_wait_s = config.max_wait_s;
  pose.antenna_x_m = config.antenna_x_m;
  pose.antenna_y_m = config.antenna_y_m;
  pose.fixes = config.track;
  pose.poses = config.poses;
  return pose;
}

constexpr std::size_t kMaxWaitingNotices = 20000;
/// Messages; what is dropped is asked again.
constexpr std::size_t kMaxWaitingCellNews = 100;
/// Sights from so many times too far away, or too uncertain, still help a hazard's place.
constexpr double kSightReach = 3.0;
/// Of fixes that stand in for fused poses: with the same limit more of what is passed at the start
/// of a drive would never be reported.
constexpr double kStandInReach = 2.0;
constexpr double kFixHeadingOwnShare =
    0.5;  // Of the course's variance; the fixes' windows overlap.
constexpr double kForEverS = 1e9;

}  // namespace

HazardReporter::HazardReporter(const Config& config, const protocol::HazardCatalogue& catalogue,
                               std::mt19937_64 random, std::int64_t now_ns, double steady_s)
    : config_(config),
      catalogue_(catalogue),
      random_(random),
      map_(config.map, catalogue, now_ns),
      vehicle_poses_(ReporterPoseConfigOf(config)),
      schedule_(config.resend, std::mt19937_64(random_())),
      passes_(config.passes, catalogue),
      settling_({config.settle_wait_s, config.settle_sigma_m}, catalogue),
      start_ns_(now_ns),
      start_steady_s_(steady_s),
      cells_(config.cells) {
  config_.projection.max_range_m = kEndlessRangeM;
  for (const auto& pending : map_.Pending()) {
    const int urgency = catalogue_.Get(pending.class_name).urgency;
    // Never longer than from now on: the clock may have been set since.
    const double left_s =
        pending.hold_until_ns <= 0
            ? 0.0
            : std::clamp(Seconds(pending.hold_until_ns - now_ns), 0.0, HoldS(urgency));
    held_at_start_ = held_at_start_ || (left_s > 0 && !pending.sent);
    schedule_.Add(pending.uuid, urgency, pending.created_ns, steady_s, steady_s + left_s,
                  pending.sent);
  }
}

void HazardReporter::SetMounting(const std::string& frame_id,
                                 const Eigen::Isometry3d& base_from_optical) {
  mountings_[frame_id] = base_from_optical;
}

std::optional<Eigen::Isometry3d> HazardReporter::Mounting(const std::string& frame_id) const {
  const auto found = mountings_.find(frame_id);
  if (found == mountings_.end()) return std::nullopt;
  return found->second;
}

void HazardReporter::AddFix(const geo::Fix& fix, std::int64_t now_ns) {
  ++counters_.fixes;
  switch (vehicle_poses_.AddFix(fix, now_ns)) {
    case FixTrack::Verdict::kAccepted:
    case FixTrack::Verdict::kRestarted:
      break;
    case FixTrack::Verdict::kNoFix:
      ++counters_.no_fixes;
      break;
    case FixTrack::Verdict::kInvalid:
    case FixTrack::Verdict::kOutOfOrder:
      ++counters_.invalid_fixes;
      break;
    case FixTrack::Verdict::kJump:
      ++counters_.jumps;
      break;
    case FixTrack::Verdict::kBadStamp:
      ++counters_.fixes_bad_stamp;
      break;
  }
}

void HazardReporter::AddPose(std::int64_t stamp_ns, const geo::TrackPose& pose,
                             std::int64_t now_ns) {
  ++counters_.poses;
  if (!vehicle_poses_.AddPose(stamp_ns, pose, now_ns)) ++counters_.invalid_poses;
}

void HazardReporter::StartAnew(double now_s, double steady_s) {
  Finish(steady_s);
  passes_.Reset();
  depths_.clear();
  vehicle_poses_.Reset();
  forgot_s_ = now_s;
}

void HazardReporter::Finish(double steady_s) {
  for (WaitingFrame& waiting : waiting_) {
    // Nothing of its moment can come any more.
    if (!waiting.placed) Place(waiting, kForEverS);
    ReportCandidates(waiting, waiting.arrival_s, steady_s);
  }
  waiting_.clear();
  // Pictures that are not there yet do not come any more.
  for (WaitingFrame& view : settling_.TakeAll()) ReportSettledView(view, steady_s);
  newest_frame_ns_ = newest_empty_ns_ = 0;
  picture_orders_.clear();
}

bool HazardReporter::IsUsable(const placement::Sighting& sighting) {
  if (!placement::IsWellFormed(sighting)) {
    ++counters_.invalid_detections;
    return false;
  }
  if (sighting.confidence < config_.min_confidence) {
    ++counters_.below_confidence;
    return false;
  }
  return true;
}

void HazardReporter::AddFrame(const placement::SightingFrame& frame, double now_s) {
  counters_.detections += frame.sightings.size();
  WaitingFrame waiting;
  waiting.frame = frame;
  waiting.arrival_s = now_s;
  auto& sightings = waiting.frame.sightings;
  sightings.erase(
      std::remove_if(sightings.begin(), sightings.end(),
                     [this](const placement::Sighting& sighting) { return !IsUsable(sighting); }),
      sightings.end());
  if (sightings.empty()) {
    newest_empty_ns_ = frame.stamp_ns;
    return;
  }
  waiting_.push_back(std::move(waiting));
  while (waiting_.size() > static_cast<std::size_t>(config_.max_waiting_frames)) {
    counters_.dropped_no_fix += waiting_.front().frame.sightings.size();
    waiting_.pop_front();
  }
}

const placement::SightingFrame* HazardReporter::FrameWithoutImage(std::int64_t stamp_ns) const {
  const auto waiting =
      std::find_if(waiting_.begin(), waiting_.end(), [stamp_ns](const WaitingFrame& each) {
        return each.frame.stamp_ns == stamp_ns && each.image.IsMissing();
      });
  return waiting == waiting_.end() ? nullptr : &waiting->frame;
}

void HazardReporter::AddImage(std::int64_t stamp_ns, const CameraImage& image) {
  for (WaitingFrame& waiting : waiting_) {
    if (waiting.frame.stamp_ns == stamp_ns && waiting.image.IsMissing()) waiting.image = image;
  }
}

void HazardReporter::AddDepth(std::int64_t stamp_ns, const placement::DepthImage& depth) {
  if (!depths_.empty() && IsSetBack(stamp_ns, depths_.rbegin()->first)) depths_.clear();
  depths_[stamp_ns] = depth;
  if (depths_.size() > static_cast<std::size_t>(config_.depth_images)) {
    depths_.erase(depths_.begin());
  }
}

void HazardReporter::Process(double now_s, double steady_s) {
  ApplyNotices();
  ApplyCellNews(steady_s);
  ForgetWhatNobodyTells(now_s);
  while (!waiting_.empty() && Advance(waiting_.front(), now_s, steady_s)) waiting_.pop_front();
  // All of them, so that none waits for its picture only after the one before it has waited.
  for (auto waiting = waiting_.begin(); waiting != waiting_.end(); ++waiting) {
    if (waiting->order != 0) continue;
    if (IsPlaced(*waiting, now_s) && HasUnknownHazard(*waiting) &&
        !IsCoveredByEarlierFrame(waiting)) {
      OrderPictures(*waiting);
    }
  }
  ReportSettled(now_s, steady_s);
}

/// Whether the frames before it will have reported all that it shows. While pictures are late many
/// frames wait, and each is compared with all before it.
bool HazardReporter::IsCoveredByEarlierFrame(
    std::deque<WaitingFrame>::const_iterator waiting) const {
  const auto will_be_known = [&](const PlacedSighting& candidate) {
    const std::string& name = candidate.sighting.class_name;
    const double radius_m = catalogue_.Get(name).duplicate_radius_m;
    const auto is_same = [&](const PlacedSighting& other) {
      return (candidate.earth_m - other.earth_m).squaredNorm() <= radius_m * radius_m &&
             name == other.sighting.class_name;
    };
    return std::any_of(waiting_.begin(), waiting, [&](const WaitingFrame& earlier) {
      return std::any_of(earlier.candidates.begin(), earlier.candidates.end(), is_same);
    });
  };
  return std::all_of(waiting->candidates.begin(), waiting->candidates.end(), will_be_known);
}

bool HazardReporter::IsPlaced(WaitingFrame& waiting, double now_s) {
  // A clock that was set back must not make a frame wait for ever.
  waiting.arrival_s = std::min(waiting.arrival_s, now_s);
  return waiting.placed || Place(waiting, now_s - waiting.arrival_s);
}

bool HazardReporter::IsKnown(const PlacedSighting& candidate) const {
  return passes_.IsKnown(candidate.pass) ||
         map_.Find(candidate.sighting.class_name, candidate.place.position).has_value();
}

bool HazardReporter::HasUnknownHazard(const WaitingFrame& waiting) const {
  return std::any_of(waiting.candidates.begin(), waiting.candidates.end(),
                     [this](const PlacedSighting& candidate) { return !IsKnown(candidate); });
}

/// True when the frame is done, whatever became of it.
bool HazardReporter::Advance(WaitingFrame& waiting, double now_s, double steady_s) {
  if (!IsPlaced(waiting, now_s)) return false;
  if (HasUnknownHazard(waiting) && WaitsForPicture(waiting, now_s)) return false;
  ReportCandidates(waiting, now_s, steady_s);
  return true;
}

/// One picture for each candidate that is to be reported now; the whole of an image that is not of
/// the frame's size.
void HazardReporter::OrderPictures(WaitingFrame& waiting) {
  if (waiting.order != 0 || waiting.image.IsMissing()) return;
  const bool fits = HasSizeOfFrame(waiting);
  PictureOrder order;
  for (PlacedSighting& candidate : waiting.candidates) {
    if (IsKnown(candidate) || settling_.HasToWait(candidate)) continue;
    candidate.cut = order.cuts.size();
    const placement::Sighting& sighting = candidate.sighting;
    order.cuts.push_back({fits ? sighting.box : imaging::Box{}, config_.picture,
                          imaging::MarkLabel(sighting.class_name, sighting.confidence)});
  }
  if (order.cuts.empty()) return;
  order.number = waiting.order = ++last_order_;
  order.image = waiting.image;
  picture_orders_.push_back(std::move(order));
  ++counters_.pictures_requested;
}

bool HazardReporter::HasSizeOfFrame(const WaitingFrame& waiting) {
  const cv::Mat& bgr = waiting.image.picture.bgr;
  return bgr.cols == static_cast<int>(waiting.frame.image_width) &&
         bgr.rows == static_cast<int>(waiting.frame.image_height);
}

bool HazardReporter::WaitsForPicture(WaitingFrame& waiting, double now_s) {
  if (waiting.pictures) return false;
  OrderPictures(waiting);
  if (waiting.order != 0) return true;
  return waiting.image.IsMissing() && now_s - waiting.arrival_s < config_.image_wait_s;
}

std::vector<PictureOrder> HazardReporter::TakePictureOrders() {
  return std::exchange(picture_orders_, {});
}

void HazardReporter::AddPictures(std::uint64_t order,
                                 std::vector<imaging::CroppedPicture> pictures) {
  for (WaitingFrame& waiting : waiting_) {
    if (waiting.order != order) continue;
    waiting.pictures = std::move(pictures);
    return;
  }
  settling_.AddPictures(order, pictures);
}

bool HazardReporter::FitsCamera(const placement::SightingFrame& frame) const {
  return intrinsics_ && HasMounting(frame.frame_id) &&
         static_cast<std::uint32_t>(intrinsics_->width) == frame.image_width &&
         static_cast<std::uint32_t>(intrinsics_->height) == frame.image_height;
}

/// Places the frame's sightings as soon as camera and position are known; false while they may yet
/// come. A frame for which they never come ends up placed, without candidates.
bool HazardReporter::Place(WaitingFrame& waiting, double waited_s) {
  const std::size_t count = waiting.frame.sightings.size();
  if (!FitsCamera(waiting.frame)) {
    if (waited_s < config_.max_wait_s) return false;
    counters_.dropped_no_camera += count;
    waiting.placed = true;
    return true;
  }
  if (WaitsForDepth(waiting, waited_s)) return false;
  const VehiclePoseLookup::Lookup lookup = vehicle_poses_.At(waiting.frame.stamp_ns, waited_s);
  if (lookup.answer == VehiclePoseLookup::Answer::kReady) {
    PlaceSightings(waiting, lookup.base, lookup.fused);
    return true;
  }
  if (lookup.unknown && !waiting.held_back) {
    counters_.held_back_no_fix += count;
    waiting.held_back = true;
  }
  if (lookup.answer == VehiclePoseLookup::Answer::kWait) return false;
  counters_.dropped_no_fix += count;
  waiting.placed = true;
  return true;
}

bool HazardReporter::WaitsForDepth(const WaitingFrame& waiting, double waited_s) const {
  return config_.use_depth && waited_s < config_.depth_wait_s &&
         depths_.count(waiting.frame.stamp_ns) == 0;
}

/// What the image says of where the sighting's foot is; counted where that is nowhere on the road.
std::optional<placement::HazardSight> HazardReporter::SightOnRoad(
    const placement::SightingFrame& frame, const placement::Sighting& sighting,
    const geo::TrackPose& base, bool fused) {
  placement::HazardSight sight;
  sight.stamp_ns = frame.stamp_ns;
  sight.base = base;
  if (!fused) {
    sight.own_position_sigma_m = config_.track.course_noise_m;
    sight.own_heading_share = kFixHeadingOwnShare;
  }
  sight.pixel = placement::ContactPixel(sighting.box);
  sight.intrinsics = *intrinsics_;
  sight.base_from_optical = mountings_.at(frame.frame_id);
  sight.noise = config_.projection;
  std::optional<geo::GroundPoint> ground;
  const auto depth = depths_.find(frame.stamp_ns);
  if (config_.use_depth && depth != depths_.end()) {
    ground = placement::ContactByDepth(depth->second, sighting.box, *intrinsics_,
                                       sight.base_from_optical, config_.projection, config_.depth);
    if (ground) {
      sight.depth_sigma_share = config_.depth.sigma_share;
      ++counters_.distances_by_depth;
    }
  }
  if (!ground && placement::IsCutBySide(sighting.box, intrinsics_->width)) {
    ++counters_.cut_by_side;
    return std::nullopt;
  }
  if (!ground) {
    ground = geo::ProjectToGround(sight.pixel, *intrinsics_, sight.base_from_optical,
                                  config_.projection);
  }
  if (!ground) {
    ++counters_.not_on_ground;
    return std::nullopt;
  }
  sight.foot = *ground;
  return sight;
}

/// A heading that is hardly known makes none, whatever it comes from: it would put one thing in
/// several places.
bool HazardReporter::IsWorthASight(const placement::HazardSight& sight) const {
  return placement::IsNearEnough(sight.foot, sight.base.course_variance_rad2,
                                 kSightReach * config_.max_range_m,
                                 kSightReach * config_.max_ground_sigma_m);
}

/// All sights help the places of what the vehicle passes; those that are near enough may be
/// reported.
void HazardReporter::PlaceSightings(WaitingFrame& waiting, const geo::TrackPose& base, bool fused) {
  waiting.placed = true;
  std::vector<PassSights::Seen> seen;
  std::vector<const placement::Sighting*> sightings;
  for (const placement::Sighting& sighting : waiting.frame.sightings) {
    const auto sight = SightOnRoad(waiting.frame, sighting, base, fused);
    if (!sight) continue;
    if (!IsWorthASight(*sight)) {
      ++counters_.too_far;
      continue;
    }
    seen.push_back({sighting.class_name, *sight});
    sightings.push_back(&sighting);
  }
  const std::vector<PassSights::Id> passes = passes_.Add(seen);
  // Where fused poses are to come, fixes stand in for a while: what they place badly can wait.
  const bool heading_counts = config_.position_source == PositionSource::kFused;
  const double reach = heading_counts && !fused ? kStandInReach : 1;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const placement::HazardSight& sight = seen[i].sight;
    if (!placement::IsNearEnough(sight.foot, heading_counts ? base.course_variance_rad2 : 0.0,
                                 config_.max_range_m, reach * config_.max_ground_sigma_m)) {
      ++counters_.too_far;
      continue;
    }
    const auto all = passes_.Place(passes[i]);
    const placement::PlacedHazard foot =
        all ? all->place : placement::PlaceHazard(base, Eigen::Vector2d::Zero(), sight.foot);
    const placement::PlacedHazard place =
        placement::MiddleOf(foot, base.position, catalogue_.Get(seen[i].class_name).half_depth_m);
    waiting.candidates.push_back({*sightings[i], place, geo::EarthCentred(place.position),
                                  std::nullopt, passes[i], all ? all->sights : 1});
    ++(fused ? counters_.placed_by_fusion : counters_.placed_by_fixes);
  }
}

void HazardReporter::AddNotice(const protocol::Notice& notice) {
  ++counters_.notices;
  notices_.push_back(notice);
  if (notices_.size() > kMaxWaitingNotices) notices_.pop_front();
}

void HazardReporter::AddReceipt(const protocol::Receipt& receipt) {
  try {
    if (!map_.Apply(receipt)) return;
  } catch (const StoreError& error) {
    // The report stays unfinished and is sent again; so the zone answers again.
    TellStoreError(error);
    return;
  }
  schedule_.Remove(receipt.report_uuid);
  ++(receipt.status == protocol::Receipt::Status::kCommitted ? counters_.committed
                                                             : counters_.refused);
}

void HazardReporter::ApplyNotices() {
  if (notices_.empty()) return;
  try {
    counters_.invalid_notices += map_.Apply({notices_.begin(), notices_.end()});
    notices_.clear();
    store_error_.clear();
  } catch (const StoreError& error) {
    TellStoreError(error);  // They stay and are tried again.
  }
}

void HazardReporter::AddCellNews(const protocol::CellNews& news) {
  cell_news_.push_back(news);
  if (cell_news_.size() > kMaxWaitingCellNews) cell_news_.pop_front();
}

void HazardReporter::ApplyCellNews(double steady_s) {
  try {
    for (; !cell_news_.empty(); cell_news_.pop_front()) {
      const protocol::CellNews& news = cell_news_.front();
      if (news.cells.empty()) cells_.AskAgain(news.zone);
      const LocalHazardMap::CellUse use = map_.Apply(news);
      counters_.invalid_notices += use.unusable;
      counters_.cell_answers += use.known.size();
      for (const geo::MapCell& cell : use.known) cells_.NoteAnswer(news.zone, cell, steady_s);
    }
  } catch (const StoreError& error) {
    TellStoreError(error);  // It stays and is tried again.
  }
}

std::vector<protocol::CellRequest> HazardReporter::TakeCellRequests(double steady_s) {
  auto requests = cells_.TakeDue(steady_s, [this](const std::string& zone,
                                                  const geo::MapCell& cell) {
    return CellFollower::Knowledge{map_.cell_sequence(zone, cell), map_.has_cell_gap(zone, cell)};
  });
  for (const protocol::CellRequest& request : requests) {
    counters_.cell_requests += request.cells.size();
  }
  return requests;
}

/// Once a minute of the stamps' clock.
void HazardReporter::ForgetWhatNobodyTells(double now_s) {
  constexpr double kPeriodS = 60.0;
  if (forgot_s_ && now_s >= *forgot_s_ && now_s - *forgot_s_ < kPeriodS) return;
  forgot_s_ = now_s;
  try {
    counters_.forgotten_unannounced +=
        map_.ForgetUnannounced(static_cast<std::int64_t>(now_s * 1e9));
    if (zones_.is_gone) map_.ForgetZones(zones_.is_gone);
  } catch (const StoreError& error) {
    TellStoreError(error);
  }
}

bool HazardReporter::IsCheap(double steady_s) const {
  if (link_ != LinkCost::kUnknown) return link_ == LinkCost::kCheap;
  const bool waits = held_at_start_ && steady_s - start_steady_s_ < config_.link_wait_s;
  return config_.unknown_link_is_cheap && !waits;
}

/// How long a report of this rank may wait for a cheap link.
double HazardReporter::HoldS(int urgency) const {
  const int rank = std::clamp(urgency, 1, static_cast<int>(config_.hold_s.size()));
  return config_.hold_s[static_cast<std::size_t>(rank - 1)];
}

std::int64_t HazardReporter::UtcNs(double steady_s) const {
  return start_ns_ + Nanoseconds(steady_s - start_steady_s_);
}

protocol::Report HazardReporter::MakeReport(WaitingFrame& waiting, std::size_t index) {
  const PlacedSighting& candidate = waiting.candidates[index];
  protocol::Report report;
  report.uuid = Uuid::Random(random_);
  report.drive_id = config_.drive_id;
  report.stamp_ns = waiting.frame.stamp_ns;
  report.class_name = candidate.sighting.class_name;
  report.confidence = candidate.sighting.confidence;
  report.box = candidate.sighting.box;
  report.position = candidate.place.position;
  report.covariance_m2 = candidate.place.covariance_m2;
  counters_.sights_used += candidate.sights;
  report.image_width = waiting.frame.image_width;
  report.image_height = waiting.frame.image_height;
  report.image_frame_id = waiting.frame.frame_id;
  if (zones_.zone_at) report.zone = zones_.zone_at(report.position);
  AttachPicture(waiting, index, report);
  return report;
}

/// What the candidate's order was answered with, if it has one: what may leave the vehicle.
void HazardReporter::AttachPicture(WaitingFrame& waiting, std::size_t index,
                                   protocol::Report& report) {
  const std::optional<std::size_t>& cut = waiting.candidates[index].cut;
  if (!waiting.pictures || !cut || *cut >= waiting.pictures->size()) return;
  imaging::CroppedPicture& cropped = (*waiting.pictures)[*cut];
  if (cropped.jpeg.empty()) return;
  if (!cropped.legible) ++counters_.pictures_illegible;
  report.image_format = "jpeg";
  report.image = std::move(cropped.jpeg);
  if (HasSizeOfFrame(waiting)) report.shown = cropped.shown;
}

void HazardReporter::ReportCandidates(WaitingFrame& waiting, double now_s, double steady_s) {
  for (std::size_t index = 0; index < waiting.candidates.size(); ++index) {
    const PlacedSighting& candidate = waiting.candidates[index];
    if (IsKnown(candidate)) {
      ++counters_.duplicates_suppressed;
      continue;
    }
    if (settling_.HasToWait(candidate)) {
      const bool is_new = settling_.Add(waiting, index, passes_, now_s, steady_s);
      if (!is_new) ++counters_.duplicates_suppressed;
      continue;
    }
    AddReport(MakeReport(waiting, index), candidate.pass, steady_s);
  }
  newest_frame_ns_ = waiting.frame.stamp_ns;
}

/// Up to when images have been looked through.
std::int64_t HazardReporter::ShownNs() const {
  // What was seen before the empty frame may still wait for its position.
  const bool is_empty_looked_through =
      waiting_.empty() || waiting_.front().frame.stamp_ns > newest_empty_ns_;
  return is_empty_looked_through ? std::max(newest_frame_ns_, newest_empty_ns_) : newest_frame_ns_;
}

/// Reports what has had its further sights, once its picture is there.
void HazardReporter::ReportSettled(double now_s, double steady_s) {
  settling_.WorkOff(passes_, ShownNs(), now_s, steady_s, [&](WaitingFrame& view) {
    if (WaitsForPicture(view, now_s)) return false;
    ReportSettledView(view, steady_s);
    return true;
  });
}

void HazardReporter::ReportSettledView(WaitingFrame& view, double steady_s) {
  const PassSights::Id pass = view.candidates.front().pass;
  if (IsKnown(view.candidates.front())) {  // The zone has told it meanwhile.
    ++counters_.duplicates_suppressed;
    return;
  }
  AddReport(MakeReport(view, 0), pass, steady_s);
}

void HazardReporter::AddReport(const protocol::Report& report, PassSights::Id pass,
                               double steady_s) {
  const int urgency = catalogue_.Get(report.class_name).urgency;
  const double hold_until_s = steady_s + HoldS(urgency);
  try {
    switch (map_.Add(report, UtcNs(hold_until_s))) {
      case LocalHazardMap::AddResult::kAdded:
        break;
      case LocalHazardMap::AddResult::kDuplicate:
        ++counters_.duplicates_suppressed;
        return;
      case LocalHazardMap::AddResult::kFull:
        ++counters_.refused_map_full;
        return;
    }
    store_error_.clear();
  } catch (const StoreError& error) {
    TellStoreError(error);  // Not known either: the next sight of it tries again.
    return;
  }
  passes_.MarkKnown(pass);
  ++counters_.reports_created;
  if (report.image.empty()) ++counters_.reports_without_picture;
  schedule_.Add(report.uuid, urgency, report.stamp_ns, steady_s, hold_until_s);
}

std::vector<protocol::Report> HazardReporter::TakeDue(double steady_s, std::size_t limit) {
  std::vector<protocol::Report> reports;
  schedule_.SetCheapLink(IsCheap(steady_s));
  try {
    for (const Uuid& uuid : schedule_.TakeDue(steady_s, limit)) {
      auto report = LoadToSend(uuid);
      if (!report) continue;
      if (schedule_.WasSent(uuid)) {
        ++counters_.resends;
      } else {
        map_.MarkSent(uuid);
        schedule_.MarkSent(uuid);
        ++counters_.reports_sent;
      }
      reports.push_back(std::move(*report));
    }
  } catch (const StoreError& error) {
    TellStoreError(error);
  }
  return reports;
}

/// The report, given anew to a zone where its own is gone.
std::optional<protocol::Report> HazardReporter::LoadToSend(const Uuid& uuid) {
  auto report = map_.LoadPending(uuid);
  if (!report) return report;
  std::string zone = zones_.Redirect(report->zone, report->position);
  if (zone.empty()) zone = config_.map.zone;
  if (zone == report->zone) return report;
  map_.GiveZone(uuid, zone);
  ++counters_.redirected;
  report->zone = std::move(zone);
  return report;
}

void HazardReporter::TellStoreError(const StoreError& error) {
  ++counters_.store_errors;
  store_error_ = error.what();
}

}  // namespace livemap::vehicle
