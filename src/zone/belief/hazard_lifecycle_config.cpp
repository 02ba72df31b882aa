// What HazardLife accepts as its parameters.
#include <cmath>

#include "common/checks.h"
#include "zone/belief/hazard_lifecycle.h"

namespace livemap {
namespace {

double ConfiguredOdds(double probability) { return std::log(probability / (1 - probability)); }

}  // namespace

HazardLife::HazardLife() : HazardLife(Config()) {}

HazardLife::HazardLife(const Config& config) : config_(config) {
  CheckRange("gone_below", config.gone_below, 0.01, 0.5);
  CheckRange("surest", config.surest, 0.9, 0.9999);
  CheckRange("prior_presence", config.prior_presence, 0.01, config.surest);
  CheckRange("verify_below", config.verify_below, config.gone_below, config.surest);
  CheckRange("sure_above", config.sure_above, config.verify_below, config.surest);
  CheckRange("active_above", config.active_above, config.gone_below, config.surest);
  CheckRange("active_alone_above", config.active_alone_above, config.gone_below,
             config.active_above);
  CheckRange("hostile_share", config.hostile_share, 0.001, 0.4);
  CheckRange("suspect_above", config.suspect_above, config.hostile_share + 0.001, 1);
  CheckRange("most_against", config.most_against, 0, 10);
  CheckRange("official_weight", config.official_weight, 0, 10);
  CheckRange("vanished_hit_rate", config.vanished_hit_rate, 0.1, 1);
  CheckRange("vanished_false_rate", config.vanished_false_rate, 0, config.vanished_hit_rate);
  CheckRange("denials", config.denials, 2, kMaxVoices - 1);
  CheckRange("quarantine_s", config.quarantine_s, 0, 1e9);
  CheckRange("reopen_vehicles", config.reopen_vehicles, 2, kMaxVoices);
  CheckRange("rejected_keep_s", config.rejected_keep_s, 3600, 1e9);
  max_log_odds_ = ConfiguredOdds(config.surest);
  max_voice_ = -ConfiguredOdds(config.hostile_share);
}

}  // namespace livemap
