#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/uuid.h"
#include "geo/map_cell.h"
#include "geo/wgs84.h"

namespace livemap::zone {

/// What vehicles were told of each cell of the map: which hazards are there, which have left it,
/// and by which announcement. So an announcement knows the one before it in its cell, and a vehicle
/// is told what it lacks of a cell. A hazard whose place crosses an edge leaves one cell and comes
/// into another by one announcement.
///
/// It follows the zone's announcements from its making on and keeps nothing on disk: who knows a
/// cell only as it was before that is told the whole cell. Thread-safe.
///
/// Typical usage:
///
///     CellLog log(zone.AnnouncedSequence());
///     for (const Hazard& hazard : told) log.Restore(hazard.uuid, hazard.position, sequence);
///     for (const CellLog::Step& step : log.Announce(uuid, position, is_told, sequence))
///     Tell(step); CellLog::News news = log.Since(cell, sequence_of_the_vehicle, limit);
class CellLog {
 public:
  /// What an announcement is to the vehicles of one cell.
  struct Step {
    geo::MapCell cell;
    /// The announcement before it in this cell, or the newest of all from before the log was made;
    /// 0: there was none.
    std::uint64_t previous = 0;
    bool leaves = false;  ///< The hazard is in another cell now, and removed from this one.
  };

  /// What a vehicle lacks of a cell.
  struct News {
    /// All that drivers know in the cell is in `there`, and what is not is gone; else only what
    /// was announced since.
    bool is_whole = false;
    /// With this all announcements of the cell up to here are known.
    std::uint64_t sequence = 0;
    std::vector<Uuid> there;
    /// Hazards that drivers know no longer in this cell, each with the announcement that said so.
    std::vector<std::pair<Uuid, std::uint64_t>> gone;
  };

  /// Removals that are remembered of one cell; a vehicle that lacks more is told the whole cell.
  static constexpr std::size_t kMaxGone = 500;

  /// `announced` is the newest announcement that was there before.
  explicit CellLog(std::uint64_t announced) : start_(announced), announced_(announced) {}

  /// A hazard that drivers know already, by an announcement of before.
  void Restore(const Uuid& hazard, const geo::GeoPoint& position, std::uint64_t sequence);
  /// The hazard was announced; `is_told`: drivers know it from now on. In ascending order of
  /// `sequence`. The cells whose vehicles are to hear of it: one, or two where it crossed an edge.
  std::vector<Step> Announce(const Uuid& hazard, const geo::GeoPoint& position, bool is_told,
                             std::uint64_t sequence);
  /// For a vehicle that knows all announcements of the cell up to `sequence`; 0: none. More than
  /// was ever announced, which a zone said that began anew since, counts as none. At most `limit`
  /// hazards are there, the newest ones; where more have changed, the whole cell is told.
  News Since(const geo::MapCell& cell, std::uint64_t sequence, std::size_t limit) const;

  /// The newest announcement.
  std::uint64_t announced() const;
  /// Hazards that drivers know.
  std::size_t size() const;

 private:
  struct Place {
    geo::MapCell cell;
    std::uint64_t sequence = 0;
  };
  struct Cell {
    std::uint64_t last = 0;                           ///< Its newest announcement.
    std::uint64_t complete_from = 0;                  ///< What was removed since is in `gone`.
    std::map<std::uint64_t, Uuid> there;              ///< By announcement.
    std::deque<std::pair<Uuid, std::uint64_t>> gone;  ///< In the order of announcements.
  };

  Cell& NoteStep(const geo::MapCell& cell, const geo::MapCell& place, std::uint64_t sequence,
                 std::vector<Step>& steps) REQUIRES(mutex_);
  static void Leave(Cell& cell, const Uuid& hazard, std::uint64_t sequence);

  mutable Mutex mutex_;
  const std::uint64_t start_;
  std::uint64_t announced_ GUARDED_BY(mutex_);
  std::unordered_map<Uuid, Place> places_ GUARDED_BY(mutex_);  ///< Of those that drivers know.
  std::unordered_map<std::uint32_t, Cell> cells_ GUARDED_BY(mutex_);  ///< By number.
};

}  // namespace livemap::zone
