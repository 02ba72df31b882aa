#pragma once

#include <vector>

#include "simulation/world/world_file.h"
#include "tools/common/command_line.h"
#include "tools/simulation/simulation_bag.h"
#include "tools/simulation/simulation_setup.h"

namespace livemap::tools {

/// The flags that ReadBagOptions reads; all but --bag itself need --bag.
std::vector<Flag> SimulationBagFlags();
/// Throws Error naming the flag.
SimulationBagConfig ReadBagOptions(const CommandLine& line);

/// The world that --world and --route describe. A route's first point becomes `setup.datum`. Throws
/// what the readers throw, and Error when --start is given beside --route.
simulation::WorldDescription ReadSimulatedWorld(const CommandLine& line, SimulationSetup& setup);
/// Throws Error when a drive of `needed_m` would leave the `road_m` of a --route.
void CheckRouteHolds(const CommandLine& line, double road_m, double needed_m);

}  // namespace livemap::tools
