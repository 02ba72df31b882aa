#include "tools/simulation/simulation_flags.h"

#include <cmath>
#include <sstream>

#include "common/error.h"
#include "datasets/route.h"
#include "simulation/world/route_road.h"

namespace livemap::tools {

std::vector<Flag> SimulationBagFlags() {
  return {
      {"bag", "FILE.bag", "rosbag with the topics of a real vehicle and truth"},
      {"bag-depth", "", "depth images in the bag too, as --depth measures"},
      {"jpeg-quality", "Q", "of the bag's pictures, 1 to 100 (88)"},
      {"fix-rate", "HZ", "receiver fixes per second, 1 to 10 (10)"},
      {"fix-noise-m", "M", "receiver's white noise, sigma per axis (0.5)"},
      {"fix-bias-m", "M", "receiver's slow error, sigma per axis (0)"},
      {"fix-bias-time-s", "S", "correlation time of the slow error (60)"},
      {"fix-dropouts-per-min", "N", "losses of the fix per minute (0)"},
      {"fix-dropout-s", "S", "mean length of a loss (3)"},
      {"multipath-m", "M", "receiver's error where houses hide half the sky, sigma; 0: none (2)"},
  };
}

SimulationBagConfig ReadBagOptions(const CommandLine& line) {
  for (const Flag& flag : SimulationBagFlags()) {
    if (line.Has(flag.name) && !line.Has("bag")) {
      throw Error("--" + flag.name + " needs --bag, which writes what it makes");
    }
  }
  SimulationBagConfig options;
  options.depth = line.Has("bag-depth");
  options.jpeg_quality =
      static_cast<int>(line.Number("jpeg-quality", options.jpeg_quality, 1, 100));
  options.fix_rate_hz = line.Number("fix-rate", options.fix_rate_hz, 1, 10);
  datasets::GnssReceiverNoise& noise = options.noise;
  noise.white_sigma_m = line.Number("fix-noise-m", noise.white_sigma_m, 0, 1000);
  noise.bias_sigma_m = line.Number("fix-bias-m", noise.bias_sigma_m, 0, 1000);
  noise.bias_time_constant_s =
      line.Number("fix-bias-time-s", noise.bias_time_constant_s, 0.01, 1e6);
  noise.dropouts_per_minute =
      line.Number("fix-dropouts-per-min", noise.dropouts_per_minute, 0, 600);
  noise.dropout_mean_s = line.Number("fix-dropout-s", noise.dropout_mean_s, 0.01, 3600);
  options.multipath_m = line.Number("multipath-m", options.multipath_m, 0, 100);
  return options;
}

simulation::WorldDescription ReadSimulatedWorld(const CommandLine& line, SimulationSetup& setup) {
  const bool route = line.Has("route");
  if (route && line.Has("start")) {
    throw Error("--route and --start exclude each other: a route begins at its first point");
  }
  simulation::WorldDescription world;
  if (line.Has("world")) {
    world = simulation::ReadWorldFile(
        line.Text("world", ""),
        route ? simulation::RoadSource::kRoute : simulation::RoadSource::kWorldFile);
  }
  if (!route) return world;
  const std::string path = line.Text("route", "");
  const std::vector<geo::GeoPoint> points = datasets::ReadRoutePoints(path);
  const simulation::RouteRoad road = simulation::LayRoad(points, path);
  world.bearing_deg = road.bearing_deg;
  world.pieces = road.pieces;
  setup.datum = points.front();
  return world;
}

void CheckRouteHolds(const CommandLine& line, double road_m, double needed_m) {
  if (!line.Has("route") || needed_m <= road_m) return;
  std::ostringstream sentence;
  sentence.precision(1);
  sentence << std::fixed << "the road along --route '" << line.Text("route", "") << "' is "
           << road_m << " m long and the drive goes " << needed_m
           << " m, accepted is a longer route or fewer --seconds";
  throw Error(sentence.str());
}

}  // namespace livemap::tools
