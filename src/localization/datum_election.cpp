#include "localization/datum_election.h"

#include <algorithm>

#include "common/time.h"

namespace livemap::localization {
namespace {

constexpr std::size_t kMaxCandidates = 64;

}  // namespace

std::optional<geo::GeoPoint> DatumElection::Add(const geo::ReceiverPoint& fix) {
  if (begun_ns_ == 0) begun_ns_ = fix.stamp_ns;
  if (!candidates_.empty()) {
    // The candidates that are kept must embrace the span.
    const double step_s = Seconds(fix.stamp_ns - candidates_.back().fix.stamp_ns);
    if (step_s <= 2 * config_.min_span_s / static_cast<double>(kMaxCandidates)) return std::nullopt;
  }
  if (candidates_.size() == kMaxCandidates) ForgetOldest();
  Candidate added{fix, 1};
  for (Candidate& each : candidates_) {
    if (!Agree(each, added)) continue;
    ++each.votes;
    ++added.votes;
  }
  candidates_.push_back(added);
  // Of equals the newest: it is the one that goes on.
  const auto winner =
      std::max_element(candidates_.rbegin(), candidates_.rend(),
                       [](const Candidate& a, const Candidate& b) { return a.votes < b.votes; });
  const auto first = std::find_if(candidates_.begin(), candidates_.end(),
                                  [&](const Candidate& each) { return Agree(each, *winner); });
  const double waited_s = Seconds(fix.stamp_ns - begun_ns_);
  const bool majority = 2 * winner->votes > candidates_.size();
  const bool enough = winner->votes >= config_.min_fixes &&
                      Seconds(fix.stamp_ns - first->fix.stamp_ns) >= config_.min_span_s;
  if ((enough && majority) || (waited_s >= config_.max_wait_s && winner->votes >= 2)) {
    return first->fix.position;
  }
  return std::nullopt;
}

void DatumElection::Reset() {
  candidates_.clear();
  begun_ns_ = 0;
}

void DatumElection::ForgetOldest() {
  const Candidate oldest = candidates_.front();
  candidates_.pop_front();
  for (Candidate& each : candidates_) {
    if (Agree(each, oldest)) --each.votes;
  }
}

}  // namespace livemap::localization
