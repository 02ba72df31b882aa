#include "odometry/monocular/vehicle_speed.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "common/time.h"
#include "geo/fix_plausibility.h"
#include "geo/wgs84.h"

namespace livemap::odometry {
namespace {

constexpr std::size_t kSpeedsKept = 100;
/// Over less than this share of the wanted time two fixes tell no speed.
constexpr double kLeastShareOfSpan = 0.5;

}  // namespace

const char* MetresSourceName(MetresSource source) {
  switch (source) {
    case MetresSource::kWheels:
      return "wheels";
    case MetresSource::kReceiver:
      return "receiver";
    case MetresSource::kFixes:
      return "fixes";
    case MetresSource::kHeight:
      return "height";
    case MetresSource::kNone:
      return "none";
  }
  return "";
}

bool VehicleSpeed::AddSpeed(MetresSource source, std::int64_t stamp_ns, double mps,
                            double sigma_mps) {
  Samples& samples = source == MetresSource::kWheels ? wheels_ : receiver_;
  // Written so that NaN is refused.
  if (!(std::abs(mps) <= config_.max_speed_mps && sigma_mps >= 0)) return false;
  if (!(sigma_mps <= config_.max_speed_mps)) return false;
  if (!samples.empty() && stamp_ns <= samples.back().stamp_ns) return false;
  samples.push_back({stamp_ns, std::abs(mps), std::max(sigma_mps, config_.min_sigma_mps)});
  if (samples.size() > kSpeedsKept) samples.pop_front();
  return true;
}

bool VehicleSpeed::AddFix(const geo::Fix& fix) {
  if (!fix.has_fix || !geo::IsPlausible(fix)) return false;
  if (!fixes_.empty() && fix.stamp_ns <= fixes_.back().stamp_ns) return false;
  fixes_.push_back(fix);
  while (Seconds(fix.stamp_ns - fixes_.front().stamp_ns) > config_.fix_span_s) fixes_.pop_front();
  AddSpeedOfFixes();
  return true;
}

/// By the way between the oldest and the newest fix: the speed of the moment between them.
void VehicleSpeed::AddSpeedOfFixes() {
  const geo::Fix &from = fixes_.front(), &to = fixes_.back();
  const double span_s = Seconds(to.stamp_ns - from.stamp_ns);
  if (span_s < kLeastShareOfSpan * config_.fix_span_s) return;
  const geo::LocalFrame frame(from.position);
  const Eigen::Vector2d way = frame.ToEnu(to.position);
  const double mps = way.norm() / span_s;
  if (!(mps <= config_.max_speed_mps)) return;
  const Eigen::Matrix2d covariance = geo::CovarianceOf(from, config_.default_fix_sigma_m) +
                                     geo::CovarianceOf(to, config_.default_fix_sigma_m);
  const double variance = 0.5 * covariance.trace() / (span_s * span_s);
  by_fixes_.push_back({from.stamp_ns + (to.stamp_ns - from.stamp_ns) / 2, mps,
                       std::max(std::sqrt(variance), config_.min_sigma_mps)});
  if (by_fixes_.size() > kSpeedsKept) by_fixes_.pop_front();
}

void VehicleSpeed::Reset() {
  wheels_.clear();
  receiver_.clear();
  by_fixes_.clear();
  fixes_.clear();
}

/// Between two speeds, or the last one with what the vehicle may have done since.
std::optional<VehicleSpeed::Speed> VehicleSpeed::Of(const Samples& samples, MetresSource source,
                                                    std::int64_t stamp_ns) const {
  const auto after = std::lower_bound(
      samples.begin(), samples.end(), stamp_ns,
      [](const Sample& sample, std::int64_t stamp) { return sample.stamp_ns < stamp; });
  // A speed by fixes is of the middle of its time, and so always late.
  const double max_age_s =
      config_.max_age_s + (source == MetresSource::kFixes ? config_.fix_span_s / 2 : 0);
  if (after != samples.end() && after != samples.begin()) {
    const Sample &one = *std::prev(after), &other = *after;
    const double gap_s = Seconds(other.stamp_ns - one.stamp_ns);
    if (gap_s > 2 * max_age_s) return std::nullopt;
    const double share = Seconds(stamp_ns - one.stamp_ns) / gap_s;
    return Speed{one.mps + share * (other.mps - one.mps), std::max(one.sigma_mps, other.sigma_mps),
                 source};
  }
  if (samples.empty()) return std::nullopt;
  const Sample& nearest = after == samples.end() ? samples.back() : samples.front();
  const double age_s = std::abs(Seconds(stamp_ns - nearest.stamp_ns));
  if (age_s > max_age_s) return std::nullopt;
  return Speed{nearest.mps, std::hypot(nearest.sigma_mps, config_.acceleration_mps2 * age_s),
               source};
}

std::optional<VehicleSpeed::Speed> VehicleSpeed::At(std::int64_t stamp_ns) const {
  if (const auto speed = Of(wheels_, MetresSource::kWheels, stamp_ns)) return speed;
  if (const auto speed = Of(receiver_, MetresSource::kReceiver, stamp_ns)) return speed;
  return Of(by_fixes_, MetresSource::kFixes, stamp_ns);
}

}  // namespace livemap::odometry
