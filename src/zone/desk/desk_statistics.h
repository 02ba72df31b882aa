#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "zone/model/decision.h"
#include "zone/model/hazard.h"

namespace livemap::zone {

/// What became of hazards in a period, of one class, on one street or in one week.
struct DeskCounts {
  std::size_t opened = 0;     ///< First seen.
  std::size_t confirmed = 0;  ///< By an official, and that stands.
  std::size_t rejected = 0;
  std::size_t repaired = 0;
  std::vector<double> repair_s;  ///< From first seen to repaired, seconds; in no order.

  /// Of the hazards about which officials decided whether they were there, the share that was:
  /// confirmed / (confirmed + rejected). None where none was judged.
  std::optional<double> Precision() const;
  /// None where none was repaired. Of an even number the mean of the two in the middle.
  std::optional<double> MedianRepairS() const;
};

/// Counts hazards and the decisions about them per class, street and week. Not thread-safe.
///
/// Typical usage: first every decision, the newest first, then every hazard.
class DeskStatistics {
 public:
  /// Of what happened at `from_ns` or later, zone clock.
  explicit DeskStatistics(std::int64_t from_ns) : from_ns_(from_ns) {}

  /// Of decisions about one hazard, the newest that stands and says whether it is there counts, and
  /// the newest repair that stands.
  void AddDecision(const DecisionRecord& decision);
  /// `street`: empty where it is not known.
  void AddHazard(const Hazard& hazard, const std::string& street);
  /// Hazards that were decided about in the period: those of them that are off the map, too, are to
  /// be added.
  std::set<std::string> DecidedHazards() const;

  const std::map<std::string, DeskCounts>& by_class() const { return by_class_; }
  const std::map<std::string, DeskCounts>& by_street() const { return by_street_; }
  /// By the begin of the week, Monday 0 o'clock UTC, ns since 1970.
  const std::map<std::int64_t, DeskCounts>& by_week() const { return by_week_; }
  const DeskCounts& all() const { return all_; }

 private:
  struct Decided {
    bool is_confirmed = false;
    std::int64_t at_ns = 0;
  };

  template <typename Count>
  void Add(const Hazard& hazard, const std::string& street, std::int64_t at_ns, const Count& count);

  std::int64_t from_ns_;
  std::map<std::string, Decided> judged_;       ///< By hazard.
  std::map<std::string, std::int64_t> closed_;  ///< The same: when.
  std::map<std::string, DeskCounts> by_class_;
  std::map<std::string, DeskCounts> by_street_;
  std::map<std::int64_t, DeskCounts> by_week_;
  DeskCounts all_;
};

/// The begin of the week of a stamp, Monday 0 o'clock UTC, ns since 1970.
std::int64_t WeekOf(std::int64_t at_ns);

}  // namespace livemap::zone
