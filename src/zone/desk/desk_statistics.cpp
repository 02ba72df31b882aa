#include "zone/desk/desk_statistics.h"

#include <algorithm>

#include "common/time.h"

namespace livemap::zone {

std::optional<double> DeskCounts::Precision() const {
  const std::size_t judged = confirmed + rejected;
  if (judged == 0) return std::nullopt;
  return static_cast<double>(confirmed) / static_cast<double>(judged);
}

std::optional<double> DeskCounts::MedianRepairS() const {
  if (repair_s.empty()) return std::nullopt;
  std::vector<double> sorted = repair_s;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t middle = sorted.size() / 2;
  if (sorted.size() % 2 == 1) return sorted[middle];
  return (sorted[middle - 1] + sorted[middle]) / 2;
}

std::int64_t WeekOf(std::int64_t at_ns) {
  constexpr std::int64_t kDayNs = 86'400'000'000'000;
  const std::int64_t day = at_ns / kDayNs;
  return (day - (day + 3) % 7) * kDayNs;  // 1970 began on a Thursday.
}

void DeskStatistics::AddDecision(const DecisionRecord& decision) {
  if (decision.undone_by != 0 || decision.at_ns < from_ns_) return;
  const bool confirms = decision.kind == DecisionKind::kConfirmHazard;
  if (confirms || decision.kind == DecisionKind::kRejectHazard) {
    judged_.emplace(decision.subject, Decided{confirms, decision.at_ns});
  } else if (decision.kind == DecisionKind::kCloseHazard) {
    closed_.emplace(decision.subject, decision.at_ns);
  }
}

std::set<std::string> DeskStatistics::DecidedHazards() const {
  std::set<std::string> hazards;
  for (const auto& [hazard, decided] : judged_) hazards.insert(hazard);
  for (const auto& [hazard, at_ns] : closed_) hazards.insert(hazard);
  return hazards;
}

template <typename Count>
void DeskStatistics::Add(const Hazard& hazard, const std::string& street, std::int64_t at_ns,
                         const Count& count) {
  for (DeskCounts* counts :
       {&by_class_[hazard.class_name], &by_street_[street], &by_week_[WeekOf(at_ns)], &all_}) {
    count(*counts);
  }
}

void DeskStatistics::AddHazard(const Hazard& hazard, const std::string& street) {
  if (hazard.first_seen_ns >= from_ns_) {
    Add(hazard, street, hazard.first_seen_ns, [](DeskCounts& counts) { ++counts.opened; });
  }
  const std::string id = hazard.uuid.ToString();
  const auto judged = judged_.find(id);
  if (judged != judged_.end()) {
    const bool is_confirmed = judged->second.is_confirmed;
    Add(hazard, street, judged->second.at_ns,
        [&](DeskCounts& counts) { ++(is_confirmed ? counts.confirmed : counts.rejected); });
  }
  const auto closed = closed_.find(id);
  if (closed == closed_.end()) return;
  const double repair_s = std::max(0.0, Seconds(closed->second - hazard.first_seen_ns));
  Add(hazard, street, closed->second, [&](DeskCounts& counts) {
    ++counts.repaired;
    counts.repair_s.push_back(repair_s);
  });
}

}  // namespace livemap::zone
