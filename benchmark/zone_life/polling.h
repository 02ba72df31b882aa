#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "zone/polling/poll_scheduler.h"

namespace livemap::bench {

/// How often vehicles are asked: what the study compares.
struct PollingRule {
  enum class Kind {
    kWorth,     ///< PollScheduler; `value`: the price, seconds.
    kInterval,  ///< Every `value` seconds, the same for all.
    kLife,      ///< Every `value` times the class's expected life.
    kInsist,    ///< As kInterval, but after a no the next vehicle is asked at once.
    kNobody,
  };
  Kind kind = Kind::kWorth;
  double value = 120;
  double bytes_per_hour = 1e9;  ///< Of kWorth.
};

/// Asks by one of the rules; all ask one vehicle at a time that is about to pass, none twice within
/// PollScheduler's gap.
class Polling {
 public:
  explicit Polling(const PollingRule& rule);

  void SetHazard(std::uint64_t hazard, const geo::GeoPoint& place, const zone::ClassModel& entry,
                 const zone::PresenceRecord& life, bool denied, std::int64_t now_ns);
  struct Question {
    std::uint64_t hazard;
    std::string vehicle;
  };
  /// `vehicle` is about to pass `hazard`; the polls that go out now, to whomever.
  std::vector<Question> Approach(std::uint64_t hazard, const std::string& vehicle,
                                 const zone::TrackPoint& point);
  /// The vehicle has answered, whatever it was.
  void Answered(std::uint64_t hazard, const std::string& vehicle, std::int64_t now_ns);

  double bytes() const;
  std::uint64_t polls() const { return polls_; }

 private:
  struct Timer {
    double interval_s = 0;
    std::int64_t settled_ns = 0;
    bool open = false;
    std::unordered_map<std::string, std::int64_t> asked_ns;
  };

  PollingRule rule_;
  zone::PollScheduler::Config config_;
  std::unique_ptr<zone::PollScheduler> scheduler_;
  std::map<std::pair<std::uint64_t, std::string>, Uuid> open_;  ///< By hazard and vehicle.
  std::unordered_map<std::uint64_t, Timer> timers_;
  std::uint64_t polls_ = 0;
};

}  // namespace livemap::bench
