#include "vehicle/outbox/resend_schedule.h"

#include <algorithm>
#include <tuple>

namespace livemap::vehicle {
namespace {

/// No answer for so many first pauses is a silence: under load answers come more often.
constexpr double kSilencePauses = 2;

}  // namespace

ResendSchedule::ResendSchedule(const Config& config, std::mt19937_64 random)
    : config_(config), random_(random) {}

void ResendSchedule::Add(const Uuid& report, int urgency, std::int64_t created_ns, double now_s,
                         double hold_until_s, bool was_sent) {
  if (!last_answer_s_) last_answer_s_ = now_s;
  entries_[report] = {urgency, created_ns,   now_s,   config_.first_pause_s,
                      now_s,   hold_until_s, was_sent};
}

void ResendSchedule::MarkSent(const Uuid& report) {
  const auto found = entries_.find(report);
  if (found != entries_.end()) found->second.was_sent = true;
}

bool ResendSchedule::WasSent(const Uuid& report) const {
  const auto found = entries_.find(report);
  return found != entries_.end() && found->second.was_sent;
}

std::optional<std::int64_t> ResendSchedule::OldestNs() const {
  const auto oldest = std::min_element(
      entries_.begin(), entries_.end(),
      [](const auto& a, const auto& b) { return a.second.created_ns < b.second.created_ns; });
  if (oldest == entries_.end()) return std::nullopt;
  return oldest->second.created_ns;
}

std::size_t ResendSchedule::Held(double now_s) const {
  return static_cast<std::size_t>(
      std::count_if(entries_.begin(), entries_.end(),
                    [now_s](const auto& entry) { return now_s < entry.second.hold_until_s; }));
}

void ResendSchedule::Remove(const Uuid& report) {
  if (entries_.erase(report) != 0) answered_ = true;
}

/// What was sent a moment ago may be on its way and keeps its time.
void ResendSchedule::NoteAnswer(double now_s) {
  const bool was_silent = now_s - *last_answer_s_ > kSilencePauses * config_.first_pause_s;
  answered_ = false;
  last_answer_s_ = now_s;
  if (!was_silent) return;
  for (auto& [report, entry] : entries_) {
    entry.due_s = std::min(entry.due_s, std::max(now_s, entry.sent_s + config_.first_pause_s));
    entry.pause_s = config_.first_pause_s;
  }
}

std::vector<Uuid> ResendSchedule::TakeDue(double now_s, std::size_t limit) {
  if (answered_) NoteAnswer(now_s);
  std::vector<std::map<Uuid, Entry>::iterator> due;
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    const bool held = !cheap_ && now_s < entry->second.hold_until_s;
    if (entry->second.due_s <= now_s && !held) due.push_back(entry);
  }
  std::sort(due.begin(), due.end(), [](const auto& a, const auto& b) {
    return std::tie(a->second.urgency, a->second.created_ns, a->first) <
           std::tie(b->second.urgency, b->second.created_ns, b->first);
  });
  if (due.size() > limit) due.resize(limit);
  std::uniform_real_distribution<double> factor(1 - config_.jitter, 1 + config_.jitter);
  std::vector<Uuid> reports;
  for (const auto entry : due) {
    entry->second.sent_s = now_s;
    entry->second.due_s = now_s + entry->second.pause_s * factor(random_);
    entry->second.pause_s = std::min(2 * entry->second.pause_s, config_.longest_pause_s);
    reports.push_back(entry->first);
  }
  return reports;
}

}  // namespace livemap::vehicle
