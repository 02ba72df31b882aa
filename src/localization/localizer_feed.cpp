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
      on_fix_(std::move(on_fix)),
      fixes_(config.stamps),
      odometry_(config.stamps) {}

template <class T>
void LocalizerFeed::Line<T>::Push(const T& what, double steady_s) {
  for (const T& stray : strays) waiting.push_back({stray, steady_s});
  strays.clear();
  waiting.push_back({what, steady_s});
  newest_ns = what.stamp_ns;
}

/// Strays are kept in the line until they are confirmed or contradicted.
template <class T>
StampGate::Verdict LocalizerFeed::Judge(Line<T>& line, const T& what, std::int64_t now_ns) {
  const StampGate::Verdict verdict = line.stamps.Judge(what.stamp_ns, now_ns);
  if (verdict == StampGate::Verdict::kStray) {
    if (line.stamps.strays() == 1) line.strays.clear();
    line.strays.push_back(what);
    return verdict;
  }
  const bool confirms =
      !line.strays.empty() && line.strays.back().stamp_ns < what.stamp_ns &&
      Seconds(what.stamp_ns - line.strays.back().stamp_ns) <= config_.stamps.max_step_s;
  if (!confirms) line.strays.clear();
  return verdict;
}

template <class T>
void LocalizerFeed::LeaveBehind(Line<T>& other, std::int64_t stamp_ns) {
  const std::int64_t last_ns = stamp_ns + Nanoseconds(config_.stamps.set_back_s);
  if (other.newest_ns > last_ns) other.newest_ns = 0;
  while (!other.waiting.empty() && other.waiting.back().what.stamp_ns > last_ns) {
    other.waiting.pop_back();
  }
}

void LocalizerFeed::AddFix(const geo::Fix& fix, double steady_s, std::int64_t now_ns) {
  using Verdict = StampGate::Verdict;
  const Verdict verdict = Judge(fixes_, fix, now_ns);
  // It is counted as what it is.
  if (verdict == Verdict::kLate || fix.stamp_ns <= 0) return Hand(fix);
  if (!StampGate::IsUsable(verdict)) return;
  if (verdict == Verdict::kRestarted) {
    LeaveBehind(fixes_, fix.stamp_ns);
    LeaveBehind(odometry_, fix.stamp_ns);
  }
  fixes_.Push(fix, steady_s);
  Advance(steady_s);
}

bool LocalizerFeed::AddOdometry(const OdometrySample& sample, double steady_s,
                                std::int64_t now_ns) {
  using Verdict = StampGate::Verdict;
  const Verdict verdict = Judge(odometry_, sample, now_ns);
  if (verdict == Verdict::kLate || sample.stamp_ns <= 0) Hand(sample);
  if (verdict == Verdict::kLate || !StampGate::IsUsable(verdict)) return false;
  const bool anew = verdict == Verdict::kRestarted;
  if (anew) {
    odometry_.waiting.clear();
    LeaveBehind(fixes_, sample.stamp_ns);
    localizer_.Forget();
  }
  odometry_.Push(sample, steady_s);
  Advance(steady_s);
  return anew;
}

void LocalizerFeed::Advance(double steady_s) {
  while (HandNext(steady_s)) {
  }
}

/// The next in the order of stamps; a fix before the odometry of the same moment. False when it
/// must wait.
bool LocalizerFeed::HandNext(double steady_s) {
  const auto is_due = [&](const auto& waiting, std::int64_t other_ns) {
    return waiting.size() > kMaxWaiting || waiting.front().what.stamp_ns <= other_ns ||
           steady_s - waiting.front().arrival_s >= config_.order_wait_s;
  };
  auto& fixes = fixes_.waiting;
  auto& odometry = odometry_.waiting;
  const bool fix_next = !fixes.empty() && (odometry.empty() || fixes.front().what.stamp_ns <=
                                                                   odometry.front().what.stamp_ns);
  if (fix_next) {
    if (!is_due(fixes, odometry_.newest_ns)) return false;
    const geo::Fix fix = fixes.front().what;
    fixes.pop_front();
    Hand(fix);
    return true;
  }
  if (odometry.empty() || !is_due(odometry, fixes_.newest_ns)) return false;
  const OdometrySample sample = odometry.front().what;
  odometry.pop_front();
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
