#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "zone_life/polling.h"

namespace livemap::bench {

/// What decides that drivers are told.
enum class TellingRule {
  kLife,   ///< HazardLifecycle.
  kCount,  ///< The naive one: messages for it less messages against it, whoever sent them.
};

struct StudyConfig {
  std::uint64_t seed = 1;
  int days = 35;
  int warm_up_days = 7;  ///< Hazards and lives of these are not counted...
  int last_days = 2;     ///< ...nor what ends in these.
  std::size_t vehicles = 400;
  double malicious_share = 0;
  TellingRule telling = TellingRule::kLife;
  bool trust = true;  ///< kLife: learns whom to believe.
  PollingRule polling;
};

/// What happened to the hazards of one class.
struct ClassFigures {
  std::uint64_t appeared = 0;    ///< Hazards that there were.
  std::uint64_t told = 0;        ///< Of them, drivers were told in time.
  std::uint64_t noticeable = 0;  ///< Enough honest vehicles saw them while they stood.
  std::uint64_t untold = 0;      ///< Of those, drivers never heard while they stood.
  std::uint64_t dropped = 0;     ///< Taken away while they stood, each time counted.
  std::uint64_t false_told = 0;  ///< Drivers were told of nothing.
  double wrong_s = 0;            ///< Time that drivers were told of what was not there.
  double missing_s = 0;          ///< Time that hazards stood after being noticeable and untold.
  std::vector<double> minutes_until_gone;  ///< Of vanished ones that drivers were told of.
  double learned_life_s = 0;
  double true_life_s = 0;
  double prior_life_s = 0;
};

struct StudyFigures {
  std::map<std::string, ClassFigures> classes;
  std::uint64_t polls = 0;
  double poll_bytes = 0;
  double measured_days = 0;
  std::uint64_t traversals = 0;
  std::uint64_t refused_by_allowance = 0;
  std::uint64_t honest_suspects = 0;   ///< Honest vehicles that in the end do not count as one...
  std::uint64_t hostile_suspects = 0;  ///< ...and hostile ones.
  std::uint64_t hostile = 0;           ///< Of all.
};

/// Simulates the weeks. `catalogue`: config/hazards.yaml.
StudyFigures RunStudy(const StudyConfig& config, const protocol::HazardCatalogue& catalogue);

}  // namespace livemap::bench
