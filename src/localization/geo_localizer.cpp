#include "localization/geo_localizer.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/median.h"
#include "common/time.h"
#include "geo/datum.h"
#include "geo/fix_plausibility.h"
#include "localization/sliding_window.h"
#include "localization/track_alignment.h"

namespace livemap::localization {
namespace {

constexpr double kMinSigmaM = 1e-3;  // No receiver is better; keeps covariances invertible.
constexpr double kMaxShare = 0.8;    // Of a fix's sigma that may be the shared error.
constexpr double kMaxWaitS = 5.0;    // For odometry.
constexpr std::size_t kMaxWaitingFixes = 256;
constexpr std::size_t kMaxKept = 1024;
constexpr double kStartTrackS = 3.0;  // Odometry kept beyond the window.
constexpr double kMedianSpanS = 2.0;  // Position of a standing vehicle: median of these fixes.

LocalizerConfig CheckedLocalizerConfig(const LocalizerConfig& config) {
  Check(config);
  return config;
}

DatumElection::Config FirstDatumConfig(const LocalizerConfig& config) {
  DatumElection::Config election;
  election.max_speed_mps = config.odometry.max_speed_mps;
  return election;
}

/// A datum that stands is given up less easily.
DatumElection::Config OtherDatumConfig(const LocalizerConfig& config) {
  DatumElection::Config election = FirstDatumConfig(config);
  election.min_span_s = config.restart_s;
  election.max_wait_s = std::numeric_limits<double>::infinity();
  return election;
}

}  // namespace

GeoLocalizer::GeoLocalizer(const LocalizerConfig& config)
    : config_(CheckedLocalizerConfig(config)),
      track_(config_.odometry, config_.max_extrapolation_s),
      window_(std::make_unique<SlidingWindow>(config_)),
      first_datum_(FirstDatumConfig(config_)),
      other_datum_(OtherDatumConfig(config_)) {
  if (config_.datum) frame_.emplace(*config_.datum);
}

GeoLocalizer::~GeoLocalizer() = default;

double GeoLocalizer::odometry_scale() const { return 1 + window_->calibration()[1]; }

double GeoLocalizer::yaw_bias_rps() const { return window_->calibration()[2]; }

std::size_t GeoLocalizer::window_nodes() const { return window_->nodes(); }

double GeoLocalizer::widening() const { return window_->widening(); }

OdometryTrack::Verdict GeoLocalizer::AddOdometry(
    std::int64_t stamp_ns, const Eigen::Isometry3d& odom_from_base,
    const std::optional<Eigen::Matrix3d>& increment_covariance) {
  return Advance(stamp_ns,
                 [&] { return track_.Add(stamp_ns, odom_from_base, increment_covariance); });
}

OdometryTrack::Verdict GeoLocalizer::AddLostOdometry(std::int64_t stamp_ns,
                                                     const Eigen::Isometry3d& odom_from_base) {
  return Advance(stamp_ns, [&] { return track_.AddLost(stamp_ns, odom_from_base); });
}

OdometryTrack::Verdict GeoLocalizer::Advance(std::int64_t stamp_ns,
                                             const std::function<OdometryTrack::Verdict()>& add) {
  using Verdict = OdometryTrack::Verdict;
  Verdict verdict = add();
  if (verdict == Verdict::kOutOfOrder &&
      Seconds(track_.newest_ns() - stamp_ns) > config_.window_s) {
    // The clock was set back (a bag starts again): nothing of before can be compared.
    Forget();
    verdict = add();
  }
  if (verdict == Verdict::kInvalid) ++counters_.odometry_invalid;
  if (verdict == Verdict::kOutOfOrder) ++counters_.odometry_out_of_order;
  if (verdict == Verdict::kReset) ++counters_.odometry_resets;
  if (verdict == Verdict::kAccepted || verdict == Verdict::kReset) {
    KeepTrackOfTime(stamp_ns);
    ProcessWaiting();
  }
  return verdict;
}

/// Lets the window slide on without fixes, and forgets old odometry.
void GeoLocalizer::KeepTrackOfTime(std::int64_t stamp_ns) {
  if (window_->empty()) {
    track_.ForgetBefore(stamp_ns - Nanoseconds(config_.window_s + kStartTrackS));
    return;
  }
  // Half of the spacing stays free for fixes that come late.
  const std::int64_t idle_ns = stamp_ns - Nanoseconds(config_.idle_spacing_s / 2);
  if (Seconds(idle_ns - window_->newest_ns()) >= config_.idle_spacing_s) {
    window_->AddNode(idle_ns, track_.Between(window_->newest_ns(), idle_ns));
    window_->Slide();
  }
  track_.ForgetBefore(window_->oldest_ns() - Nanoseconds(kStartTrackS));
}

void GeoLocalizer::Forget() {
  track_.Clear();
  window_->Clear();
  first_fixes_.clear();
  first_datum_.Reset();
  other_datum_.Reset();
  waiting_.clear();
  kept_.clear();
  newest_fix_ns_ = 0;
  last_used_ns_ = 0;
  ++counters_.clock_resets;
}

GeoLocalizer::FixVerdict GeoLocalizer::Count(FixVerdict verdict) {
  switch (verdict) {
    case FixVerdict::kUsed:
      ++counters_.fixes_used;
      break;
    case FixVerdict::kRefused:
      ++counters_.fixes_refused;
      break;
    case FixVerdict::kAbsent:
      ++counters_.fixes_absent;
      break;
    case FixVerdict::kInvalid:
      ++counters_.fixes_invalid;
      break;
    case FixVerdict::kOutOfOrder:
      ++counters_.fixes_out_of_order;
      break;
    case FixVerdict::kWithoutOdometry:
      ++counters_.fixes_without_odometry;
      break;
    case FixVerdict::kKept:
    case FixVerdict::kWaiting:
      break;
  }
  return verdict;
}

/// What the window thought better of.
void GeoLocalizer::CountSecondThoughts(std::uint64_t reinstated, std::uint64_t refused) {
  counters_.fixes_used += reinstated - refused;
  counters_.fixes_refused += refused - reinstated;
}

GeoLocalizer::FixVerdict GeoLocalizer::AddFix(const geo::Fix& fix) {
  if (!fix.has_fix) return Count(FixVerdict::kAbsent);
  if (!geo::IsPlausible(fix)) return Count(FixVerdict::kInvalid);
  if (fix.stamp_ns <= newest_fix_ns_) return Count(FixVerdict::kOutOfOrder);
  if (!frame_) ElectDatum(fix);
  if (frame_ && IsOffMap(fix)) return Count(FixVerdict::kInvalid);
  if (track_.empty() || fix.stamp_ns - Nanoseconds(window_->latency_s()) < track_.oldest_ns() ||
      Seconds(fix.stamp_ns - track_.newest_ns()) > kMaxWaitS) {
    return Count(FixVerdict::kWithoutOdometry);
  }
  newest_fix_ns_ = fix.stamp_ns;
  if (frame_ && first_fixes_.empty()) return Count(AddWithDatum(fix));
  first_fixes_.push_back(fix);
  if (frame_) return AddFirstFixes();
  if (first_fixes_.size() > kMaxWaitingFixes) first_fixes_.pop_front();
  return Count(FixVerdict::kWaiting);
}

void GeoLocalizer::ElectDatum(const geo::Fix& fix) {
  if (const auto datum = first_datum_.Add(ToPoint(fix))) frame_.emplace(*datum);
}

/// Whether the map's plane does not reach there. When fixes agree for long that it should, the
/// datum was wrong: the map begins anew, unless a person has chosen it.
bool GeoLocalizer::IsOffMap(const geo::Fix& fix) {
  // The plane cannot tell the other side of the earth.
  if (geo::GeodesicDistanceM(frame_->datum(), fix.position) <= config_.max_range_m) {
    other_datum_.Reset();
    return false;
  }
  if (config_.datum) return true;
  const std::optional<geo::GeoPoint> datum = other_datum_.Add(ToPoint(fix));
  if (!datum) return true;
  window_->Clear();
  waiting_.clear();
  kept_.clear();
  other_datum_.Reset();
  frame_.emplace(*datum);
  ++counters_.datum_changes;
  return false;
}

GeoLocalizer::FixVerdict GeoLocalizer::AddWithDatum(const geo::Fix& fix) {
  const FixMeasurement measurement = ToMeasurement(fix);
  if (!waiting_.empty() || MomentOf(measurement) > track_.newest_ns()) {
    if (waiting_.size() >= kMaxWaitingFixes) return FixVerdict::kWithoutOdometry;
    waiting_.push_back(measurement);
    return FixVerdict::kWaiting;
  }
  return Process(measurement);
}

/// What waited for the datum; the verdict is that of the newest.
GeoLocalizer::FixVerdict GeoLocalizer::AddFirstFixes() {
  FixVerdict verdict = FixVerdict::kWaiting;
  for (; !first_fixes_.empty(); first_fixes_.pop_front()) {
    const geo::Fix& fix = first_fixes_.front();
    const bool forgotten = fix.stamp_ns - Nanoseconds(window_->latency_s()) < track_.oldest_ns();
    verdict = IsOffMap(fix) ? FixVerdict::kInvalid
              : forgotten   ? FixVerdict::kWithoutOdometry
                            : AddWithDatum(fix);
    Count(verdict);
  }
  return verdict;
}

void GeoLocalizer::ProcessWaiting() {
  while (!waiting_.empty() && MomentOf(waiting_.front()) <= track_.newest_ns()) {
    const FixMeasurement fix = waiting_.front();
    waiting_.pop_front();
    Count(Process(fix));
  }
}

std::int64_t GeoLocalizer::MomentOf(const FixMeasurement& fix) const {
  return fix.stamp_ns - Nanoseconds(window_->latency_s());
}

geo::ReceiverPoint GeoLocalizer::ToPoint(const geo::Fix& fix) const {
  const Eigen::Matrix2d covariance_m2 = geo::CovarianceOf(fix, config_.receiver.default_sigma_m);
  return {fix.stamp_ns, fix.position, std::sqrt(covariance_m2.trace() / 2)};
}

FixMeasurement GeoLocalizer::ToMeasurement(const geo::Fix& fix) const {
  Eigen::Matrix2d covariance_m2 = geo::CovarianceOf(fix, config_.receiver.default_sigma_m) +
                                  Eigen::Matrix2d::Identity() * kMinSigmaM * kMinSigmaM;
  FixMeasurement measurement;
  measurement.stamp_ns = fix.stamp_ns;
  measurement.place_m = frame_->ToEnu(fix.position);
  const Eigen::Matrix2d turn = Rotation2(geo::MeridianConvergence(*frame_, fix.position));
  covariance_m2 = turn * covariance_m2 * turn.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance_m2);
  const double believed_m = config_.receiver.min_sigma_m;
  if (believed_m > 0) {
    covariance_m2 = axes.eigenvectors() *
                    axes.eigenvalues().cwiseMax(believed_m * believed_m).asDiagonal() *
                    axes.eigenvectors().transpose();
  }
  const double min_variance = std::max(axes.eigenvalues().minCoeff(), believed_m * believed_m);
  measurement.shared_m =
      std::min(config_.receiver.shared_sigma_m, kMaxShare * std::sqrt(std::max(0.0, min_variance)));
  const Eigen::Matrix2d white_m2 =
      covariance_m2 - measurement.shared_m * measurement.shared_m * Eigen::Matrix2d::Identity();
  measurement.root_information = white_m2.inverse().llt().matrixU();
  return measurement;
}

GeoLocalizer::FixVerdict GeoLocalizer::Process(FixMeasurement fix) {
  if (window_->empty()) {
    Keep(fix, config_.window_s);
    return TryStart() ? FixVerdict::kUsed : FixVerdict::kKept;
  }
  const std::optional<double> distance = window_->Distance(fix, track_);
  if (!distance) return FixVerdict::kOutOfOrder;
  fix.used = *distance <= config_.gate;
  Keep(fix, config_.restart_s);
  return fix.used ? Use(fix) : Refuse(fix);
}

/// Stores a fix for a start.
void GeoLocalizer::Keep(const FixMeasurement& fix, double keep_s) {
  kept_.push_back(fix);
  const auto is_old = [&](const FixMeasurement& old) {
    return Seconds(fix.stamp_ns - old.stamp_ns) > keep_s || MomentOf(old) < track_.oldest_ns();
  };
  while (kept_.size() > kMaxKept || (kept_.size() > 1 && is_old(kept_.front()))) kept_.pop_front();
}

GeoLocalizer::FixVerdict GeoLocalizer::Refuse(const FixMeasurement& fix) {
  // When most are refused for long, it is the map that is wrong.
  const auto refused =
      std::count_if(kept_.begin(), kept_.end(), [](const auto& kept) { return !kept.used; });
  const bool long_enough =
      Seconds(fix.stamp_ns - kept_.front().stamp_ns) >= 0.8 * config_.restart_s;
  if (long_enough && 2 * static_cast<std::size_t>(refused) > kept_.size()) {
    const LocalizerCounters before = counters_;
    if (TryStart()) {
      // The others have been counted when they came.
      counters_ = before;
      ++counters_.restarts;
      return FixVerdict::kUsed;
    }
  }
  // In the window all the same: later fixes may prove it right.
  window_->AddFix(fix, track_);
  return FixVerdict::kRefused;
}

GeoLocalizer::FixVerdict GeoLocalizer::Use(const FixMeasurement& fix) {
  const std::int64_t moment_ns = MomentOf(fix);
  if (Seconds(moment_ns - window_->newest_ns()) >= config_.node_spacing_s) {
    window_->AddNode(moment_ns, track_.Between(window_->newest_ns(), moment_ns));
  }
  window_->AddFix(fix, track_);
  window_->Slide();
  const SlidingWindow::Counts counts = window_->Solve(track_);
  CountSecondThoughts(counts.reinstated, counts.refused);
  last_used_ns_ = moment_ns;
  return FixVerdict::kUsed;
}

/// Fixes the map by the kept fixes, when the vehicle has moved enough among them.
bool GeoLocalizer::TryStart() {
  std::vector<TrackPair> pairs;
  for (const FixMeasurement& fix : kept_) {
    const PlanarPose antenna = track_.At(MomentOf(fix)) * PlanarPose{config_.receiver.antenna_m, 0};
    // Of the whole error, the shared part included.
    const double white_variance = 1 / fix.root_information.determinant();
    pairs.push_back(
        {antenna.position_m, fix.place_m, std::sqrt(white_variance + fix.shared_m * fix.shared_m)});
  }
  const auto alignment =
      AlignTrack(pairs, config_.gate, static_cast<std::size_t>(config_.start_fixes));
  if (!alignment || alignment->yaw_sigma_rad > config_.start_yaw_sigma_rad) return false;
  const std::int64_t first_ns = MomentOf(kept_.front());
  window_->Start(first_ns, alignment->map_from_track * track_.At(first_ns), alignment->widening);
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    FixMeasurement fix = kept_[i];
    const std::int64_t moment_ns = MomentOf(fix);
    if (Seconds(moment_ns - window_->newest_ns()) >= config_.node_spacing_s) {
      window_->AddNode(moment_ns, track_.Between(window_->newest_ns(), moment_ns));
    }
    fix.used = alignment->agrees[i];
    window_->AddFix(fix, track_);
    if (fix.used) last_used_ns_ = moment_ns;
  }
  const std::size_t agreeing = static_cast<std::size_t>(
      std::count(alignment->agrees.begin(), alignment->agrees.end(), true));
  // The newest is counted by the caller.
  counters_.fixes_used += agreeing - 1;
  counters_.fixes_refused += kept_.size() - agreeing;
  kept_.clear();
  const SlidingWindow::Counts counts = window_->Solve(track_);
  CountSecondThoughts(counts.reinstated, counts.refused);
  window_->Slide();
  return true;
}

LocalizerState GeoLocalizer::StateAt(std::int64_t stamp_ns) const {
  if (window_->empty()) return LocalizerState::kUninitialised;
  return Seconds(stamp_ns - last_used_ns_) > config_.dead_reckoning_s
             ? LocalizerState::kDeadReckoning
             : LocalizerState::kOk;
}

LocalizerState GeoLocalizer::state() const {
  return track_.empty() ? LocalizerState::kUninitialised : StateAt(track_.newest_ns());
}

std::optional<FusedPose> GeoLocalizer::Fused(std::int64_t stamp_ns) const {
  if (window_->empty()) return PositionOnly(stamp_ns);
  const auto [node_ns, belief] = window_->Before(stamp_ns);
  if (node_ns > stamp_ns || !track_.Covers(stamp_ns)) return std::nullopt;
  const Belief now = window_->CarryOn(belief, track_.Between(node_ns, stamp_ns));
  FusedPose fused;
  fused.state = StateAt(stamp_ns);
  fused.map_from_base = {now.node.head<2>(), now.node[2]};
  fused.position = frame_->ToGeo(fused.map_from_base.position_m);
  const double convergence_rad = geo::MeridianConvergence(*frame_, fused.position);
  const Eigen::Matrix2d turn = Rotation2(-convergence_rad);
  fused.covariance_m2 = turn * now.covariance.topLeftCorner<2, 2>() * turn.transpose();
  constexpr double kQuarterTurn = 1.57079632679489661923;
  fused.heading_rad = WrapAngle(kQuarterTurn - (now.node[2] - convergence_rad));
  fused.heading_variance_rad2 = now.covariance(2, 2);
  fused.map_covariance = now.covariance.topLeftCorner<3, 3>();
  return fused;
}

/// What the newest fixes say of a vehicle that has not moved enough yet.
std::optional<FusedPose> GeoLocalizer::PositionOnly(std::int64_t stamp_ns) const {
  if (kept_.empty() || !track_.Covers(stamp_ns)) return std::nullopt;
  std::vector<double> east_m;
  std::vector<double> north_m;
  for (const FixMeasurement& fix : kept_) {
    if (Seconds(kept_.back().stamp_ns - fix.stamp_ns) > kMedianSpanS) continue;
    east_m.push_back(fix.place_m.x());
    north_m.push_back(fix.place_m.y());
  }
  const FixMeasurement& newest = kept_.back();
  const std::int64_t from_ns = std::max(MomentOf(newest), track_.oldest_ns());
  // It may have moved since, nobody knows which way.
  const double moved_m = (track_.At(stamp_ns).position_m - track_.At(from_ns).position_m).norm();
  const double spread_m = track_.VelocityAt(from_ns).norm() * kMedianSpanS;
  FusedPose fused;
  fused.map_from_base.position_m = {TakeMedian(east_m), TakeMedian(north_m)};
  fused.position = frame_->ToGeo(fused.map_from_base.position_m);
  const double convergence_rad = geo::MeridianConvergence(*frame_, fused.position);
  const Eigen::Matrix2d turn = Rotation2(-convergence_rad);
  const Eigen::Matrix2d white_m2 =
      (newest.root_information.transpose() * newest.root_information).inverse();
  fused.covariance_m2 =
      turn * white_m2 * turn.transpose() +
      (newest.shared_m * newest.shared_m + moved_m * moved_m + spread_m * spread_m) *
          Eigen::Matrix2d::Identity();
  fused.map_from_base.yaw_rad = std::numeric_limits<double>::quiet_NaN();
  return fused;
}

std::optional<Eigen::Isometry3d> GeoLocalizer::MapFromOdom() const {
  if (window_->empty()) return std::nullopt;
  const std::int64_t now_ns = track_.newest_ns();
  const auto [node_ns, belief] = window_->Before(now_ns);
  const Belief now = window_->CarryOn(belief, track_.Between(node_ns, now_ns));
  const PlanarPose map_from_base{now.node.head<2>(), now.node[2]};
  const PlanarPose map_from_odom = map_from_base * track_.newest_raw().Inverse();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear().topLeftCorner<2, 2>() = Rotation2(map_from_odom.yaw_rad);
  pose.translation().head<2>() = map_from_odom.position_m;
  return pose;
}

std::optional<geo::GeoPoint> GeoLocalizer::datum() const {
  if (!frame_) return std::nullopt;
  return frame_->datum();
}

LatencyEstimate GeoLocalizer::latency() const {
  LatencyEstimate estimate;
  estimate.value_s = window_->latency_s();
  estimate.sigma_s = config_.receiver.latency_sigma_s;
  if (!window_->empty()) {
    estimate.sigma_s = std::sqrt(window_->Newest().covariance(kNodeSize, kNodeSize));
  }
  estimate.observed = estimate.sigma_s < 0.5 * config_.receiver.latency_sigma_s;
  return estimate;
}

}  // namespace livemap::localization
