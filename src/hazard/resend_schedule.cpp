#include "hazard/resend_schedule.h"

#include <algorithm>
#include <tuple>

namespace livemap {

ResendSchedule::ResendSchedule(const Config& config, std::mt19937_64 random)
    : config_(config), random_(random) {}

void ResendSchedule::Add(const Uuid& report, int urgency, std::int64_t created_ns, double now_s) {
  entries_[report] = {urgency, created_ns, now_s, config_.first_pause_s};
}

void ResendSchedule::Remove(const Uuid& report) { entries_.erase(report); }

std::vector<Uuid> ResendSchedule::TakeDue(double now_s, std::size_t limit) {
  std::vector<std::map<Uuid, Entry>::iterator> due;
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    if (entry->second.due_s <= now_s) due.push_back(entry);
  }
  std::sort(due.begin(), due.end(), [](const auto& a, const auto& b) {
    return std::tie(a->second.urgency, a->second.created_ns, a->first) <
           std::tie(b->second.urgency, b->second.created_ns, b->first);
  });
  if (due.size() > limit) due.resize(limit);
  std::uniform_real_distribution<double> factor(1 - config_.jitter, 1 + config_.jitter);
  std::vector<Uuid> reports;
  for (const auto entry : due) {
    entry->second.due_s = now_s + entry->second.pause_s * factor(random_);
    entry->second.pause_s = std::min(2 * entry->second.pause_s, config_.longest_pause_s);
    reports.push_back(entry->first);
  }
  return reports;
}

}  // namespace livemap
