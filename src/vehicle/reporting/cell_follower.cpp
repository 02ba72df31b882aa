#include "vehicle/reporting/cell_follower.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/error.h"

namespace livemap::vehicle {
namespace {

/// The vehicle looks for cells anew after so many metres: it takes a tenth of a millisecond.
constexpr double kStepM = 100;

}  // namespace

CellFollower::CellFollower(const Config& config) : config_(config) {
  for (const double number :
       {config.radius_m, config.hysteresis_m, config.refresh_s, config.retry_s,
        config.longest_retry_s, config.rest_s, config.lag_s}) {
    if (std::isfinite(number) && number >= 0) continue;
    throw Error("a number of the cells that are followed is " + std::to_string(number) +
                ", accepted is 0 or more");
  }
  if (config.max_cells < 1 || config.max_cells > protocol::kMaxRequestedCells) {
    throw Error("the number of cells that are followed is " + std::to_string(config.max_cells) +
                ", accepted is 1 to " + std::to_string(protocol::kMaxRequestedCells));
  }
}

bool CellFollower::MoveTo(const geo::GeoPoint& position) {
  if (config_.radius_m <= 0) return false;
  if (looked_from_ && geo::GeodesicDistanceM(*looked_from_, position) < kStepM) return false;
  looked_from_ = position;
  const double radius_m = config_.radius_m + kStepM;
  std::vector<geo::MapCell> cells = geo::MapCellsWithin(position, radius_m, config_.max_cells);
  // The nearest ones of before, as far as there is room.
  std::vector<std::pair<double, geo::MapCell>> kept;
  for (const geo::MapCell& cell : wanted_) {
    const double distance_m = cell.DistanceM(position);
    if (distance_m > radius_m + config_.hysteresis_m) continue;
    if (std::find(cells.begin(), cells.end(), cell) == cells.end()) {
      kept.emplace_back(distance_m, cell);
    }
  }
  std::sort(kept.begin(), kept.end());
  for (const auto& [distance_m, cell] : kept) {
    if (cells.size() < config_.max_cells) cells.push_back(cell);
  }
  std::sort(cells.begin(), cells.end());
  if (cells == wanted_) return false;
  wanted_ = std::move(cells);
  return true;
}

void CellFollower::SetHeard(const std::string& zone, const std::vector<geo::MapCell>& cells) {
  if (cells.empty()) {
    zones_.erase(zone);
    return;
  }
  std::map<geo::MapCell, Asked> heard;
  std::map<geo::MapCell, Asked>& before = zones_[zone];
  for (const geo::MapCell& cell : cells) {
    const auto known = before.find(cell);
    heard.emplace(cell, known == before.end() ? Asked{} : known->second);
  }
  before = std::move(heard);
}

void CellFollower::NoteAnswer(const std::string& zone, const geo::MapCell& cell, double now_s) {
  const auto cells = zones_.find(zone);
  if (cells == zones_.end()) return;
  const auto asked = cells->second.find(cell);
  if (asked == cells->second.end()) return;
  asked->second = Asked{now_s + config_.refresh_s, 0, true, std::nullopt};
}

void CellFollower::AskAgain(const std::string& zone) {
  const auto cells = zones_.find(zone);
  if (cells == zones_.end()) return;
  for (auto& [cell, asked] : cells->second) {
    // A zone that answers and wants to be asked in turns gets no more questions than one that does
    // not answer. One that wants to be asked what it has been asked never got the question.
    if (asked.is_answered) {
      asked = Asked{AnsweredS(asked) + config_.rest_s, 0, false, {}};
    } else if (asked.due_s) {
      asked.due_s = *asked.due_s - asked.retry_s + std::min(asked.retry_s, config_.rest_s);
      asked.retry_s = std::min(asked.retry_s, config_.rest_s);
    }
  }
}

bool CellFollower::IsDue(Asked& asked, bool has_gap, double now_s) const {
  if (!asked.due_s || now_s >= *asked.due_s) return true;
  if (!has_gap) {
    asked.gap_s.reset();
    return false;
  }
  if (!asked.gap_s) asked.gap_s = now_s;
  // A gap that the answer left open is not asked about at once.
  return asked.is_answered && now_s - *asked.gap_s >= config_.lag_s &&
         now_s - AnsweredS(asked) >= std::min(config_.rest_s, config_.refresh_s);
}

std::vector<protocol::CellRequest> CellFollower::TakeDue(double now_s,
                                                         const KnowledgeOf& knowledge_of) {
  std::vector<protocol::CellRequest> requests;
  for (auto& [zone, cells] : zones_) {
    if (!asked_zones_.empty() && asked_zones_.count(zone) == 0) continue;
    protocol::CellRequest request;
    request.zone = zone;
    for (auto& [cell, asked] : cells) {
      const Knowledge knowledge = knowledge_of(zone, cell);
      if (!IsDue(asked, knowledge.has_gap, now_s)) continue;
      asked.retry_s = asked.retry_s > 0 ? std::min(2 * asked.retry_s, config_.longest_retry_s)
                                        : config_.retry_s;
      asked.due_s = now_s + asked.retry_s;
      asked.is_answered = false;
      asked.gap_s.reset();
      request.cells.push_back({cell, knowledge.sequence});
      if (request.cells.size() >= protocol::kMaxRequestedCells) break;
    }
    if (!request.cells.empty()) requests.push_back(std::move(request));
  }
  return requests;
}

std::size_t CellFollower::heard() const {
  std::size_t count = 0;
  for (const auto& [zone, cells] : zones_) count += cells.size();
  return count;
}

std::size_t CellFollower::unanswered() const {
  std::size_t count = 0;
  for (const auto& [zone, cells] : zones_) {
    count += static_cast<std::size_t>(std::count_if(
        cells.begin(), cells.end(), [](const auto& cell) { return !cell.second.is_answered; }));
  }
  return count;
}

}  // namespace livemap::vehicle
