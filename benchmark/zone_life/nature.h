#pragma once

#include <cstddef>
#include <iterator>

#include "datasets/seeded_random.h"
#include "zone_life/town.h"

namespace livemap::bench {

enum class LifeForm { kExponential, kLogNormal, kWeibull };

// What the town is like: the lives are not those of the catalogue, nor all exponential.
struct Nature {
  const char* name;
  double per_day;
  double mean_life_s;
  LifeForm form;
};
constexpr Nature kNature[] = {
    {"pothole", 3, 20 * kDayS, LifeForm::kLogNormal},
    {"traffic_cone", 6, 1 * kDayS, LifeForm::kExponential},
    {"road_work_sign", 3, 4 * kDayS, LifeForm::kWeibull},
    {"barrier", 2, 10 * kDayS, LifeForm::kWeibull},
    {"debris", 12, 4 * 3600, LifeForm::kExponential},
    {"deer", 12, 480, LifeForm::kExponential},
    {"construction_machine", 3, 1.5 * kDayS, LifeForm::kLogNormal},
    {"stopped_accident", 8, 3600, LifeForm::kLogNormal},
};
constexpr std::size_t kClasses = std::size(kNature);

/// How long one hazard of that kind lives, seconds.
double DrawLife(const Nature& nature, datasets::SeededRandom& random);

}  // namespace livemap::bench
