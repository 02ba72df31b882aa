#pragma once

// What the sources of HazardLifecycle share; nobody else includes this.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "zone/belief/hazard_lifecycle.h"

namespace livemap::zone {

inline double Probability(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }
inline double LogOdds(double probability) { return std::log(probability / (1 - probability)); }

/// Cut where a character begins.
inline std::string ReasonText(std::string text) {
  constexpr std::size_t kMaxBytes = 200;
  if (text.size() <= kMaxBytes) return text;
  std::size_t size = kMaxBytes;
  while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xC0U) == 0x80U) --size;
  text.resize(size);
  return text;
}

inline LifecycleTransition Transition(const PresenceRecord& life, HazardState to,
                                      std::string reason) {
  return {life.state, to, ReasonText(std::move(reason))};
}

inline void Enter(HazardState state, std::int64_t now_ns, PresenceRecord& life) {
  life.state = state;
  life.since_ns = now_ns;
}

inline void RecordConfirmation(std::int64_t stamp_ns, PresenceRecord& life) {
  life.first_seen_ns = life.first_seen_ns == 0 ? stamp_ns : std::min(life.first_seen_ns, stamp_ns);
  life.last_yes_ns = std::max(life.last_yes_ns, stamp_ns);
  if (life.first_no_ns <= life.last_yes_ns) life.first_no_ns = 0;
}

}  // namespace livemap::zone
