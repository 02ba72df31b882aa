#include "zone/belief/class_model.h"

#include <algorithm>

#include "zone/model/presence_record.h"

namespace livemap::zone {

ClassModel ClassModelOf(const protocol::HazardClass& entry, const ClassSurvival& survival) {
  ClassModel result;
  result.confirmations = static_cast<std::uint32_t>(
      std::clamp(entry.confirmations, 1, static_cast<int>(kMaxEvidencePerHazard)));
  result.hit_rate = entry.hit_rate;
  result.false_rate = entry.false_rate;
  result.survival = survival;
  return result;
}

}  // namespace livemap::zone
