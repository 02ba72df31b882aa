#pragma once

#include <cmath>

namespace livemap {

/// The probability of these log odds: the logistic function.
inline double ProbabilityOf(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

/// ln(p / (1 - p)) of a probability within (0, 1): the inverse of ProbabilityOf.
inline double LogOddsOf(double probability) { return std::log(probability / (1 - probability)); }

}  // namespace livemap
