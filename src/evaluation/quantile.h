#pragma once

#include <vector>

namespace livemap::evaluation {

/// The value below which `fraction` (0..1) of the values lie, by the nearest rank; 0 without
/// values.
double Quantile(std::vector<double> values, double fraction);

}  // namespace livemap::evaluation
