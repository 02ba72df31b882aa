#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "directory/zone_directory.h"
#include "geo/wgs84.h"

namespace livemap::directory {

/// Decides to which zones' brokers a vehicle that moves should be connected: to its present zone;
/// before it reaches a border also to the zone behind it, so that the way to the next zone is open
/// before the one to the last zone ends; and to a zone left behind for as long as the vehicle has
/// something to say to it. It connects to nothing itself. Not thread-safe.
///
/// Times are steady seconds from any origin.
///
/// Typical usage:
///
///     ZoneHandover handover(config, "centre");
///     handover.Move(*keeper.directory(), position);
///     for (const std::string& zone : handover.Wanted(now_s)) Connect(zone);
class ZoneHandover {
 public:
  struct Config {
    ZoneChoice::Config choice;
    /// A zone is near when the vehicle lies in it, or no further than this from its area, m.
    double near_m = 500;
    /// A zone stays connected so long after the last message to it, s. Longer than the pauses after
    /// which unanswered reports are sent again, or each of those would need a new connection.
    double linger_s = 60;
    /// So long it stays connected at most when messages to it still wait, s.
    double longest_linger_s = 600;
    /// Zones that are wanted at the same time, at least 1. The present one comes first, then the
    /// near ones, the deepest first, then those with the newest messages.
    std::size_t max_zones = 4;
  };

  /// `first` is the id of the present zone until Move finds another one. Throws Error for a number
  /// that is negative or not finite, and for max_zones 0.
  ZoneHandover(const Config& config, const std::string& first);

  /// The vehicle is at `position`. Where no zone is near, the present one stays. Returns whether
  /// the present zone has changed.
  bool Move(const ZoneDirectory& directory, const geo::GeoPoint& position);
  /// A message for the zone with this id goes out.
  void NoteMessage(const std::string& zone, double now_s);

  /// Id of the present zone.
  const std::string& present() const { return present_; }
  /// Ids of the zones that hear where the vehicle is: the present one, then those near.
  const std::vector<std::string>& near() const { return near_; }
  /// Ids of the zones to be connected to now. `waiting` are those for which messages wait.
  std::vector<std::string> Wanted(double now_s, const std::vector<std::string>& waiting = {});

 private:
  const Config config_;
  ZoneChoice choice_;
  std::string present_;
  std::vector<std::string> near_;
  std::map<std::string, double> messages_s_;  // When the last one for a zone went out.
};

}  // namespace livemap::directory
