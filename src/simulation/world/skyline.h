#pragma once

#include "datasets/sensors/gnss_multipath.h"
#include "simulation/world/street.h"

namespace livemap::simulation {

/// Of a receiver's antenna over the road.
constexpr double kAntennaHeightM = 1.5;

/// How high the house fronts stand over an antenna `along_m` along the road and `left_m` beside its
/// middle line. Fronts are taken as 10 m high (the builder's mean, gables not regarded) where the
/// street's plan has houses: not in parks, not at crossings, thinner between gardens; the elevation
/// is the mean over 20 m of road before and behind, as satellites along the street see no front.
/// Trees do not count. A pure function that renders nothing.
datasets::SkyVisibility SkyOver(const Street& street, double along_m, double left_m);

}  // namespace livemap::simulation
