#include "localization/localizer_feed.h"

#include <algorithm>
#include <utility>

#include "common/time.h"

namespace livemap::localization {
namespace {

/// More never waits: the oldest is handed over.
constexpr std::size_t kMaxWaiting = 1000;

}  // namespace

LocalizerFeed::LocalizerFeed(const Config& config, GeoLocalizer& localizer, OnOdometry on_odometry,
                             OnFix on_fix)
    : config_(config),
      localizer_(localizer),
      on_odometry_(std::move(on_odometry)),
      on_fix_(std::move(on_fix)) {}

void LocalizerFeed::AddFix(const geo::Fix& fix, double steady_s) {
  if (IsSetBack(fix.stamp_ns, newest_fix_ns_)) {
    // What waits is counted as what it is, too.
    for (; !fixes_.empty(); fixes_.pop_front()) Hand(fixes_.front().what);
    newest_fix_ns_ = 0;
  }
  if (fix.stamp_ns <= newest_fix_ns_) return Hand(fix);  // It is counted as what it is.
  newest_fix_ns_ = fix.stamp_ns;
  fixes_.push_back({fix, steady_s});
  Advance(steady_s);
}

bool LocalizerFeed::AddOdometry(const OdometrySample& sample, double steady_s) {
  const bool anew = IsSetBack(sample.stamp_ns, newest_odometry_ns_);
  if (anew) {
    odometry_.clear();
    newest_odometry_ns_ = 0;
    localizer_.Forget();
  }
  if (sample.stamp_ns <= newest_odometry_ns_) {
    Hand(sample);
    return anew;
  }
  newest_odometry_ns_ = sample.stamp_ns;
  odometry_.push_back({sample, steady_s});
  Advance(steady_s);
  return anew;
}

void LocalizerFeed::Advance(double steady_s) {
  while (HandNext(steady_s)) {
  }
}

bool LocalizerFeed::IsSetBack(std::int64_t stamp_ns, std::int64_t newest_ns) const {
  // A stamp of nothing is a mistake, not a time.
  return stamp_ns > 0 && Seconds(newest_ns - stamp_ns) > config_.set_back_s;
}

/// The next in the order of stamps; a fix before the odometry of the same moment. False when it
/// must wait.
bool LocalizerFeed::HandNext(double steady_s) {
  const auto is_due = [&](const auto& line, std::int64_t other_ns) {
    return line.size() > kMaxWaiting || line.front().what.stamp_ns <= other_ns ||
           steady_s - line.front().arrival_s >= config_.order_wait_s;
  };
  const bool fix_next =
      !fixes_.empty() &&
      (odometry_.empty() || fixes_.front().what.stamp_ns <= odometry_.front().what.stamp_ns);
  if (fix_next) {
    if (!is_due(fixes_, newest_odometry_ns_)) return false;
    const geo::Fix fix = fixes_.front().what;
    fixes_.pop_front();
    Hand(fix);
    return true;
  }
  if (odometry_.empty() || !is_due(odometry_, newest_fix_ns_)) return false;
  const OdometrySample sample = odometry_.front().what;
  odometry_.pop_front();
  Hand(sample);
  return true;
}

void LocalizerFeed::Hand(const geo::Fix& fix) { on_fix_(fix, localizer_.AddFix(fix)); }

void LocalizerFeed::Hand(const OdometrySample& sample) {
  using Verdict = OdometryTrack::Verdict;
  const Verdict verdict = sample.lost
                              ? localizer_.AddLostOdometry(sample.stamp_ns, sample.odom_from_base)
                              : localizer_.AddOdometry(sample.stamp_ns, sample.odom_from_base,
                                                       sample.increment_covariance);
  if (verdict == Verdict::kAccepted || verdict == Verdict::kReset) on_odometry_(sample);
}

}  // namespace livemap::localization
