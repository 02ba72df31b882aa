#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "geo/map_cell.h"
#include "geo/wgs84.h"
#include "protocol/cell_news.h"

namespace livemap::vehicle {

/// Decides of which cells of the map a vehicle hears as it drives, and when it asks a zone what it
/// lacks of them: once the zone's broker lets it hear of a cell, so that nothing is missed between
/// answer and announcements; after the connection was lost; where an announcement names one that
/// never came; and from time to time, because the newest announcement may be lost without a trace.
/// Knows no store, no clock and no network. Not thread-safe.
///
/// Times are steady seconds from any origin.
///
/// Typical usage:
///
///     CellFollower follower({});
///     if (follower.MoveTo(position)) TellBridge(follower.wanted());
///     follower.SetHeard(zone, cells);  // As the bridge says.
///     for (const protocol::CellRequest& request : follower.TakeDue(now_s, knowledge))
///     Send(request); follower.NoteAnswer(zone, cell, now_s);  // As the zone answers.
class CellFollower {
 public:
  struct Config {
    /// The vehicle hears of the cells that come as near as this, m; 0: of none.
    double radius_m = 1500;
    /// It goes on to hear of a cell until that is further away than the radius by this, m.
    double hysteresis_m = 300;
    std::size_t max_cells = 48;  ///< The nearest ones; at most protocol::kMaxRequestedCells.
    double refresh_s = 60;       ///< After an answer the vehicle asks again.
    /// Without an answer; doubled each time. While the connection lasts an answer is seldom lost
    /// and often late: asked for again, it comes twice, for which a zone with much to tell has no
    /// time.
    double retry_s = 20;
    double longest_retry_s = 60;
    double rest_s = 5;  ///< From an answer to a question about what it left open.
    double lag_s = 1;   ///< Announcements that came ahead of others wait so long for these.
  };
  /// What the vehicle knows of a cell.
  struct Knowledge {
    std::uint64_t sequence = 0;  ///< Up to which announcement it knows all; 0: it knows nothing.
    bool has_gap = false;        ///< An announcement came ahead of one that is missing.
  };
  using KnowledgeOf = std::function<Knowledge(const std::string& zone, const geo::MapCell& cell)>;

  /// Throws Error for a number that is negative or not finite, and for too many cells.
  explicit CellFollower(const Config& config);

  /// The vehicle is at a valid position. Returns whether wanted() has changed.
  bool MoveTo(const geo::GeoPoint& position);
  /// The cells of which the vehicle wants to hear, sorted.
  const std::vector<geo::MapCell>& wanted() const { return wanted_; }
  /// The zone's broker lets the vehicle hear of these cells, from now on and on one connection
  /// without a break: after a break none comes first.
  void SetHeard(const std::string& zone, const std::vector<geo::MapCell>& cells);
  /// Only these zones are asked, by their ids: a question keeps the way to a zone open. None: all.
  void SetZones(const std::vector<std::string>& zones) {
    asked_zones_ = {zones.begin(), zones.end()};
  }
  /// The zone has said what the vehicle lacked of the cell.
  void NoteAnswer(const std::string& zone, const geo::MapCell& cell, double now_s);
  /// The zone wants to be asked again about what the vehicle hears of: it knows nothing of it.
  void AskAgain(const std::string& zone);
  /// What to ask now, each zone at most once.
  std::vector<protocol::CellRequest> TakeDue(double now_s, const KnowledgeOf& knowledge_of);
  /// Cells of all zones of which the vehicle hears, and of these those of which it waits for an
  /// answer.
  std::size_t heard() const;
  std::size_t unanswered() const;

 private:
  struct Asked {
    std::optional<double> due_s;  ///< None: at once.
    double retry_s = 0;
    bool is_answered = false;
    std::optional<double> gap_s;  ///< Since when there is one.
  };

  bool IsDue(Asked& asked, bool has_gap, double now_s) const;
  /// When the answer came, of one that is answered.
  double AnsweredS(const Asked& asked) const { return *asked.due_s - config_.refresh_s; }

  const Config config_;
  std::vector<geo::MapCell> wanted_;
  std::optional<geo::GeoPoint> looked_from_;                    ///< Where wanted_ was found out.
  std::set<std::string> asked_zones_;                           ///< Empty: all.
  std::map<std::string, std::map<geo::MapCell, Asked>> zones_;  ///< Those heard, by zone's id.
};

}  // namespace livemap::vehicle
