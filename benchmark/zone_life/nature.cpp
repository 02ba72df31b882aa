#include "zone_life/nature.h"

#include <cmath>

namespace livemap::bench {

double DrawLife(const Nature& nature, datasets::SeededRandom& random) {
  constexpr double kSigma = 0.8;
  constexpr double kWeibullShape = 1.5;
  switch (nature.form) {
    case LifeForm::kExponential:
      return random.Exponential(nature.mean_life_s);
    case LifeForm::kLogNormal:
      return nature.mean_life_s * std::exp(kSigma * random.Normal().x() - 0.5 * kSigma * kSigma);
    case LifeForm::kWeibull:
      return nature.mean_life_s / std::tgamma(1 + 1 / kWeibullShape) *
             std::pow(random.Exponential(1), 1 / kWeibullShape);
  }
  return 0;
}

}  // namespace livemap::bench
