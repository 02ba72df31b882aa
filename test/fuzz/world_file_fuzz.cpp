// World files of simulated streets, and what a street's road is made of.
#include <cstdint>
#include <string>

#include "common/error.h"
#include "simulation/world/road_line.h"
#include "simulation/world/world_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const livemap::simulation::WorldDescription world = livemap::simulation::ParseWorldFile(
        std::string(reinterpret_cast<const char*>(data), size), "input");
    // What the reader accepts, a road can be made of.
    if (!world.pieces.empty()) livemap::simulation::RoadLine(world.bearing_deg, world.pieces);
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the reader promises.
  }
  return 0;
}
