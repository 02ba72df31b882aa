// What HazardLifecycle accepts as its parameters.
#include <cmath>

#include "common/checks.h"
#include "zone/belief/hazard_lifecycle.h"

namespace livemap::zone {
namespace {

double ConfiguredOdds(double probability) { return std::log(probability / (1 - probability)); }

}  // namespace

HazardLifecycle::HazardLifecycle() : HazardLifecycle(Config()) {}

HazardLifecycle::HazardLifecycle(const Config& config) : config_(config) {
  CheckRange("gone_below", config.gone_below, 0.01, 0.5);
  CheckRange("surest", config.max_presence, 0.9, 0.9999);
  CheckRange("prior_presence", config.prior_presence, 0.01, config.max_presence);
  CheckRange("verify_below", config.verify_below, config.gone_below, config.max_presence);
  CheckRange("sure_above", config.settled_above, config.verify_below, config.max_presence);
  CheckRange("active_above", config.active_above, config.gone_below, config.max_presence);
  CheckRange("active_alone_above", config.active_alone_above, config.gone_below,
             config.active_above);
  CheckRange("hostile_share", config.hostile_share, 0.001, 0.4);
  CheckRange("suspect_above", config.suspect_above, config.hostile_share + 0.001, 1);
  CheckRange("most_against", config.max_trust_step, 0, 10);
  CheckRange("official_weight", config.official_weight, 0, 10);
  CheckRange("denials", config.denials, 2, kMaxEvidencePerHazard - 1);
  CheckRange("quarantine_s", config.quarantine_s, 0, 1e9);
  CheckRange("reopen_vehicles", config.reopen_vehicles, 2, kMaxEvidencePerHazard);
  CheckRange("rejected_keep_s", config.rejected_keep_s, 3600, 1e9);
  max_log_odds_ = ConfiguredOdds(config.max_presence);
  max_voice_ = -ConfiguredOdds(config.hostile_share);
}

}  // namespace livemap::zone
