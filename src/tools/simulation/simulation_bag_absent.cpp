#include "common/error.h"
#include "tools/simulation/simulation_bag.h"

namespace livemap::tools {

std::unique_ptr<SimulationBag> OpenSimulationBag(const std::string& path,
                                                 const SimulationBag::Setup&) {
  throw Error("--bag '" + path + "' is not possible, this build has no ROS");
}

}  // namespace livemap::tools
