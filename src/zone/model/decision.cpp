#include "zone/model/decision.h"

#include <cmath>

#include "common/number_text.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxEffectsBytes = 500;
constexpr std::size_t kMaxVehicles = 8;  // A hazard has no more voices.

}  // namespace

std::string PackEffects(const DecisionEffects& effects) {
  std::string line;
  AppendNumber(line, effects.stood_s);
  AppendNumber(line, effects.suspicions.size());
  for (const SuspicionChange& change : effects.suspicions) {
    AppendNumber(line, change.vehicle);
    AppendNumber(line, change.added);
  }
  return line;
}

std::optional<DecisionEffects> UnpackEffects(const std::string& text) {
  if (text.empty()) return DecisionEffects();
  if (text.size() > kMaxEffectsBytes) return std::nullopt;
  NumberReader reader(text);
  DecisionEffects effects;
  std::size_t count = 0;
  reader.Read(effects.stood_s);
  reader.Read(count);
  if (!reader.good() || count > kMaxVehicles || !std::isfinite(effects.stood_s)) {
    return std::nullopt;
  }
  effects.suspicions.resize(count);
  for (SuspicionChange& change : effects.suspicions) {
    reader.Read(change.vehicle);
    reader.Read(change.added);
    if (!reader.good() || change.vehicle == 0 || !std::isfinite(change.added)) return std::nullopt;
  }
  return reader.good() && reader.done() ? std::optional(std::move(effects)) : std::nullopt;
}

}  // namespace livemap::zone
