#include "zone/registry/cell_log.h"

#include <algorithm>

namespace livemap::zone {

void CellLog::Restore(const Uuid& hazard, const geo::GeoPoint& position, std::uint64_t sequence) {
  const MutexLock lock(mutex_);
  const geo::MapCell place = geo::MapCell::At(position);
  if (!places_.emplace(hazard, Place{place, sequence}).second) return;
  cells_[place.number()].there.emplace(sequence, hazard);
}

std::vector<CellLog::Step> CellLog::Announce(const Uuid& hazard, const geo::GeoPoint& position,
                                             bool is_told, std::uint64_t sequence) {
  const MutexLock lock(mutex_);
  announced_ = std::max(announced_, sequence);
  const geo::MapCell place = geo::MapCell::At(position);
  const auto known = places_.find(hazard);
  std::vector<Step> steps;
  if (known != places_.end()) {
    const Place before = known->second;
    cells_[before.cell.number()].there.erase(before.sequence);
    if (!is_told || before.cell != place) {
      Leave(NoteStep(before.cell, place, sequence, steps), hazard, sequence);
    }
    places_.erase(known);
  } else if (!is_told) {
    Leave(NoteStep(place, place, sequence, steps), hazard, sequence);
  }
  if (!is_told) return steps;
  NoteStep(place, place, sequence, steps).there.emplace(sequence, hazard);
  places_.emplace(hazard, Place{place, sequence});
  return steps;
}

/// The announcement is the newest of that cell now; `place` is where the hazard lies.
CellLog::Cell& CellLog::NoteStep(const geo::MapCell& cell, const geo::MapCell& place,
                                 std::uint64_t sequence, std::vector<Step>& steps) {
  Cell& entry = cells_[cell.number()];
  // What was removed before the start is not known: who was not told of it must ask.
  steps.push_back({cell, std::max(entry.last, start_), cell != place});
  entry.last = sequence;
  return entry;
}

void CellLog::Leave(Cell& cell, const Uuid& hazard, std::uint64_t sequence) {
  cell.gone.emplace_back(hazard, sequence);
  if (cell.gone.size() <= kMaxGone) return;
  cell.complete_from = cell.gone.front().second;
  cell.gone.pop_front();
}

CellLog::News CellLog::Since(const geo::MapCell& cell, std::uint64_t sequence,
                             std::size_t limit) const {
  const MutexLock lock(mutex_);
  News news;
  news.sequence = announced_;
  const auto found = cells_.find(cell.number());
  const bool is_known = sequence > 0 && sequence <= announced_ && sequence >= start_ &&
                        (found == cells_.end() || sequence >= found->second.complete_from);
  news.is_whole = !is_known;
  if (found == cells_.end()) return news;
  const Cell& entry = found->second;
  if (is_known) {
    auto there = entry.there.upper_bound(sequence);
    for (; there != entry.there.end(); ++there) news.there.push_back(there->second);
    // Mostly none has left since.
    auto gone = entry.gone.end();
    while (gone != entry.gone.begin() && std::prev(gone)->second > sequence) --gone;
    news.gone.assign(gone, entry.gone.end());
    if (news.there.size() + news.gone.size() <= limit) return news;
    news = {true, announced_, {}, {}};
  }
  for (auto there = entry.there.rbegin(); there != entry.there.rend(); ++there) {
    if (news.there.size() >= limit) break;
    news.there.push_back(there->second);
  }
  return news;
}

std::uint64_t CellLog::announced() const {
  const MutexLock lock(mutex_);
  return announced_;
}

std::size_t CellLog::size() const {
  const MutexLock lock(mutex_);
  return places_.size();
}

}  // namespace livemap::zone
