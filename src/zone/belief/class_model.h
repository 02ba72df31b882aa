#pragma once

#include <cstdint>

#include "protocol/hazard_catalogue.h"
#include "zone/belief/survival_model.h"

namespace livemap::zone {

/// What HazardLifecycle knows of a hazard's class; made by ClassModelOf, cheap to copy.
struct ClassModel {
  std::uint32_t confirmations =
      2;  ///< Distinct vehicles before drivers are told, 1 to kMaxEvidencePerHazard.
  double hit_rate = 0.85;    ///< P(a vehicle that looks says yes | it is there).
  double false_rate = 0.03;  ///< P(the same | it is not there).
  ClassSurvival survival;
};

/// Its catalogue entry, with what the zone has learnt of how long such a hazard stands.
ClassModel ClassModelOf(const protocol::HazardClass& entry, const ClassSurvival& survival);

}  // namespace livemap::zone
